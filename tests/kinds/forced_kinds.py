# SPDX-License-Identifier: MIT
"""Kinds of tests with a force that is made: shakers, hammers, a shake table; or a release or impacts, unmeasured."""

from __future__ import annotations

import numpy as np
from scipy.linalg import eigh
from simulate import (
    FIR,
    TAU,
    Dice,
    Kind,
    Part,
    Real,
    Record,
    beam,
    falloff,
    flat,
    jitter,
    modal_responses,
    noise,
    respond,
    rotated,
)


def smoothed(gate: Real, samples: int) -> Real:
    """The edges of a gate ramped."""
    return np.convolve(gate, np.ones(samples) / samples, "same")


def carbody(dice: Dice) -> Record:
    """Trimmed car body, 12 bursts of random force, dense damped modes; 1 force, 12 accelerometers, 512 Hz, 48 s."""
    record = Record(512.0, 48, 6, 0.42, FIR, ambient=False)
    record.excited = (14, 195)
    grown = [22.0]
    while grown[-1] < 330:
        grown.append(grown[-1] + max(3.0, dice.normal(0.075 * grown[-1], 0.02 * grown[-1])))
    f = np.array(grown)
    zeta = dice.uniform(0.02, 0.04, len(f))
    kx, ky = dice.integers(1, 5, len(f)), dice.integers(1, 5, len(f))
    phase = dice.uniform(0, TAU, (len(f), 2))

    def shape(x: Real | float, y: Real | float) -> Real:
        along = np.cos(np.multiply.outer(x, kx) * 2.2 + phase[:, 0])
        return np.asarray(along * np.cos(np.multiply.outer(y, ky) * 1.8 + phase[:, 1]) / 15)

    x, y = dice.uniform(0, 1, 12), dice.uniform(0, 1, 12)
    force = record.noise(dice, flat(12, 200, level=4.0))
    bursts = smoothed(((record.time % 4) < 2.6) * 1.0, int(0.1 * record.fine_rate))
    record.forces = force * bursts[:, None] * 5
    record.add_modes(f, zeta, record.forces @ shape(0.1, 0.15)[None], shape(x, y))
    return record.finish(dice, 2e-3, 16, input_noise=2e-4)


def sweep(dice: Dice) -> Record:
    """Portal frame, log sweep 5-250 Hz, force distorted and less at resonances; 1 force, 4 outputs, 1000 Hz, 105 s."""
    record = Record(1000.0, 105, 6, 0.40, 8, ambient=False)
    record.excited = (5.5, 240)
    f1, shapes1, _ = beam(30, 3.0, jitter(dice, 3.2e4, 0.1), 14, "clamped", "pinned", modes=7)
    f2, shapes2, _ = beam(30, 2.2, jitter(dice, 1.6e4, 0.1), 9, "clamped", "clamped", modes=5)
    f = np.concatenate([f1, f2])
    zeta = dice.uniform(0.003, 0.012, len(f))
    second = dice.uniform(0.15, 0.5, (4, 2))[:, :1]
    sensors = np.hstack([shapes1[[6, 11, 19, 26]], shapes2[[7, 13, 16, 22]] * second])
    shaker = np.concatenate([shapes1[8], 0.35 * shapes2[10]])

    low, high, start, length = 5.0, 250.0, 2, 100.0
    time = np.clip(record.time - start, 0, length)
    growth = np.log(high / low)
    angle = TAU * low * length / growth * (np.exp(time / length * growth) - 1)
    now = low * np.exp(time / length * growth)
    drop = np.ones(record.fine_samples)
    strong = np.abs(shaker) > 0.5 * np.abs(shaker).max()
    for k in np.flatnonzero(strong):
        drop *= 1 - 0.6 / (1 + ((now - f[k]) / (0.02 * f[k])) ** 2)
    on = ((record.time > start) & (record.time < start + length)) * 1.0
    gate = smoothed(on, int(0.2 * record.fine_rate))
    force = np.sin(angle) + 0.03 * np.sin(2 * angle + 0.4) + 0.02 * np.sin(3 * angle)
    record.forces = (20 * gate * drop * force)[:, None]
    record.add_modes(f, zeta, record.forces @ shaker[None], sensors)
    return record.finish(dice, 2e-3, 16, input_noise=3e-4)


