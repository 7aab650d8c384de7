# SPDX-License-Identifier: MIT
"""Is the record in the units of the model? Factors between the two, and known units made SI where that fixes it."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from okid.abi.host import unit as si_of
from okid.data.records import Record
from okid.frf import is_hit
from okid.report.answers import detrended, stretches
from okid.result.model import Model

Real = NDArray[np.float64]
TOLERANCE = 0.2  # a factor this near 1 is the structure's own affair, not a unit
SAME_SHAPE = 0.9  # least correlation of record and simulation that makes a factor mean anything


class Agreement(NamedTuple):
    """factor (n_y,): simulation of the model over record, NaN where the two do not have the same shape.

    record: with channels made SI where the model is; said: a sentence on each of those.
    """

    factor: Real
    record: Record
    said: list[str]


def _factors(model: Model, u: Real, y: Real) -> Real:
    """Least-squares factor by which each output (N, n_y) must be multiplied to be the simulation from rest.

    The beginning, where the unknown initial state acts, is left out unless the force is a hit. NaN where the
    correlation is below 0.9.
    """
    radius = model.radius()
    settle = math.ceil(math.log(1e-3) / math.log(radius)) if 0.0 < radius < 1.0 else 0
    sums = np.zeros((3, y.shape[1]))
    for piece in stretches(u, max(20, 2 * model.order)):
        skip = 0 if is_hit(u[piece]) else min(settle, (piece.stop - piece.start) // 4)
        made, there = model.simulate(u[piece])[skip:], y[piece][skip:]
        use = np.isfinite(there)
        made, there = np.where(use, made, 0.0), np.where(use, there, 0.0)
        with np.errstate(over="ignore", invalid="ignore"):
            sums += np.array([np.sum(made * there, axis=0), np.sum(there**2, axis=0), np.sum(made**2, axis=0)])
    return factor_of(sums)


def factor_of(sums: Real) -> Real:
    """Of sums (3, n_y) of simulation times record, record squared, simulation squared; NaN where they do not agree."""
    out = np.full(sums.shape[1], np.nan)
    usable = np.all(np.isfinite(sums), axis=0) & (sums[1] > 0.0) & (sums[2] > 0.0)
    across, own, other = sums[:, usable]
    factor = across / own
    factor[across < SAME_SHAPE * np.sqrt(own * other)] = np.nan
    out[usable] = factor
    return out


def _factor(unit: str) -> float:
    """What makes a known unit SI; 1 for all others."""
    return (si_of(unit) or (1.0, unit))[0]


def _near(factor: float, wanted: float) -> bool:
    return abs(factor / wanted - 1.0) <= TOLERANCE


def _outputs_made_si(factor: Real, units: Sequence[str]) -> list[bool]:
    """Outputs whose factor is that of their unit, and not 1."""
    return [
        _factor(unit) != 1.0 and not _near(one, 1.0) and _near(one, _factor(unit))
        for one, unit in zip(factor.tolist(), units, strict=True)
    ]


def _converted(record: Record, places: Sequence[int]) -> Record:
    samples, units = record.samples.copy(), list(record.units)
    for k in places:
        factor, si = si_of(units[k]) or (1.0, units[k])
        samples[:, k] *= factor
        units[k] = si
    return replace(record, samples=samples, units=units)


def _sentence(record: Record, place: int) -> str:
    unit = record.units[place]
    size, si = si_of(unit) or (1.0, unit)
    return f"{record.names[place]!r} of the record is in {unit}, the model in {si}: 1 {unit} is taken as {size:g} {si}"


def agreement(model: Model, record: Record, n_u: int, detrend: str, used: slice) -> Agreement:
    """Compare the record (its channels: n_u inputs, then the outputs of the model) with the model's simulation.

    A channel in a unit that is known (g, mg, kN ..) is made SI when the model then agrees and otherwise does not.
    `used`: the rows that are compared. Without inputs there is no scale to compare: all NaN. Cost: one simulation, two
    when an input is in a unit that is not SI and an output does not agree.
    """
    n_y = len(record.names) - n_u
    if n_u == 0:
        return Agreement(np.full(n_y, np.nan), record, [])
    data = detrended(record.samples[used], detrend)
    inputs = [k for k in range(n_u) if _factor(record.units[k]) != 1.0]
    best: tuple[int, list[int], Real] | None = None
    for turned in ([], inputs) if inputs else ([],):
        scale = np.array([_factor(record.units[k]) if k in turned else 1.0 for k in range(n_u)])
        factor = _factors(model, data[:, :n_u] * scale, data[:, n_u:])
        made = _outputs_made_si(factor, record.units[n_u:])
        sizes = [_factor(record.units[n_u + k]) if made[k] else 1.0 for k in range(n_y)]
        left = factor / np.array(sizes)
        good = int(np.sum(np.abs(left - 1.0) <= TOLERANCE))
        if best is None or good > best[0]:
            best = (good, [*turned, *(n_u + k for k in range(n_y) if made[k])], left)
        if good == n_y:
            break
    assert best is not None  # the record as it is was tried
    places = best[1]
    return Agreement(best[2], _converted(record, places) if places else record, [_sentence(record, k) for k in places])


def doubts(factor: Real, names: Sequence[str]) -> list[str]:
    """A sentence on every output that differs from the model by a constant factor."""
    out = []
    for name, one in zip(names, factor.tolist(), strict=True):
        if math.isfinite(one) and abs(one - 1.0) > TOLERANCE:
            times, word = (one, "smaller") if one > 1.0 else (1.0 / one, "larger")
            out.append(
                f"{name}: record is {times:.3g} times {word} than the model says: other units, or another record?"
            )
    return out
