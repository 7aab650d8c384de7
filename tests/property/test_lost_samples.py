# SPDX-License-Identifier: MIT
"""A bus that loses a frame now and then: slow modes of a fast record, whose lower rates look far back."""

from __future__ import annotations

from typing import Any

import numpy as np
import okid
import pytest
from scipy.linalg import eigvals
from scipy.signal import cont2discrete, dlsim

MASS = np.diag([1.0, 0.8, 1.2])
STIFFNESS = np.array([[1620.0, -648.0, 0.0], [-648.0, 1458.0, -810.0], [0.0, -810.0, 810.0]])
DAMPING = 0.18 * MASS + 5e-5 * STIFFNESS
A = np.block([[np.zeros((3, 3)), np.eye(3)], [-np.linalg.solve(MASS, STIFFNESS), -np.linalg.solve(MASS, DAMPING)]])
TRUE = np.unique(np.round(np.abs(eigvals(A)) / 2 / np.pi, 9))  # 1.97, 5.73 and 8.22 Hz


def shaken(seconds: float, fs: float, *, force: bool, seed: int) -> tuple[Any, Any]:
    """A force on the first mass, or on all unseen, and three accelerations with 2 % of noise."""
    rng = np.random.default_rng(seed)
    drive = rng.standard_normal((round(seconds * fs), 3)) * ([1, 0, 0] if force else [1, 1, 1])
    B = np.vstack([np.zeros((3, 3)), np.linalg.inv(MASS)])
    y = dlsim(cont2discrete((A, B, A[3:], B[3:]), 1 / fs), drive)[1]
    y += 0.02 * y.std(axis=0) * rng.standard_normal(y.shape)
    return (drive[:, :1] if force else None), y


def lose(share: float, longest: int, *channels: Any) -> None:
    """Bursts of up to `longest` lost rows, of all channels, at random times."""
    rng, count = np.random.default_rng(9), len(channels[-1])
    for first in np.flatnonzero(rng.random(count) < 2 * share / (longest + 1)):
        gone = slice(first, first + rng.integers(1, longest + 1))
        for channel in channels:
            if channel is not None:
                channel[gone] = np.nan


@pytest.mark.parametrize(
    ("seconds", "fs", "share", "longest"),
    [(60, 1000, 1e-3, 1), (60, 1000, 5e-3, 4), (400, 500, 5e-3, 1)],  # the last is longer than the samples kept
)
@pytest.mark.parametrize("force", [True, False])
def test_slow_modes_of_a_record_with_losses(force: bool, seconds: float, fs: float, share: float, longest: int) -> None:
    u, y = shaken(seconds, fs, force=force, seed=3)
    lose(share, longest, u, y)
    result = okid.identify(u, y, fs=fs)
    modes = [m for m in result.modes if m.confident]
    assert [m.frequency_hz for m in modes] == pytest.approx(TRUE, rel=2e-4 if force else 0.01)
    assert all(m.frequency_std_hz is not None for m in modes)
    for mode, true in zip(modes, TRUE, strict=True):
        assert abs(mode.frequency_hz - true) < 5 * mode.frequency_std_hz + 1e-5 * true
    text = next(w.text for w in result.warnings if w.code == "missing_samples")
    assert "short gaps bridged for rates below the record's own" in text
