# SPDX-License-Identifier: MIT
"""Kinds of tests with random excitation that is not measured: wind, traffic, waves, walkers, machines."""

from __future__ import annotations

from functools import partial

import numpy as np
from scipy.linalg import eigh
from scipy.signal import lfilter
from simulate import FIR, TAU, Dice, Kind, Real, Record, beam, falloff, flat, jitter, modal_responses, noise, rotated


def tower(dice: Dice) -> Record:
    """Wind turbine, harmonics of a slowly varying rotor in wind; 2 levels x 2 directions, 25 Hz, 20 min."""
    record = Record(25.0, 1200, 8, 0.40, 6, ambient=True)
    stiffness, mass, tip = jitter(dice, 1.9e11, 0.1), jitter(dice, 3200, 0.05), jitter(dice, 1.9e5, 0.05)
    f, shapes, _ = beam(24, 80, stiffness, mass, "clamped", "free", tip=tip, modes=4)
    split = 1 + dice.uniform(0.012, 0.03)  # side to side is near fore and aft, which the rotor damps
    f = np.concatenate([f, f * split * np.array([1, 1.03, 1.05, 1.04])])
    fore_and_aft = [dice.uniform(0.05, 0.08), 0.015, 0.01, 0.01]
    zeta = np.array([*fore_and_aft, dice.uniform(0.006, 0.012), 0.008, 0.008, 0.009])
    sensors = rotated(shapes, [24, 14], dice.uniform(0.2, 0.6))
    heights = np.linspace(0, 80, 25)
    along = record.noise_along(dice, falloff(0.05), heights, 25)
    across = record.noise_along(dice, falloff(0.05), heights, 25)
    along[:, -1] += 40 * record.noise(dice, falloff(0.03))[:, 0]
    across[:, -1] += 12 * record.noise(dice, falloff(0.03))[:, 0]
    along *= 4e3
    across *= 3e3
    record.add_modes(f, zeta, np.hstack([along @ shapes, across @ shapes]), sensors)

    turns = 0.205 + 0.006 * record.noise(dice, falloff(0.008, 4, level=100))[:, 0]  # per second
    angle = TAU * np.cumsum(turns) / record.fine_rate
    gust = 1 + 0.3 * record.noise(dice, falloff(0.02, 2, level=20))[:, 0]
    rotor = np.zeros(record.fine_samples)
    for harmonic, level, phase in ((1, 500, 0.3), (3, 2500, 1.0), (6, 1400, 2.0), (9, 700, 0.4)):
        rotor = rotor + level * gust * np.sin(harmonic * angle + phase)
    later = 0.5 * np.roll(rotor, int(0.4 * record.fine_rate))
    record.disturb(f, zeta, np.hstack([np.outer(rotor, shapes[-1]), np.outer(later, shapes[-1])]), sensors)
    return record.finish(dice, 1e-4, 16)


