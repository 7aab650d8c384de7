# SPDX-License-Identifier: MIT
"""Physics of the simulated vibration tests: modes, forces, sensors, the logger.

Every mode is propagated by itself and exactly: one complex exponential, the force linear between fine samples
(`oversampling` times the rate of the record). So the contribution of each mode to each output is known. A record has
one anti-alias filter for outputs and forces, white sensor noise of a given density and a converter of given bits.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cholesky, eigh
from scipy.signal import butter, fftconvolve, firwin, lfilter, sosfilt

Real = NDArray[np.floating[Any]]
Complex = NDArray[np.complex128]
Dice = np.random.Generator
Spectrum = Callable[[Real], Real]
TAU = 2 * np.pi
FIR = None  # order of a logger whose anti-alias filter has linear phase


def jitter(dice: Dice, value: Any, share: float) -> Any:
    """Value or values, each off by a Gaussian share."""
    return np.asarray(value, float) * (1 + share * dice.standard_normal(np.shape(value)))


# Modes


def respond(pole: complex, force: Real, step: float) -> Complex:
    """z' = pole z + force, the force linear between its samples, z = 0 before."""
    decay = np.exp(pole * step)
    new = (decay - 1 - pole * step) / (pole * pole * step)
    old = (decay - 1) / pole - new
    return np.asarray(lfilter(np.array([new, old]), np.array([1, -decay]), force.astype(complex)))


def modal_responses(f: Real, zeta: Real, forces: Real, step: float, quantity: Literal["a", "d"]) -> Real:
    """Modal accelerations or displacements (samples, modes) of normal modes under modal forces (samples, modes)."""
    out = np.empty((len(forces), len(f)))
    for k in range(len(f)):
        omega = TAU * f[k]
        damped = omega * np.sqrt(1 - zeta[k] ** 2)
        pole = -zeta[k] * omega + 1j * damped
        state = respond(pole, forces[:, k], step)
        if quantity == "a":
            out[:, k] = (-1j * pole**2 * state / damped).real + forces[:, k]
        else:
            out[:, k] = (-1j * state / damped).real
    return out


def beam(
    elements: int,
    length: float,
    stiffness: float,
    mass: float,
    left: str = "free",
    right: str = "free",
    tip: float = 0.0,
    springs: Sequence[tuple[int, float]] = (),
    modes: int = 8,
) -> tuple[Real, Real, Real]:
    """Euler beam of Hermite elements: frequencies, deflections and slopes (nodes, modes), of unit modal mass.

    Stiffness EI, mass per length, ends free, pinned or clamped, a mass at the right end, springs (node, rate).
    Rigid-body modes are left out.
    """
    h = length / elements
    size = 2 * (elements + 1)
    k_all, m_all = np.zeros((size, size)), np.zeros((size, size))
    k_one = np.array([[12, 6 * h, -12, 6 * h], [6 * h, 4 * h * h, -6 * h, 2 * h * h]])
    k_one = np.vstack([k_one, [[-12, -6 * h, 12, -6 * h], [6 * h, 2 * h * h, -6 * h, 4 * h * h]]])
    k_one = stiffness / h**3 * k_one
    m_one = np.array([[156, 22 * h, 54, -13 * h], [22 * h, 4 * h * h, 13 * h, -3 * h * h]])
    m_one = np.vstack([m_one, [[54, 13 * h, 156, -22 * h], [-13 * h, -3 * h * h, -22 * h, 4 * h * h]]])
    m_one = h / 420 * m_one
    for element in range(elements):
        at = slice(2 * element, 2 * element + 4)
        k_all[at, at] += k_one
        m_all[at, at] += m_one * mass
    m_all[size - 2, size - 2] += tip
    for node, rate in springs:
        k_all[2 * node, 2 * node] += rate
    kept = np.ones(size, bool)
    for end, i in ((left, 0), (right, size - 2)):
        if end in ("clamped", "pinned"):
            kept[i] = False
        if end == "clamped":
            kept[i + 1] = False
    squares, vectors = eigh(k_all[np.ix_(kept, kept)], m_all[np.ix_(kept, kept)])
    full = np.zeros((size, len(squares)))
    full[kept] = vectors
    rigid = int(np.sum(squares < 1e-10 * squares[-1]))
    chosen = slice(rigid, rigid + modes)
    return np.sqrt(squares[chosen]) / TAU, full[0::2, chosen], full[1::2, chosen]


def rotated(shapes: Real, levels: Sequence[int], angle: float) -> Real:
    """Two sensors at right angles at each level, turned from the axes of two equal sets of bending modes."""
    cos, sin = np.cos(angle), np.sin(angle)
    rows = []
    for level in levels:
        rows.append(np.concatenate([shapes[level] * cos, -shapes[level] * sin]))
        rows.append(np.concatenate([shapes[level] * sin, shapes[level] * cos]))
    return np.array(rows)


# Forces


def falloff(corner: float, power: float = 5 / 3, level: float = 1.0) -> Spectrum:
    """Level below the corner, f^-power above it; the default power is that of turbulent wind."""

    def spectrum(f: Real) -> Real:
        return np.asarray(level / (1 + (f / corner) ** power))

    return spectrum


def flat(low: float, high: float, level: float = 1.0) -> Spectrum:
    """Level between two frequencies, nothing outside."""

    def spectrum(f: Real) -> Real:
        return np.asarray(level * (f > low) * (f < high))

    return spectrum


def noise(dice: Dice, samples: int, rate: float, spectrum: Spectrum, columns: int = 1) -> Real:
    """Gaussian noise (samples, columns) of a one-sided spectrum."""
    f = np.fft.rfftfreq(samples, 1 / rate)
    gain = np.sqrt(np.maximum(spectrum(np.maximum(f, f[1])), 0) * rate / 2)
    gain[0] = 0
    drawn = [np.fft.irfft(np.fft.rfft(dice.standard_normal(samples)) * gain, samples) for _ in range(columns)]
    return np.stack(drawn, 1)


