# SPDX-License-Identifier: MIT
"""A small corpus of simulated measurements with known modes: each kind is something the default method once failed on.

Nothing here is the program's, nor its assumptions: each mode is integrated exactly for a force that is linear between
steps several times finer than the samples; forces are smooth pulses or coloured noise, never held over a sample; force
and response pass the same anti-alias filter; sensors have noise and offsets. Every record has its seed.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import signal

Real = NDArray[np.float64]


@dataclass(frozen=True)
class Truth:
    """Modes of a structure: what drives them (modes, n_u) and what is seen of them (n_y, modes)."""

    hz: Real
    damping: Real
    drive: Real
    shapes: Real


@dataclass(frozen=True)
class Record:
    """A measurement as okid.identify() takes it, and the modes that it shows."""

    u: Real | None
    y: Real
    fs: float
    hz: Real
    damping: Real
    shapes: Real
    options: Mapping[str, Any] = field(default_factory=dict)


def modal(truth: Truth, force: Real, step_s: float, kinds: str = "") -> Real:
    """Response (steps, n_y) from rest; `kinds`: for each output a (acceleration), v or d, all a when empty."""
    out = np.zeros((len(force), len(truth.shapes)))
    for k, (f, zeta) in enumerate(zip(truth.hz, truth.damping, strict=True)):
        pole = 2 * np.pi * f * complex(-zeta, np.sqrt(1 - zeta**2))
        turn = np.exp(pole * step_s)
        end = (turn - 1 - pole * step_s) / (pole**2 * step_s)  # of the force at the end of a step
        start = (turn - 1) / pole - end
        on_mode = force @ truth.drive[k]
        z = signal.lfilter([end, start], [1, -turn], on_mode)
        motion = {"d": z.imag / pole.imag, "v": (pole * z).imag / pole.imag}
        motion["a"] = on_mode + (pole**2 * z).imag / pole.imag
        for i, kind in enumerate(kinds or "a" * len(truth.shapes)):
            out[:, i] += truth.shapes[i, k] * motion[kind]
    return out


def sampled(fine: Real, fs: float, times: int) -> Real:
    """Every `times`-th value behind a filter that leaves nothing above 0.58 of the rate."""
    sos = signal.cheby2(10, 80, 0.58 * fs, fs=times * fs, output="sos")
    return np.asarray(signal.sosfilt(sos, fine, axis=0)[::times])


def measured(rng: np.random.Generator, clean: Real, noise: float) -> Real:
    """With sensor noise, a share of each channel's spread, and an offset of about its spread."""
    spread = clean.std(0)
    return np.asarray(clean + spread * (noise * rng.standard_normal(clean.shape) + rng.uniform(-1, 1, clean.shape[1])))


def response(truth: Truth, force: Real, fs: float, times: int, kinds: str = "") -> Real:
    """To a force at `times` the rate, sampled."""
    return sampled(modal(truth, force, 1 / fs / times, kinds), fs, times)


def shown(truth: Truth, fs: float, u: Real | None, y: Real, options: Mapping[str, Any] | None = None) -> Record:
    """All modes of the structure are in the band."""
    return Record(u, y, fs, truth.hz, truth.damping, truth.shapes, options or {})


def hits(count: int, fine_hz: float, at_s: list[float], width_s: float, rng: np.random.Generator) -> Real:
    """Smooth pulses (1 - cos), a little different in strength and width."""
    t = np.arange(count)[:, None] / fine_hz
    force = np.zeros((count, 1))
    for at in at_s:
        width = width_s * rng.uniform(0.9, 1.1)
        inside = np.abs(t - at) < width / 2
        force += rng.uniform(0.7, 1.3) * inside * (1 + np.cos(2 * np.pi * (t - at) / width))
    return force


def coloured(rng: np.random.Generator, count: int, fine_hz: float, low: float, high: float, n: int = 1) -> Real:
    """Noise in a band with slopes of first order."""
    sos = signal.butter(1, [low, high], "bandpass", fs=fine_hz, output="sos")
    return np.asarray(signal.sosfilt(sos, rng.standard_normal((count, n)), axis=0))