def twoshakers(dice: Dice) -> Record:
    """Steel frame with a close pair, two partly coherent random forces; 2 forces, 6 outputs, 400 Hz, 60 s."""
    record = Record(400.0, 60, 6, 0.42, FIR, ambient=False)
    f = np.sort(np.concatenate([[dice.uniform(11, 14)], dice.uniform(18, 145, 9), [190, 240]]))
    f[4] = f[3] * 1.012
    f = np.sort(f)
    for i in range(1, len(f)):
        if i != 4 and f[i] / f[i - 1] < 1.03:
            f[i:] *= 1.03 * f[i - 1] / f[i]
    zeta = dice.uniform(0.004, 0.015, len(f))
    sensors, shakers = dice.standard_normal((6, len(f))) / 8, dice.standard_normal((2, len(f))) / 8
    shakers += sensors[:2] * 0.5
    common, first, second = record.noise(dice, flat(5, 180), 3).T
    record.forces = np.stack([8 * (0.87 * common + 0.5 * first), 6 * (0.87 * common + 0.5 * second)], 1)
    record.add_modes(f, zeta, record.forces @ shakers, sensors)
    return record.finish(dice, 3e-3, 16, input_noise=2e-4)


def casting(dice: Dice) -> Record:
    """Iron casting on foam, 3 hits and a double one, light damping, a doublet; 1 force, 2 outputs, 10240 Hz, 4.5 s."""
    record = Record(10240.0, 4.5, 6, 0.45, FIR, ambient=False)
    record.excited = (100, 1e9)
    f = np.sort(dice.uniform(600, 4000, 9))
    f = f[0] + np.cumsum(np.maximum(np.diff(f, prepend=f[0]), 0.02 * f)) - 0.02 * f[0]
    f = f[f < 4050]
    doublet = f[2] * (1 + dice.uniform(0.003, 0.006))
    f = np.sort(np.concatenate([f, [doublet, 4450, 4950, 5700]]))
    zeta = dice.uniform(0.0005, 0.002, len(f))
    sensors = dice.choice([-1, 1], (2, len(f))) * dice.uniform(0.2, 1, (2, len(f)))
    hammer = dice.choice([-1, 1], (1, len(f))) * dice.uniform(0.25, 1, (1, len(f)))
    force = np.zeros(record.fine_samples)
    for at in (0.08, 1.55, 3.05):
        force = force + record.pulse(at + 0.05 * dice.random(), 150 * dice.uniform(0.6, 1.3), 0.28)
    force += record.pulse(1.61 + 0.012 * dice.random(), 60, 0.3)
    record.forces = force[:, None]
    f = np.concatenate([f, [4.1, 6.3, 9.0]])  # on the foam
    zeta = np.concatenate([zeta, [0.06, 0.08, 0.07]])
    sensors = np.hstack([sensors, [[0.5, 0.3, 0.4], [0.4, -0.5, 0.6]]])
    record.add_modes(f, zeta, record.forces @ np.hstack([hammer, [[0.5, 0.4, 0.6]]]), sensors)
    return record.finish(dice, 2e-2, 16, input_noise=2e-4)


def lever(place: Real) -> Real:
    """Translation of a place on a rigid body (3 rows) from its 6 rigid-body motions."""
    x, y, z = place
    return np.hstack([np.eye(3), -np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])])


