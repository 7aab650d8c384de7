# SPDX-License-Identifier: MIT
"""Which true modes of a record an identification must find, which it may find, and which it invented.

SIGNED: a true mode that the record shows. Every condition holds at the output that shows it best, in the half-power
band f (1 +- zeta) of the mode over the whole record (at least one line of the spectrum to each side):
- its contribution is SNR_DB above sensor noise, converter, drift, hum, machines and walkers together;
- its contribution is at most -DOMINANCE_DB below everything else, the other modes included;
- f is below BELOW_CORNER of the corner of the anti-alias filter and inside the band of the force;
- zeta is at most DAMPED;
- in an ambient record f T zeta is at least CYCLES;
- f is not within TONE of the tone of a machine;
- no stronger mode within one half-power width has a shape at the sensors of MAC above SAME_SHAPE to its own.
OPTIONAL: any other true mode, and a mode folded down from above half the rate. To find it is right, to miss it is too.
FALSE: a confident mode that matches no true mode. A signed mode without a confident mode is missed.
MATCH: one to one within the tolerance of the true mode, which is the largest of SHARE f, LINES / T and, in an ambient
record, SIGMAS standard deviations of the frequency.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import linear_sum_assignment
from simulate import Part, Real, Record

Lines = NDArray[np.bool_]  # of a spectrum

SNR_DB = 10.0  # an error of the amplitude of 30 %, at which a peak is still seen by eye
DOMINANCE_DB = -6.0  # under twice the amplitude of its neighbours a mode is a shoulder, below that invisible
BELOW_CORNER = 0.9  # closer to the corner amplitude and phase are those of the filter
DAMPED = 0.15  # a broader mode has no peak of its own between the usual neighbours
CYCLES = 2.5  # f T zeta: with fewer correlation lengths the damping estimate scatters by more than 20 %
TONE = 0.015  # a harmonic this near cannot be distinguished from a mode by frequency
SAME_SHAPE = 0.9  # MAC above which the sensors see two close modes as one
SHARE = 0.01  # of the frequency: what an engineer calls the same mode
LINES = 2.0  # resolution of the record: two lines of its spectrum
SIGMAS = 4.0  # of a frequency estimated from an ambient record, f sqrt(zeta / (4 pi f T))


@dataclass
class Mode:
    """A true mode; signed unless `why_optional` has a reason."""

    frequency_hz: float
    damping_ratio: float
    tolerance_hz: float
    why_optional: list[str] = field(default_factory=list)
    damping_known: bool = True
    snr_db: float | None = None
    dominance_db: float | None = None
    cycles: float | None = None

    @property
    def signed(self) -> bool:
        return not self.why_optional


@dataclass
class Score:
    signed: int = 0
    missed: list[float] = field(default_factory=list)
    false: list[float] = field(default_factory=list)
    damping_errors: list[float] = field(default_factory=list)  # shares of the true ratio, of the signed modes found

    @property
    def found(self) -> int:
        return self.signed - len(self.missed)

    def add(self, other: Score) -> None:
        self.signed += other.signed
        self.missed += other.missed
        self.false += other.false
        self.damping_errors += other.damping_errors


def decibels(ratio: Real) -> float:
    """Of the output that has the largest."""
    return float(10 * np.log10(ratio.max() + 1e-30))


def power(spectrum: Any) -> Real:
    """Per output, all lines together."""
    return np.asarray((np.abs(spectrum) ** 2).sum(0))


class Spectra:
    """Windowed spectra of the modal coordinates, of the outputs and of all in them that no mode gives."""

    def __init__(self, record: Record) -> None:
        window = np.hanning(record.samples)[:, None]
        self.f = np.fft.rfftfreq(record.samples, 1 / record.rate)
        self.errors = np.fft.rfft(window * (record.errors - record.errors.mean(0)), axis=0)
        self.outputs = np.fft.rfft(window * (record.outputs - record.outputs.mean(0)), axis=0)
        self.window = window

    def contribution(self, part: Part, band: Lines) -> Any:
        return np.fft.rfft(self.window * part.coordinates, axis=0)[band] @ part.shape.T

    def band(self, low: float, high: float) -> Lines:
        return np.asarray((self.f >= low) & (self.f <= high))


def modes_above(record: Record, spectra: Spectra, part: Part) -> list[Mode]:
    """A mode above half the rate, and its image if that is above the noise at some output."""
    rate, line = record.rate, 1.0 / record.seconds
    modes = [Mode(part.f, part.zeta, SHARE * part.f, ["above half the rate"], part.damping_known)]
    image = abs(part.f - rate * round(part.f / rate))
    width = part.f * part.zeta + line
    band = spectra.band(image - width, image + width)
    if (power(spectra.contribution(part, band)) > power(spectra.errors[band])).any():
        modes.append(Mode(image, part.zeta * part.f / image, SHARE * image, ["folded"], part.damping_known))
    return modes


def doubts(record: Record, mode: Mode) -> list[str]:
    """Conditions of SIGNED that the mode fails by itself."""
    f, reasons = mode.frequency_hz, []
    if f > BELOW_CORNER * record.corner * record.rate:
        reasons.append("above the filter")
    if not record.excited[0] < f < record.excited[1]:
        reasons.append("not excited")
    if mode.damping_ratio > DAMPED:
        reasons.append("overdamped")
    if mode.snr_db is None or mode.snr_db < SNR_DB:
        reasons.append("in noise")
    if mode.dominance_db is None or mode.dominance_db < DOMINANCE_DB:
        reasons.append("masked")
    if record.ambient and f * record.seconds * mode.damping_ratio < CYCLES:
        reasons.append("few cycles")
    if any(abs(f / tone - 1) < TONE for tone in record.tones):
        reasons.append("at a tone")
    return reasons


def covered(mode: Mode, part: Part, own: float, other: Mode, other_part: Part, others: float) -> bool:
    """Whether a stronger normal mode beside this one has its shape."""
    apart = abs(mode.frequency_hz - other.frequency_hz)
    if own >= others or apart >= 2 * mode.frequency_hz * mode.damping_ratio:
        return False
    if part.shape.shape[1] != 1 or other_part.shape.shape[1] != 1:
        return False
    a, b = part.shape[:, 0], other_part.shape[:, 0]
    return bool((a @ b) ** 2 / (a @ a) / (b @ b) > SAME_SHAPE)


def true_modes(record: Record) -> list[Mode]:
    """All modes of a finished record by frequency, judged as the head of this file defines it."""
    spectra = Spectra(record)
    above: list[Mode] = []
    inside: list[tuple[Mode, Part, float]] = []  # with the power at the output that shows it best
    for part in record.parts:
        f, zeta, seconds = part.f, part.zeta, record.seconds
        half = max(f * zeta, 1.0 / seconds)
        band = spectra.band(f - half, f + half)
        if f > record.rate / 2 or not band.any():
            above += modes_above(record, spectra, part)
            continue
        mine = spectra.contribution(part, band)
        own, rest = power(mine), power(spectra.outputs[band] - mine)
        sigma = f * np.sqrt(zeta / (4 * np.pi * f * seconds))
        mode = Mode(f, zeta, max(SHARE * f, LINES / seconds, SIGMAS * sigma if record.ambient else 0.0))
        mode.damping_known = part.damping_known
        mode.snr_db = decibels(own / (power(spectra.errors[band]) + 1e-300))
        mode.dominance_db = decibels(own / (rest + 1e-300))
        mode.cycles = f * seconds * zeta
        mode.why_optional = doubts(record, mode)
        inside.append((mode, part, float(own.max())))
    for mode, part, own_power in inside:
        pairs = [one for one in inside if one[0] is not mode]
        if mode.signed and any(covered(mode, part, own_power, *one) for one in pairs):
            mode.why_optional = ["shape of a stronger mode"]
    return sorted([*above, *(mode for mode, _, _ in inside)], key=lambda mode: mode.frequency_hz)


def match(modes: list[Mode], found: list[dict[str, Any]]) -> dict[int, int]:
    """Numbers of true modes -> numbers of found ones: as many signed as possible, then as many optional, then near."""
    if not modes or not found:
        return {}
    never, signed, optional = 1e6, -10.0, -3.0  # the terms of distance are at most 1 each
    cost = np.full((len(modes), len(found)), never)
    for i, mode in enumerate(modes):
        for j, one in enumerate(found):
            error = abs(one["frequency_hz"] - mode.frequency_hz)
            if error <= mode.tolerance_hz:
                ratio = max(one["damping_ratio"], 1e-5) / mode.damping_ratio
                cost[i, j] = error / mode.tolerance_hz + min(1, 0.5 * abs(np.log(ratio)))
                cost[i, j] += signed if mode.signed else optional
    pairs = zip(*linear_sum_assignment(cost), strict=True)
    return {int(i): int(j) for i, j in pairs if cost[i, j] < 0}


def score(modes: list[Mode], found: list[dict[str, Any]]) -> Score:
    """Of the confident modes of one result."""
    pairs = match(modes, found)
    out = Score(signed=sum(mode.signed for mode in modes))
    out.false = [one["frequency_hz"] for j, one in enumerate(found) if j not in pairs.values()]
    for i, mode in enumerate(modes):
        if mode.signed and i not in pairs:
            out.missed.append(mode.frequency_hz)
        elif mode.signed and mode.damping_known:
            out.damping_errors.append(found[pairs[i]]["damping_ratio"] / mode.damping_ratio - 1)
    return out
