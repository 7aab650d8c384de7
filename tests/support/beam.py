# SPDX-License-Identifier: MIT
"""A hammer test of a free beam as an analyser records it: hits at twelve places, two accelerometers that stay.

The response is the sum of the modes (exact for straight lines between samples at sixteen times the rate), behind the
same anti-alias filter as the force. Nothing of okid takes part.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.signal import firwin, lfilter, upfirdn

Real = NDArray[np.float64]
FS, SECONDS, FINER = 2048.0, 2.5, 16
BEFORE = 0.1  # s before a hit
MASS, LENGTH = 6.0, 1.0
FREQUENCY = np.array([36.2, 98.7, 190.4, 308.9, 447.5, 604.2, 775.3])  # shear and rotary inertia lower the upper ones
DAMPING = np.array([0.0035, 0.004, 0.005, 0.006, 0.007, 0.008, 0.009])
PLACES = 12
SENSORS = (1, 5)  # the places of the accelerometers
_ROOTS = np.array([4.730041, 7.853205, 10.995608, 14.137165, 17.278760, 20.420352, 23.561945])


def shapes() -> Real:
    """Bending of a free beam at the places (places, modes)."""
    x = np.linspace(0, 1, PLACES)[:, None] * _ROOTS
    end = (np.cosh(_ROOTS) - np.cos(_ROOTS)) / (np.sinh(_ROOTS) - np.sin(_ROOTS))
    return np.cosh(x) + np.cos(x) - end * (np.sinh(x) + np.sin(x))


def modal_mass() -> Real:
    """kg, of shapes whose largest entry over the places is 1."""
    return MASS / np.max(np.abs(shapes()), axis=0) ** 2  # the mean square of these functions over the beam is 1


@dataclass
class Hit:
    """Where and how a hit was struck; `fault` is one of the reasons for which it is left out."""

    place: int
    peak: float
    width: float  # s
    fault: str = ""


def half_sine(t: Real, start: float, width: float) -> Real:
    inside = (t >= start) & (t <= start + width)
    return np.where(inside, np.sin(np.pi * (t - start) / width), 0.0)


def _modal(force: Real, f: float, zeta: float, dt: float) -> Real:
    """Acceleration of a mode of 1 kg under straight lines between samples."""
    w = 2 * np.pi * f
    pole = complex(-zeta * w, w * np.sqrt(1 - zeta**2))
    mu, residue = np.exp(pole * dt), 1 / (2j * pole.imag)
    g1, g2 = (mu - 1) / pole, (mu - 1 - pole * dt) / (pole**2 * dt)
    # displacement = 2 Re of one state; acceleration = force + 2 Re(residue pole^2 state)
    state = lfilter([g2, g1 - g2], [1, -mu], force.astype(complex))
    out: Real = force + 2 * np.real(residue * pole**2 * state)
    return out


def record(hit: Hit, rng: np.random.Generator, noise: float = 0.01) -> Real:
    """(samples, 3): force N, two accelerations m/s^2. `noise` of the rms of an acceleration after a hit of 100 N."""
    count = int(SECONDS * FS)
    t = np.arange(-2048, count * FINER + 2048) / (FS * FINER)
    start = BEFORE + rng.uniform(0, 0.01)
    if hit.fault == "too_early":
        start = -0.4 * hit.width
    if hit.fault == "late":
        start = 0.8 * SECONDS
    force = hit.peak * half_sine(t, start, hit.width)
    if hit.fault == "double_hit":
        force += 0.3 * hit.peak * half_sine(t, start + 0.035, hit.width)
    pushed = force + (0.3 * hit.peak * half_sine(t, start - 0.09, hit.width) if hit.fault == "moving" else 0.0)
    phi, at = shapes(), hit.place - 1
    motion = np.zeros((len(SENSORS), len(t)))
    for k, (f, zeta) in enumerate(zip(FREQUENCY, DAMPING, strict=True)):
        modal = _modal(pushed, f, zeta, 1 / (FS * FINER)) * phi[at, k] / MASS
        motion += modal * phi[[place - 1 for place in SENSORS], k][:, None]
    x = np.linspace(-0.5, 0.5, PLACES)  # the beam as a rigid body
    rigid = 1 / MASS + 12 / MASS * x[at] * x[[place - 1 for place in SENSORS]]
    motion += rigid[:, None] * pushed
    taps = firwin(1601, 0.45 * FS, fs=FS * FINER, window=("kaiser", 8.0))
    first = (2048 + len(taps) // 2) // FINER
    both = np.vstack([force, motion])
    kept = np.array([upfirdn(taps, row, down=FINER)[first : first + count] for row in both]).T
    level = noise * 20.0  # m/s^2, about the rms after a hit of 100 N
    kept[:, 0] += 0.02 * rng.standard_normal(count)
    kept[:, 1:] += level * rng.standard_normal((count, 2))
    if hit.fault == "overload":
        most = 0.6 * np.max(np.abs(kept[:, 2]))
        kept[:, 2] = np.clip(kept[:, 2], -most, most)
    if hit.fault == "overload of the force":
        kept[:, 0] = np.minimum(kept[:, 0], 0.6 * np.max(kept[:, 0]))
    if hit.fault == "samples_lost":
        kept[1000:1003, 0] = np.nan
    return kept


def hammer_test(
    seed: int, faults: Mapping[tuple[int, int], str], each: int = 3, noise: float = 0.01
) -> dict[str, Real]:
    """Records by file name, P01_1.csv ... P12_3.csv; `faults` by (place, number)."""
    rng = np.random.default_rng(seed)
    out = {}
    for place in range(1, PLACES + 1):
        for number in range(1, each + 1):
            fault = faults.get((place, number), "")
            soft = 0.003 if fault.startswith("overload of") else rng.uniform(0.001, 0.003)
            hit = Hit(place, 0.05 if fault == "weak" else rng.uniform(40, 160), soft, fault)
            out[f"P{place:02}_{number}.csv"] = record(hit, rng, noise)
    return out


def write(
    folder: Path, records: Mapping[str, Real], header: str = "Hammer [N],Acc1 [m/s^2],Acc2 [m/s^2]"
) -> list[Path]:
    """As CSV files; returns their paths in order."""
    paths = []
    for name, rows in records.items():
        paths.append(folder / name)
        np.savetxt(paths[-1], rows, fmt="%.7g", delimiter=",", comments="", header=f"# fs_hz: {FS:g}\n{header}")
    return paths


def mac(a: Real, b: Real) -> float:
    return float(abs(np.vdot(a, b)) ** 2 / (np.vdot(a, a).real * np.vdot(b, b).real))
