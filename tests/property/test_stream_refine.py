# SPDX-License-Identifier: MIT
"""Maximum likelihood in a stream of a named method: the Cramér-Rao bound, gaps, cuts, windows, replay beside record.

Bound, structures and simulation are the tests' own (test_refine.py, systems.py); they share with the program the model
class: poles, shapes, white noise at the sensors. The rig of the replay comes out of `okid simulate`; it is compared
with the refinement of the record, a second implementation (a simulation instead of sums).
"""

from __future__ import annotations

import json
import os
import pathlib
from typing import Any

import numpy as np
import okid
import pytest
import systems
from numpy.typing import NDArray
from program import okid as run_okid
from scipy.signal import lfilter
from test_refine import bound, coloured, made, options
from two_masses import rig_text, simulate_rig

SLOW = os.environ.get("OKID_SLOW") == "1"  # the long tier
Array = NDArray[np.float64]
MEMORY: dict[str, dict[str, Any]] = {"growing": {}, "window": {"window_s": 60.0}, "forgetting": {"forgetting": 0.9995}}


def stream(record: Array, n_u: int, fs: float, size: int = 4000, **more: Any) -> okid.Result:
    with okid.Session(n_u, record.shape[1] - n_u, fs=fs, **{"refine": True, **more}) as session:
        for first in range(0, len(record), size):
            session.feed(record[first : first + size])
        return session.identify()


def modes(result: okid.Result, truth: Array) -> tuple[Array, Array]:
    """f, then zeta, of the modes nearest to the true ones, and their deviations."""
    found = np.array([mode.frequency_hz for mode in result.modes])
    near = [result.modes[int(np.argmin(abs(found - f)))] for f in truth]
    values = [mode.frequency_hz for mode in near] + [mode.damping_ratio for mode in near]
    sigma = [mode.frequency_std_hz or np.nan for mode in near] + [mode.damping_ratio_std or np.nan for mode in near]
    return np.array(values), np.array(sigma)


CASES = [("w1", 5.0, "growing", 24)]
if SLOW:
    CASES = [(name, noise, kept, 40) for name in ("w1", "w2") for noise in (1.0, 5.0) for kept in ("growing", "window")]
    CASES.append(("w3", 5.0, "window", 40))


@pytest.mark.parametrize(("name", "noise", "kept", "records"), CASES)
def test_errors_reach_the_cramer_rao_bound(name: str, noise: float, kept: str, records: int) -> None:
    """Of all samples fed, those included that arm the lags; of a window, of the samples in it."""
    s, samples = getattr(systems, name)(), {"w1": 20000, "w2": 30000, "w3": 100000}[name]
    truth, ratios, inside = np.concatenate(s.modes()), [], []
    half = len(s.M)
    for seed in range(records):
        u, y, sigma = made.__wrapped__(name, noise, 8000 + seed, samples + (4000 if kept == "window" else 0))
        if seed == 0:
            limit = np.concatenate(bound(s, u[:samples], sigma))
        window = {"window_s": samples / s.fs} if kept == "window" else {}
        result = stream(np.hstack([u, y]), u.shape[1], s.fs, **options(name, "n4sid-moesp"), **window)
        assert result.refinement is not None and result.refinement.converged
        assert np.allclose(result.refinement.noise_std, sigma, rtol=0.05)
        values, deviations = modes(result, truth[:half])
        ratios.append((values - truth) / limit)
        inside.append(abs(values - truth) < 1.96 * deviations)
    square = np.mean(np.array(ratios) ** 2, axis=0)
    f, zeta = np.sqrt(square[:half].mean()), np.sqrt(square[half:].mean())
    print(name, noise, kept, "f", f, "zeta", zeta, "worst", np.sqrt(square.max()), "inside", np.mean(inside))
    by_chance = 3 / np.sqrt(2 * records * half)
    assert f < max(1.1, 1 + by_chance) and zeta < max(1.1, 1 + by_chance)
    assert 0.90 < np.mean(inside) < 0.99


@pytest.mark.parametrize("memory", list(MEMORY))
def test_cuts_gaps_and_codes_do_not_matter(memory: str) -> None:
    """Single calls or many, NaN or gap(), codes or the numbers they stand for: the same refined modes."""
    s = systems.w1()
    u, y, _ = made("w1", 1.0, 5, 14000)
    record = np.hstack([u, y])
    scale = np.max(abs(record), axis=0) / 32000
    codes = np.rint(record / scale).astype(np.int16)
    exact = codes * scale
    more: dict[str, Any] = {"method": "okid-era", "p": 20, "order": 6, "sigma_blocks": 0, "fs": s.fs, **MEMORY[memory]}

    def fed(parts: list[Array], gap: int = 0, **also: Any) -> Array:
        with okid.Session(1, 3, **more, refine=True, **also) as session:
            for k, part in enumerate(parts):
                if gap and k > 0:
                    session.gap(gap)
                session.feed(part)
            result = session.identify()
        assert result.refinement is not None and result.refinement.samples > 2000
        return modes(result, s.modes()[0])[0]

    holed = exact.copy()
    holed[2500:2507] = np.nan
    whole = fed([holed])
    assert np.allclose(fed([holed[:2500], holed[2507:]], gap=7), whole, rtol=1e-9)
    assert np.allclose(fed(np.array_split(holed, 37)), whole, rtol=1e-9)
    integers = fed([codes[:2500], codes[2507:]], gap=7, codes=16, scale=scale)
    assert np.allclose(integers, whole, rtol=1e-8)