def footbridge(dice: Dice) -> Record:
    """Single span in wind, walkers each at a step rate of their own; 3 accelerometers, 100 Hz, 10 min."""
    record = Record(100.0, 600, 4, 0.40, FIR, ambient=True)
    span, mass = 36.0, 1400.0
    first, torsion = dice.uniform(2.3, 3.0), dice.uniform(4.3, 5.4)
    bending, twisting = np.arange(1, 5), np.arange(1, 6)
    lateral = [dice.uniform(3.2, 3.8), dice.uniform(11.5, 13)]
    f = first * bending**2 * (1 - 0.01 * bending)
    f = np.concatenate([f, torsion * twisting * (1 + 0.02 * np.arange(5)), lateral])
    f = jitter(dice, f, 0.01)
    zeta = dice.uniform(0.004, 0.012, len(f))
    unit = np.sqrt(2 / (mass * span))

    def shape(along: Real | float, side: float) -> Real:
        """All modes at a place: along the span in metres, side from -1 to 1."""
        place = np.asarray(along)
        columns = [unit * np.sin(k * np.pi * place / span) for k in bending]
        columns += [1.3 * unit * side * np.sin(k * np.pi * place / span) for k in twisting]
        columns += [0.12 * unit * side * np.sin(k * np.pi * place / span) for k in (1, 2)]
        return np.stack(columns, -1)

    sensors = np.stack([shape(span * 0.27, 0.9), shape(span * 0.5, -0.9), shape(span * 0.41, 0.9)])
    places = np.linspace(0.05, 0.95, 12) * span
    forces = np.zeros((record.fine_samples, len(f)))
    for side in (-0.8, 0.8):
        wind = record.noise_along(dice, falloff(2, 1.2), places, 8) * 6.0
        for place, column in zip(places, wind.T, strict=True):
            forces += np.outer(column, shape(place, side))
    record.add_modes(f, zeta, forces, sensors)

    walkers = np.zeros((record.fine_samples, len(f)))
    at = 5.0
    while at < 560:
        for _ in range(dice.integers(1, 4)):
            speed, rate, weight = dice.normal(1.35, 0.12), dice.normal(1.88, 0.13), dice.normal(740, 90)
            start, side = at + dice.uniform(0, 2), dice.uniform(-0.6, 0.6)
            on = np.flatnonzero((record.time >= start) & (record.time < start + span / speed))
            unsteady = noise(dice, len(on), record.fine_rate, falloff(0.8, 2))[:, 0]
            angle = TAU * np.cumsum(rate * (1 + 0.03 * unsteady)) / record.fine_rate
            step = 0.37 * np.sin(angle) + 0.1 * np.sin(2 * angle + 1.6)
            step = weight * (step + 0.08 * np.sin(3 * angle + 1.6) + 0.04 * np.sin(4 * angle))
            if dice.random() < 0.5:
                step = -step
            walkers[on] += step[:, None] * shape(speed * (record.time[on] - start), side)
        at += dice.exponential(25)
    record.disturb(f, zeta, walkers, sensors)
    return record.finish(dice, 3e-5, 16)


def cable(dice: Dice) -> Record:
    """Stay cable of 25 harmonic modes and two of the deck, in wind; 1 accelerometer, 50 Hz, 10 min."""
    record = Record(50.0, 600, 8, 0.42, FIR, ambient=True)
    n = np.arange(1, 26)
    f = dice.uniform(0.85, 1.35) * n * np.sqrt(1 + 4e-4 * n**2)
    f[0] *= 1.02  # sag
    zeta = dice.uniform(0.0015, 0.004) * (0.8 + 0.4 * dice.random(25))
    places = np.linspace(0.04, 0.96, 30)
    wind = record.noise_along(dice, falloff(1.5, 0.8), places, 0.15) @ np.sin(np.pi * np.outer(places, n))
    f = np.concatenate([f, [dice.uniform(0.4, 0.5), dice.uniform(2.6, 3.0)]])
    zeta = np.concatenate([zeta, [0.012, 0.01]])
    deck = record.noise(dice, falloff(0.3), 2) * 1.5
    sensor = np.hstack([np.sin(np.pi * 0.045 * n)[None], [[0.5, 0.25]]])
    record.add_modes(f, zeta, np.hstack([wind, deck]), sensor)
    return record.finish(dice, 0.008, 16)


