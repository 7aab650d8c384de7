# SPDX-License-Identifier: MIT
"""Records without a measured force: covariance-driven ERA beside the subspace methods, from Python and the program."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import okid
import pytest
import systems
from numpy.typing import NDArray
from program import okid as run

Array = NDArray[np.float64]


def ambient(name: str, samples: int, seed: int) -> tuple[systems.Structure, Array]:
    """White forces at every mass that nobody measures, 1 % noise."""
    s = getattr(systems, name)()
    s = replace(s, force_dofs=tuple(range(len(s.M))))
    return s, systems.record(s, samples, 1.0, seed)[1]


def errors(s: systems.Structure, result: Any) -> tuple[Array, Array]:
    f = np.array([mode.frequency_hz for mode in result.modes])
    zeta = np.array([mode.damping_ratio for mode in result.modes])
    near = [int(np.argmin(np.abs(f - x))) for x in s.modes()[0]]
    return np.abs(f[near] / s.modes()[0] - 1), np.abs(zeta[near] / s.modes()[1] - 1)


@pytest.mark.parametrize("method", ["okid-era", "okid-era-dc"])
@pytest.mark.parametrize("name", ["w1", "w2"])
def test_modes_of_a_shaken_structure(name: str, method: str) -> None:
    """Frequencies within 0.5 %, damping beside the subspace method: the record's length decides, not the method."""
    ours, theirs = [], []
    for seed in (5, 6, 7):
        s, y = ambient(name, 40000, seed)
        result = okid.identify(None, y, fs=s.fs, method=method)
        assert result.order == 2 * len(s.M), result.table()
        assert (result.p, result.rows, result.hankel) == (40, 40, None)
        f, zeta = errors(s, result)
        assert np.max(f) < 5e-3
        assert np.max(zeta) < 0.35, zeta
        assert all(mode.emac > 0.9 for mode in result.modes)
        assert min(v or 0.0 for v in result.fit.prediction_percent.values()) > 20.0
        beside = okid.identify(None, y, fs=s.fs, method="n4sid-cva", rows=40, order=2 * len(s.M))
        ours.append(zeta)
        theirs.append(errors(s, beside)[1])
        gap = [
            (b or 0.0) - (a or 0.0)
            for a, b in zip(result.fit.prediction_percent.values(), beside.fit.prediction_percent.values(), strict=True)
        ]
        assert max(gap) < 2.0, gap  # the Riccati gain predicts as well
    assert np.sqrt(np.mean(np.square(ours))) < 1.6 * np.sqrt(np.mean(np.square(theirs)))


def test_units_do_not_matter() -> None:
    s, y = ambient("w1", 10000, 2)
    base = okid.identify(None, y, fs=s.fs, order=6)
    other = okid.identify(None, y * [1e-3, 1.0, 1e4], fs=s.fs, order=6)
    for left, right in zip(base.modes, other.modes, strict=True):
        assert left.frequency_hz == pytest.approx(right.frequency_hz, rel=1e-9)
        assert left.damping_ratio == pytest.approx(right.damping_ratio, rel=1e-6)
    for a, b in zip(base.fit.prediction_percent.values(), other.fit.prediction_percent.values(), strict=True):
        assert a == pytest.approx(b, abs=1e-5)


def test_p_is_the_default_of_rows() -> None:
    s, y = ambient("w1", 10000, 2)
    assert okid.identify(None, y, fs=s.fs, p=25, order=6).rows == 25
    both = okid.identify(None, y, fs=s.fs, p=25, rows=30, order=6)
    assert both.rows == 30 and "p_ignored" in [w.code for w in both.warnings]
    short = okid.identify(None, y[:600], fs=s.fs, order=6)
    assert short.rows < 40 and "rows_reduced" in [w.code for w in short.warnings]
    with pytest.raises(okid.IdentificationError, match="too few samples"):
        okid.identify(None, y[:50], fs=s.fs, method="okid-era")
    with pytest.raises(okid.InputError, match="needs a force"):
        okid.identify(None, y, fs=s.fs, hankel="innovations")


def test_gaps_and_several_records() -> None:
    s, y = ambient("w1", 30000, 3)
    y[7000:7100] = np.nan
    result = okid.identify(None, [y[:12000], y[12000:] + 5.0], fs=s.fs, order=6)
    assert (result.records, result.gaps) == (2, 1)
    assert np.max(errors(s, result)[0]) < 5e-3


def test_program_equals_python(tmp_path: Path) -> None:
    s, y = ambient("w1", 8000, 9)
    path = tmp_path / "ambient.csv"
    np.savetxt(path, y, delimiter=",", fmt="%.17g", comments="", header=f"# fs_hz: {s.fs!r}\ny1,y2,y3")
    for method in ("okid-era", "okid-era-dc"):
        done = run("identify", path, "--outputs", "y1,y2,y3", "--method", method, "--json", "-")
        assert done.returncode == 0, done.stderr
        shown, own = json.loads(done.stdout), okid.identify(None, y, fs=s.fs, method=method).to_dict()
        for key in ("p", "rows", "order", "hankel", "singular_noise"):
            assert shown[key] == own[key], key
        assert [w["code"] for w in shown["warnings"]] == [w["code"] for w in own["warnings"]]
        for key in ("frequency_hz", "damping_ratio", "emac", "mpc", "cmi"):
            np.testing.assert_allclose([m[key] for m in shown["modes"]], [m[key] for m in own["modes"]], rtol=1e-7)
        assert shown["fit"]["prediction_percent"] == pytest.approx(own["fit"]["prediction_percent"], abs=1e-5)
        assert shown["fit"]["simulation_percent"] is None and shown["markov"]["Y"] == []
    refused = run("identify", path, "--outputs", "y1", "--hankel", "literal")
    assert refused.returncode == 2 and "--hankel" in refused.stderr and "needs a force" in refused.stderr
