# SPDX-License-Identifier: MIT
"""A bus that loses a frame now and then: slow modes of a fast record, whose lower rates look far back."""

from __future__ import annotations

from typing import Any

import laboratory
import numpy as np
import okid
import pytest
import systems
from scipy.linalg import eigh, eigvals
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
    assert "short ones are bridged from the samples around them" in text


def filtered(seconds: float, fs: float, highest: float, seed: int) -> tuple[Any, Any, Any]:
    """A force of the whole band on the last of four masses and four accelerations, as behind a perfect filter,
    1 % of noise on all. @return also the frequencies in Hz, up to `highest` times the rate"""
    mass, stiffness = systems.chain([1.1, 0.9, 1.2, 1.0], [1.0, 1.0, 1.0, 1.0])
    squares, shapes = eigh(stiffness, mass)
    f, rng = np.sqrt(squares / squares[-1]) * highest * fs, np.random.default_rng(seed)
    u = rng.standard_normal((round(seconds * fs), 1))
    y = laboratory.respond(u, shapes[-1:], shapes, f, np.full(4, 0.01), fs)
    u, y = (x + 0.01 * x.std(axis=0) * rng.standard_normal(x.shape) for x in (u, y))
    return u, y, f


@pytest.mark.parametrize("seed", [0, 1, 2])
def test_two_in_a_hundred_of_each_message(seed: int) -> None:
    """Modes between a twelfth of the rate and nearly half of it, which no lower rate has."""
    u, y, true = filtered(60, 250, 0.42, seed)
    rng = np.random.default_rng(seed)
    for channel in (u, y[:, :3], y[:, 3:]):
        channel[rng.random(len(u)) < 0.02] = np.nan
    modes = [m for m in okid.identify(u, y, fs=250.0).modes if m.confident]
    assert [m.frequency_hz for m in modes] == pytest.approx(true, rel=2e-4)
    for mode, one in zip(modes, true, strict=True):
        assert mode.frequency_std_hz is not None and mode.frequency_std_hz < 1e-4 * one
        assert abs(mode.frequency_hz - one) < 4 * mode.frequency_std_hz


def test_a_likelihood_of_few_samples_is_not_taken() -> None:
    """Lost forces leave stretches shorter than a decay: of the longest 32 a refinement is 5 times as far off."""
    u, y, true = filtered(60, 250, 0.19, 0)
    for channel in (u, y[:, :3], y[:, 3:]):
        channel[np.random.default_rng(1).random(len(u)) < 0.02] = np.nan
    result = okid.identify(u, y, fs=250.0)
    assert result.refinement is None
    for mode, one in zip([m for m in result.modes if m.confident], true, strict=True):
        assert mode.frequency_std_hz is not None
        assert abs(mode.frequency_hz - one) < min(4 * mode.frequency_std_hz, 5e-5 * one)
    with_it = okid.identify(u, y, fs=250.0, method="auto", refine=True)
    said = [w.text for w in with_it.warnings if w.code == "refine_failed"]
    assert len(said) == 1 and "of 15000 samples alone" in said[0]