def test_a_replay_says_what_the_record_says(tmp_path: pathlib.Path) -> None:
    """Within half a deviation of `okid identify --refine`; the same bytes at any speed; updates are refined."""
    rig = simulate_rig(tmp_path, rig_text(60.0))
    config = (rig / "a.toml").read_text()
    assert config.count("[identification]") == 1
    (rig / "a.toml").write_text(config.replace("[identification]", '[identification]\nrefine = "yes"'))
    runs = []
    for speed in ("max", "400"):
        files = ["--events", rig / "e.jsonl", "--json", rig / "r.json"]
        done = run_okid("replay", rig / "a.log", "-c", rig / "a.toml", "--speed", speed, *files)
        assert done.returncode == 0, done.stderr
        runs.append((rig / "r.json").read_bytes())
    assert runs[0] == runs[1]
    live = json.loads(runs[0])
    made_record = run_okid("convert", rig / "a.log", rig / "decoded.csv", "-c", rig / "a.toml")
    assert made_record.returncode == 0, made_record.stderr
    inputs, outputs = ",".join(live["inputs"]), ",".join(live["outputs"])
    done = run_okid("identify", rig / "decoded.csv", "--inputs", inputs, "--outputs", outputs, "--method", "okid-era",
                    "--p", "12", "--rows", "24", "--refine", "--json", rig / "o.json")  # fmt: skip
    assert done.returncode == 0, done.stderr
    offline = json.loads((rig / "o.json").read_text())
    truth = json.loads((rig / "t.json").read_text())
    assert "refinement" in live and live["refinement"]["converged"] and live["refinement"]["whiteness"] is None
    assert live["refinement"]["samples"] > 0.9 * live["samples"]
    assert live["refinement"]["noise_std"] == pytest.approx(offline["refinement"]["noise_std"], rel=0.01)
    for k, f in enumerate(truth["frequency_hz"]):
        a, b = (min(x["modes"], key=lambda mode: abs(mode["frequency_hz"] - f)) for x in (live, offline))
        for key in ("frequency_hz", "damping_ratio"):
            std = b[key.replace("_hz", "_std_hz")] if key == "frequency_hz" else b["damping_ratio_std"]
            assert abs(a[key] - b[key]) < 0.5 * std, (key, a, b)
            assert abs(a[key] - truth[key][k]) < 4 * std
    updates = [json.loads(line) for line in (rig / "e.jsonl").read_text().splitlines() if '"modes"' in line]
    last = [event for event in updates if event["type"] == "modes"][-1]["modes"]
    assert [mode["frequency_hz"] for mode in last] == pytest.approx(
        [mode["frequency_hz"] for mode in live["modes"]], rel=1e-9
    )


@pytest.mark.parametrize("samples", [6000, 16000])
def test_coloured_noise_of_a_stream_is_made_white(samples: int) -> None:
    """As of a record (test_refine.py), before and after the lags are chosen; codes become doubles behind the filter."""
    s = systems.w1()
    for pole, codes in ((0.9, 0), (-0.6, 16)):
        u, y, drive = coloured(s, [pole], 31, samples)
        record = np.hstack([u, y])
        scale = np.max(abs(record), axis=0) / 32000
        record[3000] = np.nan
        more: dict[str, Any] = {"codes": 16, "scale": scale} if codes else {}
        with okid.Session(1, 3, fs=s.fs, method="n4sid-moesp", rows=40, order=6, refine="auto", **more) as session:
            for part in (record[:3000], record[3001:]):
                session.feed(np.rint(part / scale).astype(np.int16) if codes else part)
                session.gap(1)
            result = session.identify()
        assert result.refinement is not None and result.refinement.noise_order >= 1
        assert np.allclose(result.refinement.noise_std, drive / np.sqrt(1 - pole**2), rtol=0.25)
        limit = np.concatenate(bound(s, lfilter([1.0, -pole], [1.0], u, axis=0), drive))
        truth = np.concatenate(s.modes())
        error = (modes(result, truth[:3])[0] - truth) / limit
        assert np.sqrt(np.mean(error**2)) < 1.9, error
        named = stream(record, 1, s.fs, method="n4sid-moesp", rows=40, order=6, refine=False)
        assert np.mean(error**2) < np.mean(((modes(named, truth[:3])[0] - truth) / limit) ** 2)


