# SPDX-License-Identifier: MIT
"""Trains over a bridge, their forces unmeasured: the passing axles drive it at frequencies of their own, and what
follows is a free decay. The modes are those of the decays; of cars, which come all the time, those of the record."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import okid
import scipy.signal
from numpy.typing import NDArray
from program import okid as run

FS, OVER = 100.0, 5  # samples a second, and steps of the simulation in each
SPAN, MASS = 30.0, 2e5  # m, kg of a mode
TRUE = np.array([(3.4, 0.015), (5.2, 0.012), (11.9, 0.016), (16.5, 0.02), (25.1, 0.014)])
WAVES, TWISTED = np.array([1, 1, 2, 2, 3]), np.array([False, True, False, True, False])
SENSORS = [(0.28, 1.0), (0.45, -1.0), (0.66, 1.0)]  # of the span, and the side
PULL = 1.2e5  # N of an axle


def shapes(at: NDArray[np.float64], side: float) -> NDArray[np.float64]:
    """(modes, places): zero off the bridge."""
    out = np.sin(np.outer(WAVES, np.pi * np.clip(at, 0, 1)))
    out[TWISTED] *= side
    return out


def passing(seconds: float, axles: list[tuple[float, float, float, float]], seed: int) -> NDArray[np.float64]:
    """Accelerations in m/s^2 under axles (time at the bridge in s, speed in m/s, force in N, side), wind and noise."""
    rng = np.random.default_rng(seed)
    step, count = 1 / FS / OVER, int(seconds * FS) * OVER
    force = 50 * rng.standard_normal((len(TRUE), count)) * np.sqrt(OVER)
    for when, speed, newton, side in axles:
        first, steps = int(when / step), int(SPAN / speed / step)
        at = np.arange(min(steps, count - first)) * step * speed / SPAN
        rough = 1 + 0.05 * rng.standard_normal(len(at))
        force[:, first : first + len(at)] += newton * rough * shapes(at, side)
    places = np.hstack([shapes(np.array([at]), side) for at, side in SENSORS])
    y = np.zeros((count, len(SENSORS)))
    for (hz, zeta), f, shape in zip(TRUE, force / MASS, places, strict=True):
        own = scipy.signal.cont2discrete(([1.0, 0, 0], [1, 4 * np.pi * zeta * hz, (2 * np.pi * hz) ** 2]), step)
        y += np.outer(scipy.signal.lfilter(np.ravel(own[0]), own[1], f), shape)
    low = scipy.signal.resample_poly(y, 1, OVER, axis=0)
    return low + 1e-3 * rng.standard_normal(low.shape)


def trains(seed: int) -> NDArray[np.float64]:
    """Five in 200 s: four cars of 26 m, each with two bogies of two axles."""
    rng = np.random.default_rng(seed)
    axles = []
    for when in 6 + 38 * np.arange(5) + rng.uniform(0, 6, 5):
        speed, side = rng.uniform(24, 42), 0.4 * rng.choice([-1, 1])
        for car in range(4):
            axles += [(when + (26 * car + x) / speed, speed, PULL, side) for x in (0.0, 2.4, 18.0, 20.4)]
    return passing(200, axles, seed)


def cars(seed: int) -> NDArray[np.float64]:
    """Some 130 in 300 s, of two axles, light and heavy."""
    rng = np.random.default_rng(seed)
    axles = []
    for when in np.cumsum(rng.exponential(2.2, 130)):
        speed, newton = rng.uniform(12, 25), rng.lognormal(8.7, 0.5)
        axles += [(when + x / speed, speed, newton, rng.choice([-0.4, 0.4])) for x in (0.0, 2.9)]
    return passing(300, [axle for axle in axles if axle[0] < 296], seed)


def unmatched(modes: list[Any], hz: NDArray[np.float64]) -> list[float]:
    return [m.frequency_hz for m in modes if np.min(np.abs(m.frequency_hz / hz - 1)) > 0.01]


def test_modes_are_those_of_what_follows_the_trains() -> None:
    z = []
    for seed in (1, 2, 3, 4):
        result = okid.identify(None, trains(seed), fs=FS)
        found = result.confident_modes
        assert len(found) == len(TRUE) and not unmatched(found, TRUE[:, 0]), result.table()
        for mode, (hz, zeta) in zip(found, TRUE, strict=True):
            assert abs(mode.damping_ratio / zeta - 1) < 0.25, (seed, hz)
            z += [
                (mode.frequency_hz - hz) / mode.frequency_std_hz,
                (mode.damping_ratio - zeta) / mode.damping_ratio_std,
            ]
        [remark] = [w.text for w in result.warnings if w.code == "free_decays"]
        assert remark.startswith("5 times the power falls by 20 dB and more")
    assert np.sqrt(np.mean(np.square(z))) < 2 and np.max(np.abs(z)) < 5


def test_cars_are_the_whole_record() -> None:
    for seed in (1, 2):
        result = okid.identify(None, cars(seed), fs=FS)
        assert "free_decays" not in [w.code for w in result.warnings]
        assert len(result.confident_modes) >= 4 and not unmatched(result.confident_modes, TRUE[:, 0]), result.table()


def test_numbers_of_modes_are_those_of_the_table(tmp_path: Path) -> None:
    """`--modes` picks from what was printed, and a session decides as a file does."""
    y = trains(3)
    okid.write_csv(tmp_path / "r.csv", okid.Record(["a", "b", "c"], y, FS))
    command = ("identify", tmp_path / "r.csv", "--outputs", "a,b,c", "--json", "-")
    every, picked = (json.loads(run(*command, *more, status=0).stdout) for more in ((), ("--modes", "1,3")))
    chosen = [mode["frequency_hz"] for mode in picked["modes"]]
    assert chosen == [every["modes"][k]["frequency_hz"] for k in (0, 2)]
    with okid.Session(0, ["a", "b", "c"], fs=FS) as session:
        for block in np.array_split(y, 7):
            session.feed(block)
        assert [m.frequency_hz for m in session.identify().modes] == [m["frequency_hz"] for m in every["modes"]]


def test_a_stream_keeps_what_the_decays_tell_until_it_decides_again() -> None:
    """Its sums hold the trains, too, and would move the modes by many deviations."""
    rows = trains(1)
    stream = okid.Session(0, len(SENSORS), fs=FS)
    stream.feed(rows[:16000])
    decided = stream.modes()
    assert "free_decays" in [one.code for one in stream.identify().warnings]
    for first in (16000, 16800):
        stream.feed(rows[first : first + 800])
        for then, now in zip(decided, stream.modes(), strict=True):
            assert (now.frequency_hz, now.damping_ratio) == (then.frequency_hz, then.damping_ratio)