def building(dice: Dice) -> Record:
    """12 eccentric storeys of 3 degrees of freedom in wind, close pairs; 2 levels x 3 sensors, 20 Hz, 30 min."""
    record = Record(20.0, 1800, 8, 0.40, 8, ambient=True)
    storeys, mass, long, wide = 12, 4e5, 24.0, 22.0
    inertia = mass * (long * long + wide * wide) / 12
    kx = jitter(dice, 9.0e8, 0.03) * np.linspace(1.2, 0.8, storeys)
    ky = kx * dice.uniform(1.02, 1.05)
    ex, ey = dice.uniform(0.4, 0.9), dice.uniform(-0.8, -0.3)
    kt = kx * (inertia / mass) * dice.uniform(1.35, 1.5)
    masses = np.kron(np.eye(storeys), np.diag([mass, mass, inertia]))
    stiffness = np.zeros((3 * storeys, 3 * storeys))
    for i in range(storeys):
        one = np.array([[kx[i], 0, -kx[i] * ey], [0, ky[i], ky[i] * ex], [-kx[i] * ey, ky[i] * ex, kt[i]]])
        here, below = slice(3 * i, 3 * i + 3), slice(3 * i - 3, 3 * i)
        stiffness[here, here] += one
        if i:
            stiffness[below, below] += one
            stiffness[below, here] -= one
            stiffness[here, below] -= one
    squares, vectors = eigh(stiffness, masses)
    f = np.sqrt(squares) / TAU
    kept = f < 14
    f, vectors = f[kept], vectors[:, kept]
    zeta = dice.uniform(0.008, 0.018, len(f))
    sensors = []
    for floor in (11, 6):
        x, y, turn = vectors[3 * floor], vectors[3 * floor + 1], vectors[3 * floor + 2]
        sensors += [x - 9 * turn, y - 10 * turn, y + 10 * turn]
    heights = np.arange(storeys) * 3.3
    wind = np.zeros((record.fine_samples, 3 * storeys))
    for direction, (level, length) in enumerate(((1, 20), (0.8, 20), (4.0, 15))):
        wind[:, direction::3] = level * record.noise_along(dice, falloff(0.3, 1.3), heights, length)
    record.add_modes(f, zeta, wind @ vectors * 5e3, np.array(sensors))
    return record.finish(dice, 1.2e-5, 24)


def compressor(dice: Dice) -> Record:
    """Pipe with flow noise, compressor harmonics ten times the ambient level; 5 accelerometers, 512 Hz, 180 s."""
    record = Record(512.0, 180, 6, 0.42, FIR, ambient=True)
    speed = 24.7

    def plane(support_1: float, support_2: float) -> tuple[Real, Real]:
        stiffness = jitter(dice, 1.1e6, 0.05)
        springs = [(14, jitter(dice, support_1, 0.1)), (27, jitter(dice, support_2, 0.1))]
        return beam(40, 12, stiffness, 42, "clamped", "pinned", springs=springs, modes=8)[:2]

    f1, shapes1 = plane(6e5, 5e5)
    f2, shapes2 = plane(2e5, 3e5)
    f = np.concatenate([f1, f2])
    zeta = dice.uniform(0.006, 0.02, len(f))
    at, direction = [6, 11, 19, 24, 33], np.array([1, 0.3, 0.9, 0.2, 1.0])
    sensors = np.hstack([shapes1[at] * direction[:, None], shapes2[at] * np.sqrt(1 - 0.9 * direction**2)[:, None]])
    places = np.linspace(0, 12, 41)
    flow = [record.noise_along(dice, falloff(80, 1.5), places, 0.6) @ shapes for shapes in (shapes1, shapes2)]
    record.add_modes(f, zeta, np.hstack(flow), sensors)

    unsteady = record.noise(dice, falloff(0.05, 2, level=30))[:, 0]
    angle = TAU * np.cumsum(speed * (1 + 4e-4 * unsteady)) / record.fine_rate
    machine = np.zeros(record.fine_samples)
    for harmonic, level in enumerate([1, 2, 0.5, 0.8, 0.3, 0.4, 0.2, 0.3, 0.1, 0.15], 1):
        machine = machine + level * np.sin(harmonic * angle + dice.uniform(0, TAU))
    machine *= 1 + 0.05 * record.noise(dice, falloff(0.1, 2, level=10))[:, 0]
    forces = [np.outer(machine, shapes1[3] + 0.3 * shapes1[38]), np.outer(machine, 0.6 * shapes2[3])]
    record.disturb(f, zeta, np.hstack(forces), sensors)
    ambient = record.response()
    record.disturbance = record.disturbance * 10 * np.median(ambient.std(0)) / np.median(record.disturbance.std(0))
    record.tones = [speed * k for k in range(1, 11)]
    return record.finish(dice, 0.02 * ambient.std() / np.sqrt(256), 24)


