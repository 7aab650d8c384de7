# SPDX-License-Identifier: MIT
"""Structures whose sensors are moved between records: known modes and shapes, responses as the sum of the modes.

Each mode is exact for a force that is held over a quarter of a sample, behind an anti-alias filter. Drift, machines,
dead channels and noise are those of a site. Nothing of okid takes part.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.signal import firwin, lfilter, upfirdn

Real = NDArray[np.float64]
FINER = 4


@dataclass
class Structure:
    """Modes with real shapes (places, modes) of modal mass `mass` kg each."""

    fs: float
    frequency: Real
    damping: Real
    shapes: Real
    mass: Real

    def respond(self, force: Real, at: Real, velocity: bool = False) -> Real:
        """Accelerations or velocities of all places; `force` (finer samples, forces), `at` (places, forces)."""
        dt = 1 / (self.fs * FINER)
        modal = force @ (at.T @ self.shapes) / self.mass
        out = np.zeros((len(force), len(self.shapes)))
        for k, (f, zeta) in enumerate(zip(self.frequency, self.damping, strict=True)):
            w = 2 * np.pi * f
            pole = complex(-zeta * w, w * np.sqrt(1 - zeta**2))
            turn = np.exp(pole * dt)
            state = lfilter([0, (turn - 1) / pole], [1, -turn], modal[:, k].astype(complex))
            residue = 1 / (2j * pole.imag)
            motion = 2 * np.real(residue * (pole if velocity else pole**2) * state) + (0 if velocity else modal[:, k])
            out += motion[:, None] * self.shapes[:, k]
        return out

    def sampled(self, fine: Real) -> Real:
        """Behind an anti-alias filter, at fs."""
        taps = firwin(401, 0.42 * self.fs, fs=self.fs * FINER, window=("kaiser", 8.0))
        first = len(taps) // 2 // FINER
        return np.array([upfirdn(taps, column, down=FINER)[first : first + len(fine) // FINER] for column in fine.T]).T


def ambient(s: Structure, seconds: float, seed: int, noise: float = 0.02) -> Real:
    """Every place is driven by a noise of its own, of another strength each time."""
    rng = np.random.default_rng(seed)
    places = len(s.shapes)
    force = rng.standard_normal((int(seconds * s.fs) * FINER, places)) * rng.uniform(0.5, 2.0, places)
    y = s.sampled(s.respond(force, np.eye(places)))
    return np.asarray(y + noise * y.std(axis=0) * rng.standard_normal(y.shape))


def drifting(y: Real, seed: int, times: float = 5.0) -> Real:
    """With a random walk on each channel, `times` its own spread."""
    rng = np.random.default_rng(seed)
    walk = np.cumsum(rng.standard_normal(y.shape), axis=0)
    return np.asarray(y + times * y.std(axis=0) * walk / walk.std(axis=0))


def beside_a_machine(y: Real, fs: float, hz: float, seed: int, times: float = 2.0) -> Real:
    """With a steady line on every channel, `times` the mean spread."""
    rng = np.random.default_rng(seed)
    line = np.sin(2 * np.pi * hz * np.arange(len(y)) / fs + rng.uniform(0, 6))
    return np.asarray(y + times * y.std(axis=0).mean() * line[:, None] * rng.standard_normal(y.shape[1]))


def footbridge() -> Structure:
    """Ten modes from 2 to 30 Hz, bending and torsion, at eight places on the two sides of a deck."""
    frequency = np.array([2.1, 6.54, 10.05, 12.67, 17.26, 19.77, 22.92, 24.69, 27.63, 29.7])
    damping = np.array([8.4, 12.8, 8.5, 10.4, 14.8, 14.7, 12.5, 10.9, 8.5, 7.4]) / 1000
    x, side = np.linspace(0.06, 0.94, 8), np.array([-1.0, 1.0] * 4)
    shapes = np.array([np.sin((k // 2 + 1) * np.pi * x) * (side if k % 2 else 1.0) for k in range(10)]).T
    shapes += 0.05 * np.random.default_rng(1).standard_normal(shapes.shape)
    return Structure(100.0, frequency, damping, shapes, np.full(10, 900.0))


def plate() -> Structure:
    """Six modes of a plate at twelve places."""
    frequency = np.array([43.7, 71.2, 102.9, 118.4, 161.3, 187.6])
    damping = np.array([0.006, 0.004, 0.005, 0.007, 0.003, 0.004])
    x, y = (one.ravel() for one in np.meshgrid(np.linspace(0.13, 0.91, 4), np.linspace(0.17, 0.87, 3)))
    kinds = [(1, 1), (2, 1), (1, 2), (2, 2), (3, 1), (3, 2)]
    shapes = np.array([np.sin(m * np.pi * x) * np.sin(n * np.pi * y) for m, n in kinds]).T
    return Structure(512.0, frequency, damping, shapes, np.linspace(2.0, 3.5, 6))


def building() -> Structure:
    """Sway and torsion of ten places on five floors."""
    frequency = np.array([0.83, 1.02, 2.61, 3.2, 4.55, 5.31])
    damping = np.array([0.012, 0.01, 0.014, 0.011, 0.016, 0.013])
    height, side = np.repeat(np.arange(1, 6) / 5, 2), np.array([-1.0, 1.0] * 5)
    sway = [np.sin((2 * (k // 2) + 1) * np.pi / 2 * height) for k in range(6)]
    shapes = np.array([one * (side if k % 2 else 1.0) for k, one in enumerate(sway)]).T
    return Structure(25.0, frequency, damping, shapes, np.full(6, 3e5))


def write(path: Path, fs: float, names: list[str], rows: Real) -> Path:
    """As a logger does it."""
    np.savetxt(path, rows, delimiter=",", header=f"# fs_hz: {fs}\n" + ",".join(names), comments="", fmt="%.7g")
    return path
