# SPDX-License-Identifier: MIT
"""Change without identification on W2, against its own simulation: modal recursions in SciPy, shifts from the
eigenvalues of M and K. Shared with the library: the accumulator's sums, whose Gram matrix has tests of its own."""

from __future__ import annotations

import os
from typing import Any

import numpy as np
import okid
import pytest
from numpy.typing import NDArray
from okid.identification.change_test import ChangeTest, ChangeVerdict
from scipy.linalg import eigh, expm
from scipy.signal import lfilter
from scipy.stats import binom

Real = NDArray[np.float64]
MASS = np.diag([2.0, 1.5, 1.8, 1.2, 1.6, 1.0])
SPRINGS = np.array([8e4, 6e4, 7e4, 5e4, 5.5e4, 4e4])
SLOW = os.environ.get("OKID_SLOW") == "1"  # the long tier
ROWS, BLOCKS, NOISE = 6, 20, 0.05


def stiffness(springs: Real) -> Real:
    K = np.diag(springs) + np.diag(np.append(springs[1:], 0.0))
    return np.asarray(K - np.diag(springs[1:], 1) - np.diag(springs[1:], -1))


OMEGA = np.sqrt(eigh(stiffness(SPRINGS), MASS, eigvals_only=True))
DT = 0.6 * np.pi / OMEGA[-1]
BETA = 0.02 / (OMEGA[0] + OMEGA[-1])
DAMPING = BETA * OMEGA[0] * OMEGA[-1] * MASS + BETA * stiffness(SPRINGS)


def simulate(springs: Real, forces: list[int], samples: int, seed: int, level: float = 1.0, colour: float = 0.0) -> Any:
    """u (N, n_u), y (N, 6): accelerations, forces that are held over a sample."""
    rng, inverse, K = np.random.default_rng(seed), np.linalg.inv(MASS), stiffness(springs)
    Ac = np.block([[np.zeros((6, 6)), np.eye(6)], [-inverse @ K, -inverse @ DAMPING]])
    n_u = len(forces)
    Bc = np.vstack([np.zeros((6, n_u)), inverse[:, forces]])
    whole = expm(DT * np.block([[Ac, Bc], [np.zeros((n_u, 12 + n_u))]]))
    poles, V = np.linalg.eig(whole[:12, :12])
    B, C = np.linalg.solve(V, whole[:12, 12:]), np.hstack([-inverse @ K, -inverse @ DAMPING]) @ V
    u = level * lfilter([1.0], [1.0, -colour], rng.standard_normal((samples + 2000, n_u)), axis=0)
    y = u @ inverse[:, forces].T
    for k in np.flatnonzero(poles.imag > 0):
        y = y + 2.0 * np.real(np.outer(lfilter([0.0, 1.0], [1.0, -poles[k]], u @ B[k]), C[:, k]))
    y += NOISE * y.std(axis=0) * rng.standard_normal(y.shape)
    return u[2000:], y[2000:]


def blocks(u: Real | None, y: Real) -> list[okid.Accumulator]:
    v = y if u is None else np.hstack([u, y])
    cuts, lags, out = np.linspace(0, len(v), BLOCKS + 1).astype(int), 2 * ROWS - 1, []
    for low, high in zip(cuts[:-1], cuts[1:], strict=True):
        one = okid.Accumulator(v.shape[1] - 6, 6, lags)
        one.add(np.ascontiguousarray(v[max(0, low - lags) : high]))
        out.append(one)
    return out


def verdict(springs: Real, seed: int, seconds: float, ambient: bool, **excitation: float) -> ChangeVerdict:
    """A baseline of its own for each test: the verdicts are independent."""
    forces, samples = list(range(6)) if ambient else [0, 3], int(seconds / DT)
    test = ChangeTest(0 if ambient else 2, 6, fs=1.0 / DT, rows=ROWS, blocks=BLOCKS, false_alarm=0.05)
    u, y = simulate(SPRINGS, forces, samples, 2 * seed)
    test.learn(blocks(None if ambient else u, y))
    u, y = simulate(springs, forces, samples, 2 * seed + 1, **excitation)
    return test.test(blocks(None if ambient else u, y))


def softer(spring: int) -> Real:
    out = SPRINGS.copy()
    out[spring] *= 0.98
    return out


LOUDER = {"level": 5.0, "colour": 0.8}
CASES = (
    [(ambient, kind) for ambient in (False, True) for kind in ({}, LOUDER)]
    if SLOW
    else [(False, LOUDER), (True, LOUDER)]
)


@pytest.mark.parametrize(("ambient", "excitation"), CASES)
def test_false_alarms_at_the_set_rate(ambient: bool, excitation: dict[str, float]) -> None:
    """Runs of ten minutes (long tier) or one, each with a baseline of its own."""
    count, seconds = (200, 600.0) if SLOW else (6, 60.0)
    p_values = [verdict(SPRINGS, 1000 + k, seconds, ambient, **excitation).p_value for k in range(count)]
    alarms = sum(p < 0.05 for p in p_values)
    assert binom.ppf(0.005, count, 0.05) <= alarms <= binom.ppf(0.995, count, 0.05)
    assert max(p_values) > 0.3  # spread over 0 .. 1, not all small


@pytest.mark.parametrize("spring", range(6) if SLOW else [0, 2, 5])
def test_two_percent_of_a_spring(spring: int) -> None:
    """Every frequency shift too: within the deviations that are told."""
    found = verdict(softer(spring), spring, 60.0, ambient=False, **LOUDER)
    truth = np.sqrt(eigh(stiffness(softer(spring)), MASS, eigvals_only=True)) / OMEGA - 1.0
    assert found.alarm and found.p_value < 1e-6 and len(found.modes) == 6
    for mode, shift in zip(found.modes, truth, strict=True):
        assert mode.shift == pytest.approx(shift, abs=4.0 * mode.sigma + 0.05 * abs(shift) + 1e-5)


@pytest.mark.parametrize("spring", range(6) if SLOW else [2])
def test_two_percent_in_ten_minutes_of_ambient_vibration(spring: int) -> None:
    """At a false-alarm rate of one in a thousand."""
    found = [verdict(softer(spring), 5000 + k, 600.0, True, **LOUDER).p_value < 0.001 for k in range(40 if SLOW else 4)]
    assert np.mean(found) >= 0.95


def test_refusals() -> None:
    with pytest.raises(okid.InputError, match="rows=1"):
        ChangeTest(0, 3, fs=100.0, rows=1)
    test = ChangeTest(0, 6, fs=1.0 / DT, rows=ROWS)
    with pytest.raises(okid.InputError, match="do not fit"):
        test.test([])
    with pytest.raises(okid.IdentificationError, match="fewer usable"):
        test.learn([])