def ship(dice: Dice) -> Record:
    """Hull girder in waves, whose peak near 0.1 Hz is no mode, with slamming; 6 accelerometers, 10 Hz, 30 min."""
    record = Record(10.0, 1800, 8, 0.40, 4, ambient=True)
    f, shapes, _ = beam(40, 180, 1.0, 1.0, modes=6)
    f = f / f[0] * dice.uniform(0.62, 0.75) * np.array([1, 0.88, 0.80, 0.73, 0.67, 0.62])
    f = np.concatenate([f, [dice.uniform(1.0, 1.15), dice.uniform(1.9, 2.2)]])
    zeta = np.concatenate([dice.uniform(0.008, 0.016, 6), [0.012, 0.014]])
    x = np.linspace(0, 1, 41)
    twist = np.stack([np.cos(np.pi * x), np.cos(2 * np.pi * x)], 1) * 0.5 * np.abs(shapes).max()
    at, side = [0, 6, 14, 21, 30, 40], np.array([1, -1, 1, -1, 1, -1])
    sea = record.noise_along(dice, falloff(0.5, 1.5), x, 0.1)
    rolling = record.noise_along(dice, falloff(0.5, 1.5), x, 0.1)
    for _ in range(25):
        start = dice.uniform(0, 1790)
        on = (record.time > start) & (record.time < start + 0.4)
        slam = np.where(on, np.sin(np.pi * (record.time - start) / 0.4), 0)
        sea[:, -3:] += (60 * dice.exponential() * slam)[:, None]
    sensors = np.hstack([shapes[at], twist[at] * side[:, None]])
    record.add_modes(f, zeta, np.hstack([sea @ shapes, 0.7 * rolling @ twist]), sensors)

    peak = dice.uniform(0.085, 0.11)

    def jonswap(f: Real) -> Real:
        width = np.where(f < peak, 0.07, 0.09)
        bump = 3.3 ** np.exp(-((f - peak) ** 2) / (2 * (width * peak) ** 2))
        return np.asarray(f**-5.0 * np.exp(-1.25 * (peak / f) ** 4) * bump * peak**5)

    heave, pitch = record.noise(dice, jonswap, 2).T
    pitch = pitch + 0.3 * np.roll(heave, int(2 * record.fine_rate))
    rigid = record.sampled(np.outer(heave, np.ones(6)) + np.outer(pitch, 2 * x[at] - 1))
    ambient = record.response().std()
    record.disturbance = rigid * 3 * ambient / rigid.std()
    return record.finish(dice, 0.02 * ambient / np.sqrt(5), 16)


def strain(dice: Dice) -> Record:
    """Offshore mast in wind, quasi-static part and thermal drift; 4 strain gauges, 50 Hz, 15 min."""
    record = Record(50.0, 900, 8, 0.40, 6, ambient=True, quantity="d")
    f, shapes, slopes = beam(32, 42, jitter(dice, 3.2e8, 0.1), 420, "clamped", "free", tip=2500, modes=5)
    f = np.concatenate([f, f * dice.uniform(1.03, 1.07)])
    zeta = dice.uniform(0.006, 0.016, 10)
    curvature = np.gradient(slopes, 42 / 32, axis=0) * 0.5e6  # micro strain
    gauges = []
    for level, angle in ((1, 0.1), (1, 1.6), (12, 0.2), (12, 1.7)):
        gauges.append(np.concatenate([curvature[level] * np.cos(angle), curvature[level] * np.sin(angle)]))
    heights = np.linspace(0, 42, 33)
    wind = [record.noise_along(dice, falloff(0.08, 1.9), heights, 10) @ shapes for _ in range(2)]
    record.add_modes(f, zeta, np.hstack(wind) * 60, np.array(gauges))
    ambient = record.response().std()
    walk = np.cumsum(dice.standard_normal((record.samples, 4)), axis=0) * 0.004 * ambient
    day = ambient * 2 * np.sin(TAU * np.arange(record.samples) / record.samples * 0.4)
    record.disturbance = walk + day[:, None]
    return record.finish(dice, 0.01 * ambient / np.sqrt(25), 16)


