# SPDX-License-Identifier: MIT
"""Modes under measured forces: dwells, releases, periodic forces, hits while a machine runs, many modes at
once, heavy damping, hardly any."""

from __future__ import annotations

from typing import Any

import numpy as np
import okid
import pytest
from modal_sums import OVER, Sums
from scipy import signal


def codes(result: Any) -> list[str]:
    return [warning.code for warning in result.warnings]


@pytest.mark.parametrize("seed", range(4))
def test_dwells_leave_the_modes(seed: int) -> None:
    """A sine near one mode after the other, and rest; turbulence that is not measured."""
    s = Sums(100, [4.1, 5.6, 8.2, 10.3, 14.5, 19.0, 24.0, 31.0], (0.015, 0.05), 4, seed)
    t = np.arange(60 * 100 * OVER) / 100 / OVER
    force = np.zeros(len(t))
    for k, mode in enumerate([0, 1, 2, 4, 5, 6]):
        on = (t >= 10 * k + 0.5) & (t < 10 * k + 5)
        force[on] = 20 * np.sin(2 * np.pi * 1.01 * s.f[mode] * (t[on] - 10 * k))
    b, a = signal.butter(1, 8 / (50 * OVER))
    turbulence = sum(
        s.response(0.5 * x / x.std(), s.rng.standard_normal(8))
        for x in signal.lfilter(b, a, s.rng.standard_normal((3, len(t))))
    )
    u, y = s.record(force, turbulence)
    result = okid.identify(u, y, fs=100)
    assert max(s.found(result)) < 0.02


@pytest.mark.parametrize("seed", range(4))
def test_releases_leave_the_modes(seed: int) -> None:
    """Pulled slowly and let go, three times: all modes ring from the same instant."""
    s = Sums(50, [0.72, 1.05, 2.05, 2.9, 4.2, 6.1, 8.3], (0.004, 0.015), 2, seed)
    t = np.arange(150 * 50 * OVER) / 50 / OVER
    force = np.where(t % 50 < 12, 1000 * np.minimum(t % 50 / 8, 1), 0.0)
    u, y = s.record(force)
    result = okid.identify(u, y, fs=50)
    assert max(s.found(result)) < 0.01


@pytest.mark.parametrize("seed", range(4))
def test_periodic_forces_leave_the_modes(seed: int) -> None:
    """The same two seconds of noise again and again: all amplitudes stay."""
    s = Sums(512, [11.0, 19.0, 31.0, 44.0, 60.0, 83.0, 110.0, 150.0], (0.006, 0.012), 3, seed)
    period = s.rng.standard_normal(2 * 512 * OVER)
    b, a = signal.butter(4, 200 / (256 * OVER))
    force = signal.lfilter(b, a, np.tile(period, 12))
    u, y = s.record(force)
    result = okid.identify(u, y, fs=512)
    assert max(s.found(result)) < 0.01
    assert "nonlinear" not in codes(result)


@pytest.mark.parametrize("seed", range(4))
def test_hits_beside_a_running_machine(seed: int) -> None:
    """Its orders are in phase with each other, and say nothing of the structure."""
    s = Sums(2048, [47.0, 70.0, 107.0, 138.0, 166.0, 212.0, 261.0, 318.0, 390.0], (0.006, 0.015), 3, seed)
    t = np.arange(20 * 2048 * OVER) / 2048 / OVER
    force = np.zeros(len(t))
    for hit in 1 + 1.9 * np.arange(10) + 0.2 * s.rng.random(10):
        on = (t >= hit) & (t < hit + 0.0012)
        force[on] = 300 * np.sin(np.pi * (t[on] - hit) / 0.0012) ** 1.5
    clean = s.response(force, s.at[0])
    orders = zip([1, 2, 3, 4, 6, 8, 12], [1, 0.7, 0.3, 0.5, 0.4, 0.3, 0.2], strict=True)
    machine = sum(
        np.outer(0.02 * np.abs(clean).max() * size * s.rng.uniform(0.3, 1, 3), np.sin(2 * np.pi * 24.7 * n * t + n))
        for n, size in orders
    )
    u, y = s.record(force, machine)
    result = okid.identify(u, y, fs=2048)
    assert max(s.found(result)) < 0.01
    assert "nonlinear" not in codes(result)


@pytest.mark.parametrize("seed", [1, 2])
def test_many_modes_that_overlap(seed: int) -> None:
    """Forty modes need 80 states; a run has 64 at first, and as these stand 5.6 % apart on average, damped by 1 to
    3 %, they blend: few are clear."""
    s = Sums(512, [22 * 1.056**k for k in range(40)], (0.01, 0.03), 8, seed)
    b, a = signal.butter(4, 220 / (256 * OVER))
    u, y = s.record(signal.lfilter(b, a, s.rng.standard_normal(64 * 512 * OVER)))
    result = okid.identify(u, y, fs=512)
    assert max(s.found(result)) < 0.01


@pytest.mark.parametrize("seed", range(4))
def test_heavily_damped_modes(seed: int) -> None:
    """They have died away long before the horizon of a run ends; one sensor, shapes say nothing."""
    s = Sums(400, [18.0, 33.0, 51.0, 70.0, 92.0, 118.0], (0.06, 0.14), 1, seed)
    u, y = s.record(s.rng.standard_normal(60 * 400 * OVER))
    result = okid.identify(u, y, fs=400)
    assert sum(far < 0.01 for far in s.found(result)) >= 4
    assert sum(mode.confident for mode in result.modes) <= len(s.f)


@pytest.mark.parametrize("seed", range(4))
def test_coupled_blades_that_ring_on(seed: int) -> None:
    """They beat, and hardly decay while they are recorded; the first hit was before."""
    s = Sums(1000, [27.0] * 6, (0.0008, 0.0012), 6, seed)
    s.f = np.array([26.8, 27.06, 27.25, 27.5, 27.72, 28.0]) * (1 + 0.001 * s.rng.uniform(-1, 1, 6))
    s.at = s.rng.standard_normal((6, 6))
    s.at[0] = np.copysign(np.maximum(np.abs(s.at[0]), 0.3), s.at[0])
    force = np.zeros(7 * 1000 * OVER)
    for hit in (0.2, 4.1):
        at = int(hit * 1000 * OVER)
        force[at : at + 2 * OVER] = 100 * np.sin(np.pi * np.arange(2 * OVER) / 2 / OVER)
    u, y = s.record(force)
    result = okid.identify(u[1000:], y[1000:], fs=1000)
    assert sum(far < 0.002 for far in s.found(result)) >= 5


@pytest.mark.parametrize("seed", range(4))
def test_hum_beside_one_hit(seed: int) -> None:
    """At the hit all modes answer at the frequency of the hum too."""
    s = Sums(1024, [31.0, 58.0, 97.0, 122.0, 205.0, 301.0], (0.001, 0.006), 2, seed)
    t = np.arange(8 * 1024 * OVER) / 1024 / OVER
    force = np.zeros(len(t))
    at = int(0.1 * 1024 * OVER)
    force[at : at + 2 * OVER] = 100 * np.sin(np.pi * np.arange(2 * OVER) / 2 / OVER)
    most = np.abs(s.response(force, s.at[0])).max()
    hum = sum(1e-3 * size * np.sin(2 * np.pi * f * t + f) for f, size in ((50, 3), (150, 1), (250, 1)))
    u, y = s.record(force, most * hum)
    result = okid.identify(u, y, fs=1024)
    assert max(s.found(result)) < 0.01
    assert not [m for m in result.modes if m.confident and min(abs(m.frequency_hz - f) for f in (50, 150, 250)) < 0.3]