def mounts(dice: Dice) -> Record:
    """Machine on four rubber mounts, 5 hits, complex rigid-body modes; 1 force, 6 accelerometers, 256 Hz, 30 s."""
    record = Record(256.0, 30, 8, 0.42, FIR, ambient=False)
    mass, inertia = jitter(dice, 320.0, 0.1), jitter(dice, [22.0, 38.0, 46.0], 0.1)
    masses = np.diag([mass, mass, mass, *inertia])
    feet = np.array([[0.42, 0.3, -0.28], [0.42, -0.3, -0.28], [-0.42, 0.3, -0.28], [-0.42, -0.3, -0.28]])
    stiffness, damping = np.zeros((6, 6)), np.zeros((6, 6))
    for foot in feet + 0.03 * dice.standard_normal((4, 3)):
        rubber = np.diag(jitter(dice, [7e4, 8.5e4, 1.7e5], 0.1))
        stiffness += lever(foot).T @ rubber @ lever(foot)
        damping += lever(foot).T @ (rubber * dice.uniform(0.0024, 0.0034)) @ lever(foot)
    below = np.hstack([-np.linalg.solve(masses, stiffness), -np.linalg.solve(masses, damping)])
    poles, vectors = np.linalg.eig(np.vstack([np.hstack([np.zeros((6, 6)), np.eye(6)]), below]))
    hit = np.linalg.solve(masses, lever(np.array([0.4, 0.33, 0.3])).T @ np.array([0.5, 0.6, -0.62]))
    taken = np.linalg.solve(vectors, np.concatenate([np.zeros(6), hit]))
    vertical = [(0.45, 0.3, 0.3), (-0.45, 0.28, 0.25), (0.45, -0.3, 0.2)]
    places = [(place, 2) for place in vertical]
    places += [((0.4, 0.3, 0.3), 0), ((0.4, 0.3, -0.2), 1), ((-0.4, 0.3, 0.3), 1)]
    sensors = np.stack([lever(np.array(place))[axis] for place, axis in places])
    force = np.zeros(record.fine_samples)
    for k in range(5):
        force = force + record.pulse(1 + 5.8 * k + 0.5 * dice.random(), 1500 * dice.uniform(0.7, 1.2), 14)
    record.forces = force[:, None]
    accelerations = sensors @ below
    for i in np.argsort(np.abs(poles)):
        if poles[i].imag > 0:
            state = respond(poles[i], force, record.step) * taken[i]
            seen = accelerations @ vectors[:, i]
            coordinates = record.sampled(np.stack([state.real, state.imag], 1))
            shape = np.stack([2 * seen.real, -2 * seen.imag], 1)
            record.parts.append(Part(abs(poles[i]) / TAU, -poles[i].real / abs(poles[i]), coordinates, shape))
    direct = record.sampled(np.outer(force, sensors @ hit))
    flexible = jitter(dice, [48.0, 63.0, 88.0], 0.04)
    modal_force = force[:, None] @ dice.standard_normal((1, 3)) * 0.04
    record.add_modes(flexible, np.array([0.02, 0.025, 0.02]), modal_force, dice.standard_normal((6, 3)))
    hall = noise(dice, record.samples, record.rate, falloff(20, 2, level=4e-6), 6)
    running = 0.004 * np.sin(TAU * 24.6 * np.arange(record.samples) / record.rate)
    record.disturbance = hall + running[:, None]
    first = record.parts[0]  # what the force gives at once goes with this mode; it matters within the hits only
    first.coordinates, first.shape = np.hstack([first.coordinates, direct]), np.hstack([first.shape, np.eye(6)])
    return record.finish(dice, 5e-4, 16, input_noise=2e-4)


def aircraft(dice: Dice) -> Record:
    """Ground test of an aircraft, 2 wing shakers, random, close pairs; 2 forces, 24 accelerometers, 256 Hz, 90 s."""
    record = Record(256.0, 90, 6, 0.42, FIR, ambient=False)
    _, bending, _ = beam(40, 1, 1, 1, "clamped", "free", modes=6)
    bending = bending / np.abs(bending).max(0)
    stations, drive = np.round(np.linspace(0.2, 1, 7) * 40).astype(int), 32
    f, zeta, columns, shakers = [], [], [], []
    for k, base in enumerate([3.2, 9.5, 19.5, 31.0, 45.0, 62.0]):
        for sign, shift in ((1, 1.0), (-1, 1 + dice.uniform(0.012, 0.06))):
            f.append(base * shift * (1 + 0.02 * dice.standard_normal()))
            zeta.append(dice.uniform(0.005, 0.03))
            tail = dice.standard_normal(10) * 0.25
            wings = np.concatenate([bending[stations, k], sign * bending[stations, k]])
            columns.append(np.concatenate([wings + 0.05 * dice.standard_normal(14), tail]))
            left = bending[drive, k] + 0.03 * dice.standard_normal()
            shakers.append([left, sign * bending[drive, k] + 0.03 * dice.standard_normal()])
    weight = np.concatenate([np.full(14, 0.12), np.full(10, 0.8)])
    for _ in range(8):  # of fuselage, tail and engines
        f.append(dice.uniform(5, 70))
        zeta.append(dice.uniform(0.008, 0.03))
        columns.append(dice.standard_normal(24) * weight)
        taken = dice.uniform(0.08, 0.3)
        shakers.append([taken, taken * dice.choice([-1, 1])])
    order = np.argsort(f)
    record.forces = record.noise(dice, flat(2, 80), 2) * 10
    forces = record.forces @ np.array(shakers)[order].T
    record.add_modes(np.array(f)[order], np.array(zeta)[order], forces, np.array(columns)[order].T)
    return record.finish(dice, 0.05, 24, input_noise=1e-4)