def railbridge(dice: Dice) -> Record:
    """Two-span rail bridge, 6 trains of moving axle loads, weak wind between; 4 accelerometers, 200 Hz, 300 s."""
    record = Record(200.0, 300, 5, 0.42, FIR, ambient=True)
    length = 50.0
    pier = [(24, 5e9)]
    f, shapes, _ = beam(50, length, jitter(dice, 2.4e10, 0.05), 9000, "pinned", "pinned", springs=pier, modes=9)
    f = np.concatenate([f, dice.uniform(7.5, 9.0) * np.array([1, 1.12, 2.1, 2.35, 3.3])])
    x = np.linspace(0, length, 51)
    twist = np.stack([np.sin(k * np.pi * x / length) for k in range(1, 6)], 1) * np.abs(shapes).max() * 0.8
    zeta = dice.uniform(0.005, 0.02, len(f))
    at, side = [9, 15, 33, 41], np.array([1, -1, 1, 1])
    wind = [record.noise_along(dice, falloff(5, 1.0), x, 5) @ modes for modes in (shapes, twist)]
    forces = np.hstack(wind) * 60

    def roughness(f: Real) -> Real:
        return np.asarray(0.05 * np.exp(-((f - 4) ** 2) / 9) + 0.012 / (1 + (f / 25) ** 2))

    for train in range(6):
        start = 12 + 48 * train + 8 * dice.random()
        speed = dice.uniform(18, 32) * dice.choice([-1, 1])
        eccentric = 0.35 * np.sign(speed)
        for car in range(dice.integers(3, 7)):
            for axle in (0, 2.5, 17, 19.5):
                run = (record.time - start - (car * 25 + axle) / abs(speed)) * abs(speed)
                on = np.flatnonzero((run >= 0) & (run <= length))
                place = run[on] if speed > 0 else length - run[on]
                load = 1.1e5 * dice.uniform(0.8, 1.2)
                loads = load * (1 + 0.10 * noise(dice, len(on), record.fine_rate, roughness)[:, 0] * 3)
                for k, mode in enumerate(shapes.T):
                    forces[on, k] += loads * np.interp(place, x, mode)
                for k, mode in enumerate(twist.T, shapes.shape[1]):
                    forces[on, k] += eccentric * loads * np.interp(place, x, mode)
    record.add_modes(f, zeta, forces, np.hstack([shapes[at], twist[at] * side[:, None]]))
    return record.finish(dice, 3e-4, 16)


def chimney(dice: Dice) -> Record:
    """Steel chimney in wind, vortex lock-in of one mode for a time; 2 levels x 2 directions, 20 Hz, 20 min."""
    record = Record(20.0, 1200, 8, 0.40, FIR, ambient=True)
    f, shapes, _ = beam(24, 60, jitter(dice, 9e9, 0.08), 900, "clamped", "free", tip=300, modes=4)
    f = f / f[0] * dice.uniform(0.40, 0.6) * np.array([1, 0.92, 0.85, 0.8])
    f = np.concatenate([f, f * (1 + dice.uniform(0.012, 0.03))])
    zeta = dice.uniform(0.004, 0.010, 8)
    sensors = rotated(shapes, [23, 13], dice.uniform(0.15, 0.4))
    heights = np.linspace(0, 60, 25)
    wind = [record.noise_along(dice, falloff(0.1, 1.5), heights, 15) @ shapes for _ in range(2)]
    forces = np.hstack(wind) * 200
    record.add_modes(f, zeta, forces, sensors)
    begin, end = dice.uniform(250, 400), dice.uniform(750, 950)
    locked = record.parts[4]
    locked.coordinates = record.sampled(lock_in(record, f[4], zeta[4], forces[:, 4], begin, end)[:, None])
    locked.damping_known = False
    return record.finish(dice, 2e-4, 16)


