# SPDX-License-Identifier: MIT
"""Structures as sums of modes, each by its own filter at eight times the rate."""

from __future__ import annotations

from typing import Any

import numpy as np
from scipy import signal

OVER = 8
NOISE = 0.005  # of the standard deviation of an output


class Sums:
    """Modes f (Hz), zeta, their shapes at the sensors and at the force; responses to a force at OVER times the rate."""

    def __init__(self, rate: float, f: list[float], damping: tuple[float, float], sensors: int, seed: int) -> None:
        self.rng = np.random.default_rng(seed)
        self.rate = rate
        self.f = np.array(f) * (1 + 0.03 * self.rng.uniform(-1, 1, len(f)))
        self.zeta = self.rng.uniform(*damping, len(f))
        place = np.sort(self.rng.uniform(0.1, 0.95, sensors))
        self.at = np.cos(np.pi * np.outer(place, np.arange(1, len(f) + 1)) + self.rng.uniform(0, 0.6, len(f)))
        self.at += 0.15 * self.rng.standard_normal(self.at.shape)
        self.at[0] = np.copysign(np.maximum(np.abs(self.at[0]), 0.15), self.at[0])  # the force is at no node

    def lower(self, x: Any) -> Any:
        taps = signal.firwin(20 * OVER + 1, 0.9 / OVER, window=("kaiser", 8))
        return signal.upfirdn(taps, x, 1, OVER, axis=-1)[..., 10:][..., : x.shape[-1] // OVER]

    def response(self, force: Any, at: Any) -> Any:
        """Accelerations of the sensors under a force at these amplitudes of the modes."""
        out = 0
        for k, (f, zeta) in enumerate(zip(self.f, self.zeta, strict=True)):
            w = 2 * np.pi * f
            b, a, _ = signal.cont2discrete(([1, 0, 0], [1, 2 * zeta * w, w * w]), 1 / self.rate / OVER, method="foh")
            out = out + np.outer(self.at[:, k], at[k] * signal.lfilter(np.ravel(b), a, force))
        return out

    def record(self, force: Any, more: Any = 0) -> tuple[Any, Any]:
        y = self.lower(self.response(force, self.at[0]) + more)
        u = self.lower(force)
        noise = self.rng.standard_normal
        return u + 1e-3 * np.abs(u).max() * noise(u.shape), (y + NOISE * y.std() * noise(y.shape)).T

    def found(self, result: Any) -> list[float]:
        """Of each mode: how far the nearest confident one is, relative."""
        seen = np.array([mode.frequency_hz for mode in result.modes if mode.confident])
        return [float(np.abs(seen / f - 1).min()) for f in self.f]
