# SPDX-License-Identifier: MIT
"""Just below half the rate: what a converter's filter folds back there is no mode, a mode of little damping is one."""

from __future__ import annotations

from typing import Any

import numpy as np
import okid
import pytest
from scipy.signal import firwin, upfirdn

RATE, OVER = 1000.0, 4


def converted(x: Any) -> Any:
    """As a delta-sigma converter does it: flat to 0.44 of the rate, shut from 0.56 on: what is between folds."""
    kernel = firwin(169, 1 / OVER, window=("kaiser", 7.9))
    return upfirdn(kernel, x, down=OVER, axis=0)[: len(x) // OVER]


def record(modes: list[tuple[float, float]], seed: int) -> tuple[Any, Any]:
    """A shaken base, whose acceleration falls from 0.46 of the rate on, and two points of what stands on it."""
    rng = np.random.default_rng(seed)
    count = int(40 * RATE) * OVER
    f = np.fft.rfftfreq(count, 1 / (RATE * OVER))
    spectrum = np.fft.rfft(rng.standard_normal(count)) / (1 + 1j * np.sqrt(2) * f / 464 - (f / 464) ** 2)
    base = np.fft.irfft(spectrum, count)
    y = np.outer(base, [1.0, 1.0])
    for k, (hz, zeta) in enumerate(modes):
        answer = f**2 / (hz**2 - f**2 + 2j * zeta * hz * f)
        y += np.outer(np.fft.irfft(answer * spectrum, count), [0.8, (-1) ** k * 0.5])
    y += 0.01 * rng.standard_normal(y.shape)
    return converted(base)[:, None], converted(y)


def confident(u: Any, y: Any) -> list[float]:
    return [mode.frequency_hz for mode in okid.identify(u, y, fs=RATE).modes if mode.confident]


@pytest.mark.parametrize("seed", range(4))
def test_what_a_converter_folds_back_is_no_mode(seed: int) -> None:
    """The mode below half the rate that is one stays: its half-power band ends there."""
    modes = [(80, 0.01), (210, 0.01), (462, 0.004)]
    assert confident(*record(modes, seed)) == pytest.approx([hz for hz, _ in modes], rel=0.003)


def test_kinds_that_were_said_are_not_asked_for() -> None:
    """A shaft that whirls: x and y stand at 90 degrees, and both are displacements."""
    rng = np.random.default_rng(1)
    count, step = 40_000, 1 / RATE
    y = np.zeros((count, 2))
    for hz, way in ((21.0, 1), (47.0, -1)):
        pole = np.exp(2 * np.pi * hz * step * complex(-0.01, np.sqrt(1 - 1e-4)))
        state, force = 0j, rng.standard_normal(count)
        for n in range(count):
            y[n] += state.real, way * state.imag
            state = pole * state + force[n]
    y += 0.01 * y.std() * rng.standard_normal(y.shape)
    codes = [
        [w.code for w in okid.identify(None, y, fs=RATE, sensing=sensing).warnings]
        for sensing in ("acceleration", "displacement")
    ]
    assert "mixed_quantities" in codes[0]
    assert "mixed_quantities" not in codes[1]