def plate(fs: float, seconds: float, at_s: list[float], seed: int) -> Record:
    """23 modes of a simply supported plate of 0.6 x 0.43 m, struck and measured at one point each."""
    rng = np.random.default_rng([1, seed])
    index = [(m, n) for m in range(1, 9) for n in range(1, 9)]
    hz = np.array([12.0 * ((m / 0.6) ** 2 + (n / 0.43) ** 2) for m, n in index])
    first = np.argsort(hz)[:23]
    strike, sensor = (0.25, 0.12), (0.53, 0.25)  # no mode has a node line near

    def deflection(at: tuple[float, float]) -> Real:
        return np.array([np.sin(m * np.pi * at[0] / 0.6) * np.sin(n * np.pi * at[1] / 0.43) for m, n in index])[first]

    truth = Truth(hz[first], rng.uniform(0.002, 0.006, 23), deflection(strike)[:, None], deflection(sensor)[None])
    times = 4
    force = hits(int(seconds * fs * times), fs * times, at_s, 0.0006, rng)
    u, y = sampled(force, fs, times), response(truth, force, fs, times)
    return shown(truth, fs, measured(rng, u, 0.002), measured(rng, y, 0.002))


def rod(seed: int) -> Record:
    """Axial modes of a free rod of steel, struck at its end, the force not measured; hardly any damping."""
    rng = np.random.default_rng([3, seed])
    fs, times, order = 20000.0, 4, np.arange(1, 7)
    truth = Truth(
        np.asarray(1280.0 * order, np.float64),
        np.linspace(1e-4, 4e-4, 6),
        np.ones((6, 1)),
        np.cos(np.pi * order * 0.03)[None],
    )
    force = hits(int(2.0 * fs * times), fs * times, [0.05], 0.00012, rng)
    y = response(truth, force, fs, times)[int(0.06 * fs) :]
    return shown(truth, fs, None, measured(rng, y, 0.002))


def bridge(seed: int) -> Record:
    """Traffic and wind on a bridge under one accelerometer, ten minutes."""
    rng = np.random.default_rng([4, seed])
    fs, times = 50.0, 8
    hz = np.array([2.31, 3.74, 5.92, 8.05, 11.6])
    truth = Truth(
        hz,
        np.array([0.009, 0.012, 0.008, 0.011, 0.009]),
        rng.uniform(0.5, 1.5, (5, 4)),
        np.array([[1.0, 0.8, -0.9, 0.7, 0.8]]),
    )
    force = coloured(rng, int(600 * fs * times), fs * times, 0.5, 15.0, 4)
    y = response(truth, force, fs, times)
    return shown(truth, fs, None, measured(rng, y, 0.03))


def building(seed: int) -> Record:
    """A building in an earthquake of 41 s: three motions of the ground, eight accelerometers."""
    rng = np.random.default_rng([5, seed])
    fs, times = 100.0, 8
    # Two directions and torsion, a cantilever's first two or three modes each; floors at 1/4 .. 1 of the height.
    hz = np.array([1.02, 1.31, 1.74, 3.4, 4.2, 5.6])
    floor = np.array([0.25, 0.5, 0.75, 1.0])
    first, second = np.sin(np.pi * floor / 2), np.sin(3 * np.pi * floor / 2)
    shapes, drive = np.zeros((8, 6)), np.zeros((6, 3))
    for k in range(6):
        up = first if k < 3 else second
        way = k % 3  # along, across, torsion: seen in both directions
        shapes[:4, k] = up * (1.0, 0.1, 0.5)[way]
        shapes[4:, k] = up * (0.1, 1.0, -0.6)[way]
        drive[k] = -(1.3 if k < 3 else 0.5) * np.array([(1, 0.1, 0), (0.1, 1, 0.05), (0.4, -0.5, 0.1)][way])
    truth = Truth(hz, np.full(6, 0.03), drive, shapes)
    count = int(41 * fs * times)
    t = np.arange(count)[:, None] / fs / times
    ground = coloured(rng, count, fs * times, 0.7, 8.0, 3) * (t / 5) * np.exp(1 - t / 5)
    carried = np.repeat(np.eye(3)[[0, 1]], 4, axis=0)  # absolute acceleration: the ground's and the structure's
    y = sampled(modal(truth, ground, 1 / fs / times) + ground @ carried.T, fs, times)
    return shown(truth, fs, measured(rng, sampled(ground, fs, times), 0.005), measured(rng, y, 0.005))


