# SPDX-License-Identifier: MIT
"""Standard deviations are calibrated: an interval of +- 1.96 of them covers the truth of simulated structures."""

from __future__ import annotations

import os
from collections.abc import Iterator

import numpy as np
import pytest
import systems
from numpy.typing import NDArray
from okid import Session, identify
from okid.result.result import Result

Array = NDArray[np.float64]
SLOW = os.environ.get("OKID_SLOW") == "1"
W1 = systems.w1()
DOFS = {"input_dofs": [1], "output_dofs": [1, 2, 3]}
KINDS = ("f", "zeta", "M", "K", "R", "R_normal", "alpha", "beta")


def _truth() -> dict[str, Array]:
    f, zeta = W1.modes()
    omega = 2.0 * np.pi * f
    alpha, beta = np.linalg.lstsq(np.column_stack([0.5 / omega, 0.5 * omega]), zeta, rcond=None)[0]
    return {
        "f": f, "zeta": zeta, "M": W1.M, "K": W1.K, "R": W1.R, "R_normal": W1.R, "alpha": np.array([alpha]),
        "beta": np.array([beta]),
    }  # fmt: skip


TRUTH = _truth()


def _scores(result: Result) -> dict[str, Array]:
    """Errors in units of their standard deviations, by kind; of the symmetric matrices each entry once."""
    mkr, pdc = result.mkr, result.pdc
    assert mkr is not None and pdc is not None and len(result.modes) == 3
    upper = np.triu_indices(3)
    pairs = {
        "f": ([m.frequency_hz for m in result.modes], [m.frequency_std_hz for m in result.modes]),
        "zeta": ([m.damping_ratio for m in result.modes], [m.damping_ratio_std for m in result.modes]),
        "M": (mkr.M, mkr.M_std),
        "K": (mkr.K, mkr.K_std),
        "R": (mkr.R, mkr.R_std),
        "R_normal": (mkr.R_normal_modes, mkr.R_normal_modes_std),
        "alpha": ([pdc.alpha], [pdc.alpha_std]),
        "beta": ([pdc.beta], [pdc.beta_std]),
    }
    out = {}
    for kind, (value, std) in pairs.items():
        z = (np.array(value, float) - TRUTH[kind]) / np.array(std, float)
        out[kind] = z[upper] if z.ndim == 2 else z
    return out


def _pooled(results: Iterator[Result]) -> dict[str, Array]:
    scores = [_scores(result) for result in results]
    return {kind: np.array([one[kind] for one in scores]) for kind in KINDS}


def _assert_covered(pooled: dict[str, Array], low: float, high: float) -> None:
    covered = {kind: 100.0 * float(np.mean(np.abs(z) <= 1.96)) for kind, z in pooled.items()}
    assert all(low <= x <= high for x in covered.values()), covered


def _records(count: int, samples: int) -> Iterator[tuple[Array, Array]]:
    for seed in range(1, count + 1):
        yield systems.record(W1, samples, 1.0, seed)


def test_the_default_method_covers_the_truth() -> None:
    """200 records, 1 % noise: pooled by kind, 90 to 98 % of the 95 % intervals hold the true value."""
    found = (identify(u, y, fs=W1.fs, order=6, **DOFS) for u, y in _records(200, 10000))
    _assert_covered(_pooled(found), 90.0, 98.0)


@pytest.mark.parametrize("method", ["okid-era-dc", "n4sid-moesp", "n4sid-cva", "n4sid-ssarx"])
def test_the_other_methods_cover_the_truth(method: str) -> None:
    """200 records in the slow tier; else few, where only a deviation wrong by a third would show."""
    count = 200 if SLOW else 30
    found = (
        identify(u, y, fs=W1.fs, order=6, method=method, **DOFS) for u, y in _records(count, 10000 if SLOW else 5000)
    )
    pooled = _pooled(found)
    if SLOW:
        _assert_covered(pooled, 90.0, 98.0)
    size = {kind: float(np.sqrt(np.mean(z**2))) for kind, z in pooled.items()}
    assert all(0.7 < x < 1.4 for x in size.values()), size


