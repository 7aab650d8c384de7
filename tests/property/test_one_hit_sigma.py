# SPDX-License-Identifier: MIT
"""One hit, and modes that are over long before the record ends: the printed deviation is the scatter over noise."""

from __future__ import annotations

from typing import Any

import numpy as np
import okid
from scipy.signal import cont2discrete, dlsim, firwin, lfilter

FS, FINE = 8000.0, 8
FREQUENCY = np.array([130.0, 310.0, 560.0, 840.0, 1150.0, 1490.0])
DAMPING = np.array([0.006, 0.009, 0.005, 0.008, 0.01, 0.007])
GAIN = np.array([1.0, -0.7, 0.9, 1.1, -0.8, 0.6])  # of the acceleration, by a unit force


def clean_record() -> Any:
    """Force and acceleration of a hit of 0.35 ms at 30 ms in one second: at 8 times the rate, then filtered alike."""
    t = np.arange(int(FS * FINE)) / (FS * FINE)
    force = np.where((t >= 0.03) & (t < 0.03035), 100 * np.sin(np.pi * (t - 0.03) / 0.00035), 0.0)
    response = np.zeros_like(force)
    for f, zeta, gain in zip(FREQUENCY, DAMPING, GAIN, strict=True):
        w = 2 * np.pi * f
        A, B = np.array([[0, 1], [-w * w, -2 * zeta * w]]), np.array([[0], [gain]])
        C, D = np.array([[-w * w, -2 * zeta * w]]), np.array([[gain]])
        step = cont2discrete((A, B, C, D), 1 / (FS * FINE), method="foh")
        response += dlsim(step, force)[1][:, 0]
    taps = firwin(32 * FINE + 1, 0.42 / FINE * 2)
    return [lfilter(taps, 1, x)[::FINE] for x in (force, response)]


def test_deviations_are_the_scatter_over_noise() -> None:
    force, response = clean_record()
    frequency, sigma = [], []
    for seed in range(8):
        rng = np.random.default_rng(seed)
        u = force + 0.002 * force.std() * rng.standard_normal(len(force))
        y = response + 0.02 * response.std() * rng.standard_normal(len(force))
        modes = [m for m in okid.identify(u, y, fs=FS).modes if m.confident]
        nearest = [min(modes, key=lambda m, f=f: abs(m.frequency_hz - f)) for f in FREQUENCY]
        frequency.append([m.frequency_hz for m in nearest])
        sigma.append([m.frequency_std_hz for m in nearest])
    away = np.array(frequency) - FREQUENCY
    assert np.all(np.abs(away) < 0.01 * FREQUENCY)
    scatter = np.sqrt(np.mean(away**2, axis=0))
    ratio = np.median(sigma, axis=0) / scatter
    assert np.all(ratio > 0.4), ratio
    assert np.all(ratio < 5), ratio
    assert np.median(ratio) < 3, ratio
    assert np.mean(np.abs(away) < 2 * np.array(sigma)) > 0.85
