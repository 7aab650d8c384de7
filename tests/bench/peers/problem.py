# SPDX-License-Identifier: MIT
"""One problem for every peer: the records of W1, W2, W3 as files, and the worst error of the modes that were found.

Structures and noise are those of tests/support/systems.py: white forces, accelerometers on every mass, noise in
percent of the root mean square of each sensor. True order and the same block rows for all.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import systems

Real = np.ndarray[Any, np.dtype[np.float64]]


@dataclass(frozen=True)
class Case:
    """samples, block rows s of the n4sid methods (observer order of the OKID methods where it can be set apart)."""

    name: str
    samples: int
    rows: int

    def structure(self) -> systems.Structure:
        made: systems.Structure = {"W1": systems.w1, "W2": systems.w2, "W3": systems.w3}[self.name]()
        return made


CASES = {case.name: case for case in (Case("W1", 10_000, 10), Case("W2", 20_000, 15), Case("W3", 100_000, 22))}


@dataclass(frozen=True)
class Problem:
    """u (samples, inputs), y (samples, outputs) at fs Hz; order: number of states; rows: block rows s."""

    u: Real
    y: Real
    fs: float
    order: int
    rows: int
    ringing: int  # samples in which the slowest mode decays to 1 %, for methods that need the whole impulse response


@dataclass(frozen=True)
class Modes:
    """What a method found when it gives no state matrix: frequencies in Hz, damping ratios."""

    frequency_hz: Real
    damping_ratio: Real


def modes_of(A: Real, fs: float) -> Modes:
    """Underdamped modes of a discrete state matrix."""
    poles = np.linalg.eigvals(A).astype(complex)
    poles = poles[np.abs(poles) > 0.0]
    lam = fs * np.log(poles[poles.imag > 0.0])
    return Modes(np.abs(lam) / (2.0 * np.pi), -lam.real / np.abs(lam))


def record_path(folder: Path, case: str, noise_percent: float, seed: int) -> Path:
    return folder / f"{case}_{noise_percent:g}_{seed}.npz"


def write_record(folder: Path, case: Case, noise_percent: float, seed: int) -> None:
    path = record_path(folder, case.name, noise_percent, seed)
    if not path.exists():
        u, y = systems.record(case.structure(), case.samples, noise_percent, seed)
        made = path.with_suffix(".part")
        with open(made, "wb") as file:
            np.savez(file, u=u, y=y)
        made.rename(path)


def read_problem(folder: Path, case: Case, noise_percent: float, seed: int) -> Problem:
    s = case.structure()
    f, zeta = s.modes()
    slowest = float(np.min(2.0 * np.pi * f * zeta))
    with np.load(record_path(folder, case.name, noise_percent, seed)) as held:
        u, y = held["u"], held["y"]
    return Problem(u, y, s.fs, 2 * len(s.M), case.rows, int(np.ceil(np.log(100.0) / slowest * s.fs)))


def worst_errors(case: Case, found: Modes) -> tuple[float, float, int]:
    """Largest relative error of frequency and of damping over the true modes, and how many of them are missing: none
    found within 5 % of its frequency. The errors are those of the modes that are there."""
    worst, missing = [0.0, 0.0], 0
    for f, zeta in zip(*case.structure().modes(), strict=True):
        off = np.abs(found.frequency_hz - f) / f
        if len(off) == 0 or not np.min(off) < 0.05:
            missing += 1
            continue
        nearest = int(np.argmin(off))
        worst[0] = max(worst[0], float(off[nearest]))
        worst[1] = max(worst[1], float(abs(found.damping_ratio[nearest] - zeta) / zeta))
    return worst[0], worst[1], missing