def mixed(told: bool, seed: int) -> Record:
    """Velocity sensors beside accelerometers on a beam that a shaker drives."""
    rng = np.random.default_rng([6, seed])
    fs, times = 400.0, 8
    hz = np.array([14.3, 39.0, 77.5])
    at = np.array([0.2, 0.45, 0.6, 0.85])
    shapes = np.array([np.sin(k * np.pi * at) for k in (1, 2, 3)]).T
    truth = Truth(hz, np.array([0.008, 0.006, 0.009]), shapes[:1].T, shapes)
    force = coloured(rng, int(20 * fs * times), fs * times, 4.0, 150.0)
    y = measured(rng, response(truth, force, fs, times, "avav"), 0.01)
    kinds = ["acceleration", "velocity", "acceleration", "velocity"]
    options = {"sensing": kinds} if told else {}
    return shown(truth, fs, measured(rng, sampled(force, fs, times), 0.01), y, options)


def close_pair(seed: int) -> Record:
    """Two modes 1.5 half-power widths apart, bending and torsion, and one further off; ambient."""
    rng = np.random.default_rng([7, seed])
    fs, times = 100.0, 8
    zeta = 0.01
    hz = np.array([8.0, 8.0 * (1 + 1.5 * 2 * zeta), 17.0])
    shapes = np.array([[1.0, 0.9, 0.5, 0.6], [1.0, -0.9, 0.6, -0.5], [0.7, 0.6, -1.0, -0.9]]).T
    truth = Truth(hz, np.full(3, zeta), rng.standard_normal((3, 6)), shapes)
    force = coloured(rng, int(240 * fs * times), fs * times, 2.0, 30.0, 6)
    y = response(truth, force, fs, times)
    return shown(truth, fs, None, measured(rng, y, 0.02))


def short_decay(seed: int) -> Record:
    """What follows a hit for 2.5 s, force not measured; the first mode decays by a tenth of an e a period."""
    rng = np.random.default_rng([8, seed])
    fs, times = 1000.0, 8
    hz = np.array([36.25, 98.0, 171.0, 263.0])
    shapes = rng.uniform(0.3, 1, (3, 4)) * rng.choice([-1.0, 1.0], (3, 4))
    truth = Truth(hz, np.array([0.0035, 0.003, 0.005, 0.004]), rng.uniform(0.5, 1, (4, 1)), shapes)
    force = hits(int(2.55 * fs * times), fs * times, [0.03], 0.003, rng)
    y = response(truth, force, fs, times)[50:]
    return shown(truth, fs, None, measured(rng, y, 0.005))


def short_hit(seed: int) -> Record:
    """One hit, 0.3 s in all."""
    rng = np.random.default_rng([9, seed])
    fs, times = 12000.0, 8
    hz = np.array([310.0, 742.0, 1180.0, 1905.0])
    truth = Truth(
        hz,
        np.array([0.008, 0.006, 0.007, 0.005]),
        rng.uniform(0.5, 1, (4, 1)),
        rng.uniform(0.4, 1, (2, 4)) * rng.choice([-1.0, 1.0], (2, 4)),
    )
    force = hits(int(0.3 * fs * times), fs * times, [0.01], 0.0004, rng)
    u, y = sampled(force, fs, times), response(truth, force, fs, times)
    return shown(truth, fs, measured(rng, u, 0.002), measured(rng, y, 0.005))


