# SPDX-License-Identifier: MIT
"""Averages under a Hann window whose lines are half as wide as the resonances: what leaks from line to line moves all
outputs alike, and far more near a resonance than elsewhere. Time histories and averages by scipy, hardly any noise."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from program import okid as program
from scipy.signal import cont2discrete, csd, lfilter, welch

FS, LINES_OF_A_SECOND = 1024.0, 1
F = np.array([40.3, 92.7, 151.2, 238.9, 330.4])
PLACES = (np.arange(6) + 0.7) / 6.4
SHAPES = np.sin(np.pi * np.outer(PLACES, np.arange(1, 6)))


def _accelerations(force: np.ndarray, zeta: np.ndarray) -> np.ndarray:
    """Of every place, struck at the first."""
    out = np.zeros((len(force), len(PLACES)))
    for k, (f, z) in enumerate(zip(F, zeta, strict=True)):
        w = 2 * np.pi * f
        one = ([[0.0, 1.0], [-w * w, -2 * z * w]], [[0.0], [1.0]], [[-w * w, -2 * z * w]], [[1.0]])
        A, B, C, D, _ = cont2discrete([np.array(part) for part in one], 1 / FS)
        a = np.poly(A)
        b = np.poly(A - B @ C) + (D[0, 0] - 1) * a
        out += np.outer(lfilter(b, a, force * SHAPES[0, k]), SHAPES[:, k])
    return out


@pytest.mark.parametrize("averages", [20, 60])
def test_deviations_hold_what_leaks(tmp_path: Path, averages: int) -> None:
    length = int(FS) * LINES_OF_A_SECOND
    errors: list[float] = []
    for seed in range(4):
        r = np.random.default_rng([seed, averages])
        zeta = r.uniform(0.7, 1.4, 5) / F / LINES_OF_A_SECOND  # 2 zeta f: about two lines
        force = r.standard_normal(length * (averages // 2 + 5))
        y = _accelerations(force, zeta)
        y, force = y[4 * length :], force[4 * length :]
        y += 1e-3 * np.std(y, axis=0) * r.standard_normal(y.shape)
        how = {"fs": FS, "window": "hann", "nperseg": length, "detrend": False}
        f, power = welch(force, **how)
        table = {"frequency_hz": f}
        for o in range(len(PLACES)):
            h = csd(force, y[:, o], **how)[1] / power
            table |= {f"{o + 1}z/1z:re": h.real, f"{o + 1}z/1z:im": h.imag}
        used = (f > 5) & (f < 380)
        path = tmp_path / f"{averages}_{seed}.csv"
        rows = np.array([column[used] for column in table.values()]).T
        np.savetxt(path, rows, delimiter=",", header=",".join(table), comments="", fmt="%.9g")
        run = program("identify", path, "--frf", "--json", "-", "--quiet", status=0)
        modes = [mode for mode in json.loads(run.stdout)["modes"] if mode["confident"]]
        assert len(modes) == len(F)
        for mode, true, z in zip(modes, F, zeta, strict=True):
            assert abs(mode["frequency_hz"] / true - 1) < 0.005
            errors.append((mode["frequency_hz"] - true) / mode["frequency_std_hz"])
            errors.append((mode["damping_ratio"] - z) / mode["damping_ratio_std"])
    assert 0.5 < np.sqrt(np.mean(np.square(errors))) < 1.5
    assert np.mean(np.abs(errors) > 3) <= 0.05