# Records


@dataclass
class Part:
    """What one mode gives: outputs = coordinates (samples, r) shape' (r, outputs); r is 1 of a normal mode."""

    f: float
    zeta: float
    coordinates: Real
    shape: Real
    damping_known: bool = True


class Record:
    """One simulated test, collected by a kind and written by run.py.

    Corner: of the anti-alias filter, a share of the rate. Order: of its Butterworth filter, or FIR. Ambient: the
    excitation is random and unmeasured over the whole record. Quantity: what the outputs measure, accelerations or
    displacements.
    """

    def __init__(
        self,
        rate: float,
        seconds: float,
        oversampling: int,
        corner: float,
        order: int | None,
        ambient: bool,
        quantity: Literal["a", "d"] = "a",
    ) -> None:
        self.rate, self.seconds, self.oversampling = rate, seconds, oversampling
        self.corner, self.order, self.ambient, self.quantity = corner, order, ambient, quantity
        self.samples = round(rate * seconds)
        self.fine_samples, self.fine_rate = self.samples * oversampling, rate * oversampling
        self.step = 1 / self.fine_rate
        self.time = np.arange(self.fine_samples) * self.step
        self.parts: list[Part] = []
        self.forces: Real | None = None  # measured ones, fine
        self.disturbance: Any = 0.0  # at the outputs: no mode's
        self.damage: Callable[[Dice, Real], Real] | None = None  # what bad sensors do to the outputs
        self.full_scale: float | None = None  # of the converter; None: chosen to fit each output
        self.tones: list[float] = []  # of machines
        self.excited = (0.0, 1e9)  # band of the force
        self.outputs = self.errors = np.zeros((0, 0))  # as recorded, and all in them that no mode gives
        self.inputs: Real | None = None

    def sampled(self, fine: Real) -> Real:
        """Anti-alias filter and decimation."""
        step = self.oversampling
        if self.order is not FIR:
            sections = butter(self.order, 2 * self.corner / step, output="sos")
            return np.asarray(sosfilt(sections, fine, axis=0)[::step])
        taps = firwin(40 * step + 1, 2 * self.corner / step)
        padded = np.vstack([fine, np.zeros((20 * step, fine.shape[1]))])
        filtered = fftconvolve(padded, taps[:, None], axes=0)
        return np.asarray(filtered[20 * step : 20 * step + len(fine) : step])

    def noise(self, dice: Dice, spectrum: Spectrum, columns: int = 1) -> Real:
        return noise(dice, self.fine_samples, self.fine_rate, spectrum, columns)

    def noise_along(self, dice: Dice, spectrum: Spectrum, places: Real, length: float) -> Real:
        """Forces at places on a line, their correlation exp(-distance / length)."""
        correlation = np.exp(-np.abs(np.subtract.outer(places, places)) / length)
        root = cholesky(correlation + 1e-9 * np.eye(len(places)), lower=True)
        return np.asarray(self.noise(dice, spectrum, len(places)) @ np.asarray(root).T)

    def pulse(self, at: float, peak: float, milliseconds: float) -> Real:
        """Force of one hit."""
        length = milliseconds * 1e-3
        out = np.zeros(self.fine_samples)
        on = (self.time >= at) & (self.time < at + length)
        out[on] = peak * np.sin(np.pi * (self.time[on] - at) / length) ** 1.5
        return out

    def add_modes(self, f: Real, zeta: Real, forces: Real, shapes: Real) -> None:
        """Normal modes under modal forces (fine samples, modes), seen through shapes (outputs, modes)."""
        coordinates = self.sampled(modal_responses(f, zeta, forces, self.step, self.quantity))
        for k in range(len(f)):
            self.parts.append(Part(f[k], zeta[k], coordinates[:, [k]], shapes[:, [k]]))

    def disturb(self, f: Real, zeta: Real, forces: Real, shapes: Real) -> None:
        """The same modes under a force that does not count as their excitation: machines, walkers."""
        more = self.sampled(modal_responses(f, zeta, forces, self.step, self.quantity)) @ shapes.T
        self.disturbance = self.disturbance + more

    def response(self) -> Real:
        """What the modes give at the outputs, without disturbance and noise."""
        return np.asarray(sum(part.coordinates @ part.shape.T for part in self.parts))

    def finish(self, dice: Dice, density: float, bits: int, input_noise: float = 0.0) -> Record:
        """Sensor noise (density in units / sqrt Hz; of forces a share of the peak), damage, converter."""
        headroom = 1.6
        clean = self.response()
        sensed = density * np.sqrt(self.rate / 2) * dice.standard_normal(clean.shape)
        total = clean + self.disturbance + sensed
        if self.damage is not None:
            total = self.damage(dice, total)
        span = headroom * np.abs(total).max(0) if self.full_scale is None else self.full_scale
        code = 2 * span / 2**bits
        self.outputs = np.clip(np.round(total / code), -(2 ** (bits - 1)), 2 ** (bits - 1) - 1) * code
        self.errors = self.outputs - clean
        if self.forces is not None:
            force = self.sampled(self.forces)
            force = force + input_noise * np.abs(force).max(0) * dice.standard_normal(force.shape)
            code = 2 * headroom * np.abs(force).max(0) / 2**bits
            self.inputs = np.round(force / code) * code
        return self


@dataclass(frozen=True)
class Kind:
    """A kind of test; its number is part of the seed and stays."""

    number: int
    make: Callable[[Dice], Record]
