# SPDX-License-Identifier: MIT
"""Records as a laboratory makes them, simulated: band-limited forces, close pairs, ambient colour, hum, bad channels.

Everything is made in the frequency domain of a long periodic signal, of which a stretch is kept: responses of
band-limited forces are then exact, without a filter or an integration.
"""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Real = NDArray[np.float64]


class Laboratory(NamedTuple):
    """A record (samples, channels), forces first, and the truth behind it."""

    fs: float
    samples: Real
    n_u: int
    frequency_hz: Real
    damping_ratio: Real

    def write(self, path: Path) -> list[str]:
        """As CSV; returns the arguments that name its channels."""
        n_y = self.samples.shape[1] - self.n_u
        forces, outputs = [f"u{k}" for k in range(self.n_u)], [f"y{k}" for k in range(n_y)]
        np.savetxt(path, self.samples, fmt="%.9g", delimiter=",", comments="",
                   header=f"# fs_hz: {self.fs:g}\n" + ",".join(forces + outputs))  # fmt: skip
        return ["--outputs", ",".join(outputs), *(["--inputs", ",".join(forces)] if forces else [])]


def receptances(frequency_hz: Real, damping_ratio: Real, f: Real) -> Real:
    """Displacement of each mode for a unit modal force, (modes, lines)."""
    w = 2 * np.pi * np.asarray(frequency_hz)[:, None]
    s = 2j * np.pi * f[None, :]
    return 1 / (s**2 + 2 * np.asarray(damping_ratio)[:, None] * w * s + w**2)


def respond(
    forces: Real, at_forces: Real, at_sensors: Real, frequency_hz: Real, damping_ratio: Real, fs: float
) -> Real:
    """Accelerations (samples, sensors) of periodic forces (samples, forces); shapes are (points, modes)."""
    count = len(forces)
    f = np.fft.rfftfreq(count, 1 / fs)
    modal = (at_forces.T @ np.fft.rfft(forces, axis=0).T) * receptances(frequency_hz, damping_ratio, f)
    out: Real = np.fft.irfft(-((2 * np.pi * f) ** 2) * (at_sensors @ modal), count, axis=1).T
    return out


def shaped_noise(rng: np.random.Generator, count: int, channels: int, gain: Real) -> Real:
    """Gaussian noise with this gain at the lines of rfft."""
    out: Real = np.fft.irfft(np.fft.rfft(rng.standard_normal((count, channels)), axis=0) * gain[:, None], count, axis=0)
    return out