def lock_in(record: Record, f: float, zeta: float, force: Real, begin: float, end: float) -> Real:
    """Modal acceleration with the negative aerodynamic damping of Vickery and Basu from begin to end."""
    omega, step = TAU * f, record.step
    still = modal_responses(np.array([f]), np.array([zeta]), force[:, None], step, "d")
    limit = 8 * float(np.std(still))
    out = np.empty(record.fine_samples)
    place = speed = mean_square = 0.0
    for i in range(record.fine_samples):
        mean_square += step * omega / 20 * (place * place - mean_square)
        aerodynamic = 1.6 * zeta * (1 - 2 * mean_square / limit**2) if begin < i * step < end else 0.0
        damping = zeta - max(float(aerodynamic), -4 * zeta)
        out[i] = force[i] - omega * omega * place - 2 * omega * damping * speed
        speed += step * out[i]
        place += step * speed
    return out


def badsensors(dice: Dice) -> Record:
    """Frame in a hall; of 6 accelerometers one hums, one drifts, one clips, one is dead; 512 Hz, 240 s."""
    record = Record(512.0, 240, 5, 0.42, FIR, ambient=True)
    rate, modes, humming, drifting, clipping, dead = 512, 11, 1, 3, 4, 5
    f = np.sort(dice.uniform(5, 150, modes))
    f = f[0] + np.cumsum(np.maximum(np.diff(f, prepend=f[0]), 2.0)) - 2.0
    zeta = dice.uniform(0.005, 0.015, modes)
    sensors, places = dice.standard_normal((6, modes)), dice.standard_normal((4, modes))
    record.add_modes(f, zeta, record.noise(dice, falloff(60, 1.0), 4) @ places, sensors)
    ambient = record.response().std(0)

    def damage(dice: Dice, y: Real) -> Real:
        t = np.arange(len(y)) / rate
        hum = 1.5 * np.sin(TAU * 50.01 * t) + 0.6 * np.sin(TAU * 150.03 * t + 1)
        y[:, humming] += ambient[humming] * hum
        walk = np.cumsum(dice.standard_normal(len(y))) * 0.02 * ambient[drifting]
        y[:, drifting] += walk + 4 * ambient[drifting] * (t > 140)
        limit = np.quantile(np.abs(y[:, clipping]), 0.985)
        y[:, clipping] = np.clip(y[:, clipping], -limit, limit)
        y[:, dead] = 0.001 * ambient[dead] * dice.standard_normal(len(y))
        return y

    record.damage = damage
    record.tones = [50.01, 150.03]
    for part in record.parts:
        part.shape = part.shape.copy()
        part.shape[dead] = 0
    return record.finish(dice, 0.02 * ambient.mean() / np.sqrt(256), 16)


def truck(dice: Dice) -> Record:
    """Truck chassis on a road that the rear axle sees later, speed varies; 6 accelerometers, 200 Hz, 150 s."""
    record = Record(200.0, 150, 6, 0.42, FIR, ambient=True)
    ride = [1.3, 1.8, 2.4, 10.5, 11.8]  # body and axles
    f = jitter(dice, [*ride, 6.8, 9.4, 14.8, 19.7, 24.5, 31.0, 38.5, 47.0, 56, 66], 0.03)
    zeta = np.concatenate([[0.22, 0.25, 0.2, 0.11, 0.12], dice.uniform(0.010, 0.03, 10)])
    sensors, wheels = dice.standard_normal((6, 15)), dice.standard_normal((4, 15))
    sensors[:, :3] *= 0.7
    speed = 16 + 5 * np.sin(TAU * record.time / 90 + dice.uniform(0, 6)) + 2 * np.sin(TAU * record.time / 23)
    speed = np.clip(speed, 6, 30)
    place, spacing, wheelbase = np.cumsum(speed) / record.fine_rate, 0.02, 4.2
    points = int(place[-1] / spacing) + 800
    tracks = [lfilter([1], [1, -0.985], dice.standard_normal(points)) for _ in range(2)]
    grid = np.arange(points) * spacing
    heights = [np.interp(place + ahead, grid, track) for track in tracks for ahead in (wheelbase, 0.0)]
    road = np.vstack([np.diff(np.stack(heights, 1), axis=0), np.zeros((1, 4))]) * record.fine_rate
    record.add_modes(f, zeta, road @ wheels, sensors)
    ambient = record.response().std()
    engine = 0.3 * ambient * np.sin(TAU * np.cumsum(27.3 * (speed / 16) ** 0.3) / record.fine_rate)
    record.disturbance = record.sampled(engine[:, None] * np.ones(6))
    return record.finish(dice, 0.01 * ambient / np.sqrt(100), 16)