HUM_HZ, PICKUP_HZ = 50.0, 80.0  # of disturbed(): the mains, and a fifth of the rate


def disturbed(seed: int) -> Record:
    """A shaker test with hum of the mains in every sensor, and a line at a fifth of the rate in the second alone."""
    rng = np.random.default_rng([10, seed])
    fs, times = 5 * PICKUP_HZ, 8
    hz = np.array([21.0, 46.0, 103.0])
    truth = Truth(
        hz,
        np.array([0.01, 0.008, 0.007]),
        rng.uniform(0.5, 1, (3, 1)),
        rng.uniform(0.4, 1, (3, 3)) * rng.choice([-1.0, 1.0], (3, 3)),
    )
    force = coloured(rng, int(25 * fs * times), fs * times, 5.0, 140.0)
    y = response(truth, force, fs, times)
    t = np.arange(len(y)) / fs
    spread = y.std(0)
    y += 0.3 * spread * np.sin(2 * np.pi * HUM_HZ * t)[:, None] * [1.0, 0.7, 0.8]
    y[:, 1] += 0.3 * spread[1] * np.sin(2 * np.pi * PICKUP_HZ * t + 1)
    return shown(truth, fs, measured(rng, sampled(force, fs, times), 0.01), measured(rng, y, 0.01))


def noise(with_input: bool, seed: int) -> Record:
    """Sensors on nothing: white noise with a slow drift, behind the filter; the input has no effect."""
    rng = np.random.default_rng([11, seed])
    fs, times, count = 200.0, 4, int(60 * 200.0 * 4)
    y = rng.standard_normal((count, 3)) + coloured(rng, count, fs * times, 0.05, 0.5, 3)
    u = measured(rng, sampled(coloured(rng, count, fs * times, 2.0, 60.0), fs, times), 0.01) if with_input else None
    return Record(u, measured(rng, sampled(y, fs, times), 0.01), fs, np.zeros(0), np.zeros(0), np.zeros((3, 0)))


def weak_modes(seed: int) -> Record:
    """Loud modes beside weak ones, which a model has at one order and loses at the next: less a block they went."""
    rng = np.random.default_rng([12, seed])
    fs, times = 200.0, 8
    hz = np.array([6.1, 14.8, 19.3, 31.7, 44.0, 58.5])
    size = np.array([1.0, 0.12, 0.8, 0.1, 0.6, 0.15])
    shapes = rng.uniform(0.4, 1, (3, 6)) * rng.choice([-1.0, 1.0], (3, 6))
    truth = Truth(
        hz, np.array([0.01, 0.012, 0.008, 0.01, 0.012, 0.009]), size[:, None] * rng.uniform(0.7, 1.3, (6, 5)), shapes
    )
    force = coloured(rng, int(120 * fs * times), fs * times, 1.0, 70.0, 5)
    y = response(truth, force, fs, times)
    return shown(truth, fs, None, measured(rng, y, 0.03))


KINDS: dict[str, Callable[[int], Record]] = {
    "plate, three hits at 4 kHz": lambda seed: plate(4000.0, 6.0, [0.1, 2.1, 4.1], seed),
    "plate, one hit at 48 kHz": lambda seed: plate(48000.0, 1.0, [0.02], seed),
    "rod, hardly damped": rod,
    "bridge, one sensor": bridge,
    "building in an earthquake": building,
    "mixed sensors, told": lambda seed: mixed(True, seed),
    "mixed sensors, not told": lambda seed: mixed(False, seed),
    "close pair": close_pair,
    "short free decay": short_decay,
    "hit of 0.3 s": short_hit,
    "hum and pick-up": disturbed,
    "noise, ambient": lambda seed: noise(False, seed),
    "noise with an input": lambda seed: noise(True, seed),
    "weak modes": weak_modes,
}