def forced(seed: int, fs: float = 256.0, count: int = 20000, noise: float = 1.0) -> Laboratory:
    """Five to eight modes over 6-90 Hz and one 0.2, 0.6 or 1 % above a middle one, 1-2 band-limited forces."""
    rng = np.random.default_rng(seed)
    n = int(rng.integers(5, 9))
    frequency = np.sort(rng.uniform(6, 90, n))
    while np.any(np.diff(frequency) / frequency[:-1] < 0.03):
        frequency = np.sort(rng.uniform(6, 90, n))
    frequency = np.insert(frequency, n // 2 + 1, frequency[n // 2] * (1 + rng.choice([0.002, 0.006, 0.01])))
    damping = rng.uniform(0.003, 0.012, n + 1)
    n_u = int(rng.integers(1, 3))
    at_forces = rng.uniform(0.4, 1.5, (n_u, n + 1)) * rng.choice([-1, 1], (n_u, n + 1))
    at_sensors = rng.standard_normal((8, n + 1))
    long = count + 4096
    f = np.fft.rfftfreq(long, 1 / fs)
    force = shaped_noise(rng, long, n_u, ((f > 0.5) & (f < 0.4 * fs)).astype(float))
    motion = respond(force, at_forces, at_sensors, frequency, damping, fs)
    clean = np.hstack([force, motion])[:count]
    sigma = noise * np.concatenate([np.full(n_u, 0.002), np.full(8, rng.uniform(0.01, 0.03))]) * clean.std(0)
    return Laboratory(fs, clean + sigma * rng.standard_normal(clean.shape), n_u, frequency, damping)


def ambient(seed: int, hum: bool, fs: float = 200.0, seconds: float = 600.0) -> Laboratory:
    """Nine modes of a plate, 1.9-33 Hz, under twelve coloured forces; 8 sensors with AR(1) noise; hum at 50 Hz."""
    rng = np.random.default_rng(seed)
    count = int(fs * seconds)
    frequency = np.sort(np.append(1.9 + 31.1 * rng.uniform(0.05, 1, 8), 1.9))
    while np.any(np.diff(frequency) / frequency[:-1] < 0.03):
        frequency = np.sort(np.append(1.9 + 31.1 * rng.uniform(0.05, 1, 8), 1.9))
    damping = rng.uniform(0.005, 0.015, 9)
    order = sorted(((i, j) for i in range(1, 5) for j in range(1, 4)), key=lambda t: t[0] ** 2 + 1.3 * t[1] ** 2)[:9]

    def plate(points: Real) -> Real:
        columns = [np.sin(i * np.pi * points[:, 0]) * np.sin(j * np.pi * points[:, 1]) for i, j in order]
        return np.array(columns).T

    f = np.fft.rfftfreq(count, 1 / fs)
    colours = [rng.uniform(0.5, 2) / np.sqrt(1 + (f / rng.uniform(0.3, 12)) ** 2) for _ in range(12)]
    force = np.hstack([shaped_noise(rng, count, 1, gain * (f < 0.42 * fs)) for gain in colours])
    motion = respond(force, plate(rng.uniform(0, 1, (12, 2))), plate(rng.uniform(0, 1, (8, 2))), frequency, damping, fs)
    size = motion.std(0)
    ar1 = np.abs(1 / (1 - 0.9 * np.exp(-2j * np.pi * f / fs))) * np.sqrt(1 - 0.81)
    out = motion + 0.02 * size * shaped_noise(rng, count, 8, ar1)
    if hum:
        t = np.arange(count) / fs
        level = np.sqrt(2) * size * rng.uniform(0.15, 0.5, 8) * rng.choice([-1, 1], 8)
        out = out + np.sin(2 * np.pi * 50 * t + 0.3)[:, None] * level
    return Laboratory(fs, out, 0, frequency, damping)


def plate(seed: int, fs: float = 1000.0, count: int = 30000) -> Laboratory:
    """A nearly square plate up to 330 Hz (pairs), bursts of force to 0.4 fs; 12 accelerometers, 10 bits, 60 Hz hum."""
    rng = np.random.default_rng(seed)
    side, lowest = rng.uniform(1, 1.04), rng.uniform(9, 14)
    order = [(i, j) for i in range(1, 7) for j in range(1, 7) if lowest * (i * i + side**2 * j * j) < 330]
    order.sort(key=lambda t: t[0] ** 2 + side**2 * t[1] ** 2)
    frequency = lowest * np.array([i * i + side**2 * j * j for i, j in order])
    damping = rng.uniform(0.003, 0.01, len(order))

    def shape(points: Real) -> Real:
        return np.array([np.sin(i * np.pi * points[:, 0]) * np.sin(j * np.pi * points[:, 1]) for i, j in order]).T

    long = count + 2000
    f, t = np.fft.rfftfreq(long, 1 / fs), np.arange(long) / fs
    force = shaped_noise(rng, long, 1, ((f > 5) & (f < 0.4 * fs)).astype(float)) * (t % 5 < 3.5)[:, None]
    motion = respond(
        force, shape(np.array([[0.17, 0.29]])), shape(rng.uniform(0.05, 0.95, (12, 2))), frequency, damping, fs
    )
    size = motion.std(0)
    hum = np.sin(2 * np.pi * 60 * np.outer(t, np.arange(1, 6)) + rng.uniform(0, 6, 5)) @ rng.uniform(0, 0.05, (5, 12))
    clean = np.hstack([force, motion + size * (hum + 0.01 * rng.standard_normal(motion.shape))])[:count]
    step = np.abs(clean).max(0) / 400
    return Laboratory(fs, np.round(clean / step) * step, 1, frequency, damping)


class Chain(NamedTuple):
    """A chain of masses with its record and matrices."""

    lab: Laboratory
    M: Real
    K: Real
    force_dofs: list[int]


def chain(seed: int, fs: float = 200.0, count: int = 20000, noise: float = 0.01) -> Chain:
    """Five masses, accelerations, forces at the ends behind an anti-alias filter at 0.38-0.42 fs; last mode 38 Hz."""
    rng = np.random.default_rng(seed)
    M, springs = np.diag(rng.uniform(1, 3, 5)), rng.uniform(0.6, 1.4, 5)
    K = np.diag(springs + np.append(springs[1:], 0)) - np.diag(springs[1:], 1) - np.diag(springs[1:], -1)
    K = K + np.diag(rng.uniform(0.3, 0.6, 5))
    root = np.diag(1 / np.sqrt(np.diag(M)))
    values, vectors = np.linalg.eigh(root @ K @ root)
    scale = (2 * np.pi * 38) ** 2 / values[-1]
    frequency, damping = np.sqrt(values * scale) / (2 * np.pi), rng.uniform(0.005, 0.01, 5)
    shapes = root @ vectors
    long = count + 4096
    f = np.fft.rfftfreq(long, 1 / fs)
    force = shaped_noise(rng, long, 2, np.clip((0.42 * fs - f) / (0.04 * fs), 0, 1))
    motion = respond(force, shapes[[0, 4]], shapes, frequency, damping, fs)
    noisy = motion + noise * motion.std(0) * rng.standard_normal(motion.shape)
    samples = np.hstack([force, noisy])[:count]
    return Chain(Laboratory(fs, samples, 2, frequency, damping), M, K * scale, [1, 5])