def _hits(seed: int, count: int, samples: int) -> tuple[list[Array], list[Array]]:
    """Hammer blows of different strength on the structure at rest, with noise of 1 % of each record's rms."""
    rng, model = np.random.default_rng(seed), W1.discrete()
    inputs, outputs = [], []
    for _ in range(count):
        u = np.zeros((samples, 1))
        u[50:53, 0] = 100.0 * rng.uniform(0.7, 1.3) * np.array([0.5, 1.0, 0.6])
        y = systems.simulate(model, u)
        inputs.append(u)
        outputs.append(y + 0.01 * np.sqrt(np.mean(y**2, axis=0)) * rng.standard_normal(y.shape))
    return inputs, outputs


def test_hammer_blows() -> None:
    """The energy stands in one part of each record; ten blows."""
    runs = 200 if SLOW else 40
    found = (
        identify(*_hits(seed, 10, 800), fs=W1.fs, order=6, p=30, start="rest", detrend="none", **DOFS)
        for seed in range(1, runs + 1)
    )
    size = {kind: float(np.sqrt(np.mean(z**2))) for kind, z in _pooled(found).items()}
    assert all(0.7 < x < 1.4 for x in size.values()), size


def test_merged_records_with_gaps() -> None:
    """Three records of different length, one with missing samples."""

    def cut(seed: int) -> tuple[list[Array], list[Array]]:
        u, y = systems.record(W1, 6000, 1.0, seed)
        y[3000:3010, 1] = np.nan
        return [u[:1500], u[1500:4000], u[4000:]], [y[:1500], y[1500:4000], y[4000:]]

    found = (identify(*cut(seed), fs=W1.fs, order=6, **DOFS) for seed in range(1, 41))
    size = {kind: float(np.sqrt(np.mean(z**2))) for kind, z in _pooled(found).items()}
    assert all(0.7 < x < 1.4 for x in size.values()), size


@pytest.mark.parametrize("memory", [{"window_s": 4000 / W1.fs, "update_s": 200 / W1.fs}, {"forgetting": 0.9995}])
def test_live_memories(memory: dict[str, float]) -> None:
    """Frequencies and damping ratios of a window of 4000 samples and of a fading memory."""
    scores: dict[str, list[Array]] = {"f": [], "zeta": []}
    for u, y in _records(200 if SLOW else 60, 12000):
        session = Session(1, 3, fs=W1.fs, p=40, order=6, **memory)
        session.feed(np.hstack([u, y]))
        modes = session.modes()
        for kind, name in (("f", "frequency_hz"), ("zeta", "damping_ratio")):
            std = {"f": "frequency_std_hz", "zeta": "damping_ratio_std"}[kind]
            z = [
                (getattr(mode, name) - true) / getattr(mode, std) for mode, true in zip(modes, TRUTH[kind], strict=True)
            ]
            scores[kind].append(np.array(z))
    for kind, z in scores.items():
        assert 85.0 <= 100.0 * np.mean(np.abs(np.array(z)) <= 1.96) <= 99.5, kind
        assert 0.75 < np.sqrt(np.mean(np.array(z) ** 2)) < 1.3, kind


def test_a_short_horizon_is_called_biased() -> None:
    """W1 at 5 % noise: p = 10 gives too much damping; 2 p shows it, p = 60 is not complained of."""
    u, y = systems.record(W1, 20000, 5.0, 3)
    said = {p: [w.text for w in identify(u, y, fs=W1.fs, p=p, order=6).warnings if w.code == "finite_p_bias"]
            for p in (10, 60)}  # fmt: skip
    assert len(said[10]) == 1 and "mode 1" in said[10][0] and "p=20" in said[10][0]
    assert said[60] == []


@pytest.mark.parametrize(
    ("samples", "method", "asked", "said"),
    [(330, "n4sid-moesp", {"rows": 30}, "rows_reduced"), (100, "okid-era-dc", {"p": 20}, "p_reduced")],
)
def test_the_shortest_records_are_cut_into_blocks_too(
    samples: int, method: str, asked: dict[str, int], said: str
) -> None:
    """The horizon is cut to what the record bears, which is said; the blocks follow it: every mode has deviations."""
    u, y = systems.record(W1, 330, 1.0, 3)
    result = identify(u[:samples], y[:samples], fs=W1.fs, method=method, order=6, **asked)
    codes = {w.code for w in result.warnings}
    assert said in codes and "no_deviation" not in codes
    assert len(result.modes) == 3
    assert all((m.frequency_std_hz or 0.0) > 0.0 and (m.damping_ratio_std or 0.0) > 0.0 for m in result.modes)