@pytest.mark.parametrize("colour", [0.0, 0.9])
def test_merged_and_restored_sums_are_those_of_one_stream(colour: float) -> None:
    """Two records in one session, in two that are merged, and in one that is put aside in between: to 1e-9."""
    s = systems.w1()
    if colour:
        records = [np.hstack(coloured(s, [colour], seed, 12000)[:2]) for seed in (41, 42)]
    else:
        records = [np.hstack(made.__wrapped__("w1", 5.0, seed, 12000)[:2]) for seed in (41, 42)]
    more: dict[str, Any] = {"method": "n4sid-moesp", "rows": 40, "order": 6, "fs": s.fs, "refine": True}

    def session() -> okid.Session:
        return okid.Session(1, 3, **more)

    def found(one: okid.Session) -> Array:
        result = one.identify()
        assert result.refinement is not None and result.refinement.samples > 19000
        assert (result.refinement.noise_order > 0) == bool(colour)
        return np.concatenate(modes(result, s.modes()[0]))

    with session() as whole, session() as first, session() as second, session() as third, session() as fresh:
        for record in records:
            whole.feed(record)
            whole.gap()
        first.feed(records[0])
        state = first.to_bytes()
        second.restore(state)
        second.reset()
        assert second.samples == 0
        second.feed(records[1])
        first.merge(second.to_bytes())
        third.restore(state)
        third.gap()
        third.feed(records[1])
        fresh.merge(state)
        fresh.merge(second.to_bytes())
        truth = found(whole)
        for one in (first, third, fresh):
            np.testing.assert_allclose(found(one), truth, rtol=1e-9)
        assert whole.samples == first.samples == third.samples == fresh.samples == 24000


def test_states_that_do_not_go_together_are_refused() -> None:
    s = systems.w1()
    more: dict[str, Any] = {"method": "okid-era", "p": 20, "fs": s.fs}
    with (
        okid.Session(1, 3, **more, refine=True) as one,
        okid.Session(1, 3, **more, refine=True) as two,
        okid.Session(1, 3, **more) as plain,
    ):
        with pytest.raises(okid.InputError, match="no model yet"):
            one.to_bytes()
        one.feed(np.hstack(made.__wrapped__("w1", 1.0, 3, 12000)[:2]))
        two.feed(np.hstack(made.__wrapped__("w1", 5.0, 4, 9000)[:2]))
        state, rows = two.to_bytes(), one.stats
        with pytest.raises(okid.InputError, match="sums to [0-9]+ lags behind a filter"):
            one.merge(state)
        for damaged in (state[:200], state[:-1], state[:40] + b"x" + state[41:]):
            with pytest.raises(okid.InputError, match="damaged"):
                one.merge(damaged)
        plain.feed(np.hstack(made.__wrapped__("w1", 1.0, 3, 5000)[:2]))
        with pytest.raises(okid.InputError, match="no sums for a refinement"):
            one.merge(plain.to_bytes())
        assert one.stats == rows
        plain.merge(state)
        assert plain.samples == 14000


def test_a_slow_mode_of_a_fast_stream() -> None:
    """0.5 Hz at 1 kHz, zeta 1 %, 200 s: it rings for 290,000 samples. Auto refines it, sums cannot."""
    fs, pole = 1000.0, 2 * np.pi * 0.5 * (-0.01 + 1j * np.sqrt(1 - 0.01**2))
    rng = np.random.default_rng(2)
    u = rng.standard_normal(200_000)
    signal = lfilter([0.0, 1.0], [1.0, -np.exp(pole / fs)], u)
    clean = np.column_stack([(shape * signal).real for shape in (1.0 + 0.2j, -0.6 + 0.1j)])
    clean += 0.1 * clean.std(axis=0) * u[:, None]
    record = np.column_stack([u, clean + 0.01 * clean.std(axis=0) * rng.standard_normal(clean.shape)])
    result = stream(record, 1, fs, 20_000, refine=None)
    assert result.refinement is not None and result.refinement.converged
    values, sigma = modes(result, np.array([0.5]))
    assert np.all(sigma > 0) and np.all(abs(values - [0.5, 0.01]) < 4 * sigma) and np.all(sigma < [1e-4, 1e-4])
    offline = okid.identify(record[:, :1], record[:, 1:], fs=fs)
    assert offline.refinement is not None and offline.refinement.converged
    assert np.all(abs(modes(offline, np.array([0.5]))[0] - values) < 0.1 * sigma)
    named = stream(record, 1, fs, 20_000, method="n4sid-cva", rows=40, order=2)
    assert named.refinement is None and "refine_failed" in {w.code for w in named.warnings}


def test_what_cannot_be_refined_says_so() -> None:
    """A gap each 200 samples of 12,000: the model as identified, and a remark. Ambient streams: refused."""
    s = systems.w1()
    u, y, _ = made("w1", 1.0, 6, 12000)
    record = np.hstack([u, y])
    record[::200] = np.nan
    result = stream(record, 1, s.fs, method="okid-era", p=20)
    assert result.refinement is None
    assert [w.code for w in result.warnings if w.code.startswith("refine")] == ["refine_failed"]
    with pytest.raises(okid.InputError, match="needs a measured force"):
        okid.Session(0, 3, fs=s.fs, method="n4sid-cva", refine=True)