def phone(dice: Dice) -> Record:
    """Small bridge, logger of 12 bit at +-2 g with a weak filter; 2 accelerometers, 100 Hz, 20 min."""
    record = Record(100.0, 1200, 5, 0.35, 2, ambient=True)
    f = jitter(dice, [3.1, 4.0, 7.7, 10.9, 13.2, 18.1, 23.0, 29.0, 38.0, 58.0, 71.0], 0.03)
    zeta = dice.uniform(0.008, 0.02, len(f))
    sensors, places = dice.standard_normal((2, len(f))), dice.standard_normal((3, len(f)))
    record.add_modes(f, zeta, record.noise(dice, falloff(5, 1.2), 3) @ places, sensors)
    gain = 0.06 / record.response().std()  # to 0.06 m/s2
    for part in record.parts:
        part.coordinates = part.coordinates * gain
    record.full_scale = 19.6
    return record.finish(dice, 2.2e-3, 12)


def pair(dice: Dice, widths: float, zeta: float = 0.01, forced: bool = False, mac: float = 1.0) -> Record:
    """Two modes of one shape at the sensors beside two others; 3 outputs, 50 Hz, 10 min, or 60 s with 1 force.

    The frequencies of the two are `widths` half-power widths (2 zeta f) apart, their shapes have this MAC.
    """
    record = Record(50.0, 60 if forced else 600, 6, 0.42, FIR, ambient=not forced)
    outputs, modes = 3, 4
    middle = dice.uniform(7, 9)
    f = np.array([3.1, middle, middle * (1 + 2 * zeta * widths), 17.0])
    sensors = dice.standard_normal((outputs, modes))
    one = sensors[:, 1] / np.linalg.norm(sensors[:, 1])
    other = dice.standard_normal(outputs)
    other -= one * (one @ other)
    other /= np.linalg.norm(other)
    sensors[:, 1], sensors[:, 2] = one, np.sqrt(mac) * one + np.sqrt(1 - mac) * other
    forces = record.noise(dice, flat(-1.0, np.inf), 1 if forced else 4)
    places = dice.standard_normal((forces.shape[1], modes))
    places /= np.linalg.norm(places, axis=0)
    if forced:
        record.forces = forces
    record.add_modes(f, np.array([0.01, zeta, zeta, 0.012]), forces @ places, sensors)
    return record.finish(dice, 0.03 * record.response().std() / 5, 16)


KINDS = {
    "tower": Kind(0, tower),
    "footbridge": Kind(1, footbridge),
    "cable": Kind(2, cable),
    "building": Kind(8, building),
    "compressor": Kind(9, compressor),
    "ship": Kind(10, ship),
    "strain": Kind(14, strain),
    "railbridge": Kind(15, railbridge),
    "chimney": Kind(16, chimney),
    "badsensors": Kind(17, badsensors),
    "truck": Kind(18, truck),
    "phone": Kind(20, phone),
}
PAIRS = {  # small kinds that reproduce what two close modes of one shape do; with f a measured force, with m less MAC
    "pair1.5": Kind(22, partial(pair, widths=1.5)),
    "pair2.5": Kind(23, partial(pair, widths=2.5)),
    "pair4": Kind(24, partial(pair, widths=4)),
    "pair6": Kind(25, partial(pair, widths=6)),
    "fpair1.5": Kind(26, partial(pair, widths=1.5, zeta=0.02, forced=True)),
    "fpair2.5": Kind(27, partial(pair, widths=2.5, zeta=0.02, forced=True)),
    "fpair4": Kind(28, partial(pair, widths=4, zeta=0.02, forced=True)),
    "mpair97": Kind(29, partial(pair, widths=2.5, mac=0.97)),
    "mpair90": Kind(30, partial(pair, widths=2.5, mac=0.90)),
}