def shaketable(dice: Dice) -> Record:
    """Cabinet on a shake table, random 4-110 Hz; accelerations of the table and of 3 places, 400 Hz, 60 s."""
    record = Record(400.0, 60, 6, 0.42, FIR, ambient=False)
    masses = jitter(dice, [40, 30, 30, 25, 12, 6], 0.1)
    k = jitter(dice, [9e5, 8e5, 7e5, 5e5, 1.6e5, 2.2e5], 0.1)
    stiffness = np.diag(k + np.append(k[1:], 0)) - np.diag(k[1:], 1) - np.diag(k[1:], -1)
    squares, vectors = eigh(stiffness, np.diag(masses))
    f = np.sqrt(squares) / TAU
    zeta = dice.uniform(0.01, 0.05, 6)

    def demand(f: Real) -> Real:
        return np.asarray(0.3 / (1 + (f / 40) ** 2) * ((f > 4) * (f < 110)))

    table = record.noise(dice, demand)
    rocking = record.noise(dice, flat(4, 110, level=1e-4))  # not measured
    share = vectors.T @ masses
    inertia = -table @ share[None] - rocking @ (vectors.T @ (masses * np.arange(1, 7) / 3))[None]
    relative = record.sampled(modal_responses(f, zeta, inertia, record.step, "a"))
    # Absolute is relative and table. That of the table is shared out by participation, whose sum over the modes is 1.
    base = record.sampled(table)
    sensors = vectors[[5, 3, 1]]
    for j in range(6):
        record.parts.append(Part(f[j], zeta[j], relative[:, [j]] + base * share[j], sensors[:, [j]]))
    record.forces = table
    return record.finish(dice, 3e-3, 16, input_noise=3e-4)


def decay(dice: Dice) -> Record:
    """Mast, rope cut at 2 s, close pairs, down to light wind; 2 accelerometers at one level, 100 Hz, 90 s."""
    record = Record(100.0, 90, 8, 0.42, FIR, ambient=False)
    f, shapes, _ = beam(24, 30, jitter(dice, 2e8, 0.1), 38, "clamped", "free", tip=60, modes=5)
    f = np.concatenate([f, f * (1 + dice.uniform(0.010, 0.025) * np.array([1, 1.1, 0.8, 0.9, 1]))])
    zeta = np.tile([0.006, 0.004, 0.005, 0.007, 0.008], 2) * dice.uniform(0.7, 1.3, 10)
    direction, turned = dice.uniform(0.5, 0.9), dice.uniform(0.2, 0.5)
    cut, pull = 2, 3000.0
    # At rest under the pull until the cut: the record is that of a step of -pull, without what is constant.
    step = pull * np.clip(1 - (record.time - cut) / 0.004, 0, 1) - pull
    forces = np.hstack([np.outer(step * part(direction), shapes[18]) for part in (np.cos, np.sin)])
    forces[record.time < cut] = 0
    heights = np.linspace(0, 30, 25)
    forces += np.hstack([record.noise_along(dice, falloff(0.2), heights, 8) @ shapes for _ in range(2)])
    record.add_modes(f, zeta, forces, rotated(shapes, [22], turned))
    return record.finish(dice, 2e-3, 16)


def floor(dice: Dice) -> Record:
    """Office floor, 9 heel drops at 3 places, neighbouring bays close; 3 accelerometers, 100 Hz, 60 s."""
    record = Record(100.0, 60, 8, 0.40, 6, ambient=False)
    f = jitter(dice, [5.4, 5.8, 6.5, 8.9, 9.6, 12.8, 14.9, 19.5, 27], 0.02)
    zeta = dice.uniform(0.015, 0.04, len(f))
    size = (3, len(f))
    sensors = dice.uniform(0.25, 1, size) * dice.choice([-1, 1], size)
    places = dice.uniform(0.3, 1, size) * dice.choice([-1, 1], size)
    forces = np.zeros((record.fine_samples, len(f)))
    for k in range(9):
        drop = record.pulse(2 + 6.2 * k + dice.random(), 600 * dice.uniform(0.7, 1.3), 45)
        forces = forces + np.outer(drop - record.pulse(1.9 + 6.2 * k, 80, 90), places[k // 3])
    forces = forces + record.noise(dice, falloff(10, 2, level=0.02), 3) @ places
    record.add_modes(f, zeta, forces / 8000, sensors)
    return record.finish(dice, 6e-5, 16)


KINDS = {
    "carbody": Kind(3, carbody),
    "sweep": Kind(4, sweep),
    "twoshakers": Kind(5, twoshakers),
    "casting": Kind(6, casting),
    "mounts": Kind(7, mounts),
    "aircraft": Kind(11, aircraft),
    "shaketable": Kind(12, shaketable),
    "decay": Kind(13, decay),
    "floor": Kind(19, floor),
}
