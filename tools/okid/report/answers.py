# SPDX-License-Identifier: MIT
"""What a model makes of a record: simulation and one-step prediction, output by output, and how well they fit."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from okid._errors import IdentificationError
from okid.result.model import Model
from okid.result.parts import Fit

Real = NDArray[np.float64]


def detrended(record: Real, kind: str) -> Real:
    """A copy without its mean or its straight line (kind "none": as it is), channel by channel over what is there."""
    out = record.copy()
    if kind == "none":
        return out
    time = np.arange(len(record)) - (len(record) - 1) / 2.0
    for k in range(record.shape[1]):
        there = np.isfinite(record[:, k])
        if not there.any():
            continue
        level, slope = float(np.mean(record[there, k])), 0.0
        if kind == "linear":
            middle = float(np.mean(time[there]))
            spread = float(np.sum((time[there] - middle) ** 2))
            if spread > 0.0:
                slope = float(np.sum((time[there] - middle) * record[there, k]) / spread)
            level -= slope * middle
        out[:, k] -= level + slope * time
    return out


def _percent(pairs: list[tuple[Real, Real]], names: Sequence[str]) -> dict[str, float | None]:
    """100 (1 - |y - yhat| / |y - mean|) over all stretches together; None where that says nothing."""
    out: dict[str, float | None] = {name: None for name in names}
    if not pairs:
        return out
    measured, estimated = (np.concatenate(part) for part in zip(*pairs, strict=True))
    for k, name in enumerate(names):
        there = np.isfinite(measured[:, k])
        y, yhat = measured[there, k], estimated[there, k]
        spread = float(np.linalg.norm(y - np.mean(y))) if len(y) else 0.0
        with np.errstate(over="ignore", invalid="ignore"):
            value = 100.0 * (1.0 - float(np.linalg.norm(y - yhat)) / spread) if spread > 0.0 else math.nan
        out[name] = value if math.isfinite(value) else None
    return out


def stretches(u: Real, least: int) -> list[slice]:
    """The stretches of at least `least` samples in which no input is missing; the whole record when none is."""
    broken = np.flatnonzero(~np.all(np.isfinite(u), axis=1))
    if len(broken) == 0:
        return [slice(0, len(u))]
    edges = np.concatenate(([-1], broken, [len(u)])).tolist()
    return [slice(a + 1, b) for a, b in zip(edges[:-1], edges[1:], strict=True) if b - a - 1 >= least]


class Answer(NamedTuple):
    """One stretch of a record without a missing input, and what a model makes of it."""

    first: int
    u: Real
    y: Real
    simulated: Real | None
    predicted: Real | None


def answers(model: Model, predict: bool, data: Real, n_u: int) -> list[Answer]:
    """Every stretch of at least max(20, 2 order) samples, simulated (with inputs) and predicted (stable predictor).

    Each has its own least-squares initial state. Without inputs: prediction of the whole record from rest.
    """
    out = []
    for piece in stretches(data[:, :n_u], max(20, 2 * model.order)) if n_u else [slice(0, len(data))]:
        u, y = data[piece, :n_u], data[piece, n_u:]
        x0, simulated = None, None
        if n_u:
            radius = model.radius()
            informed = math.log(1e-16) / math.log(radius) if 0.0 < radius < 1.0 else math.inf  # then x0 has died away
            used = max(1, int(min(len(u), informed)))
            try:
                x0 = model.initial_state(u[:used], y[:used])
            except IdentificationError:
                x0 = np.zeros(model.order)
            simulated = model.simulate(u, x0)
        out.append(Answer(int(piece.start), u, y, simulated, model.predict(u, y, x0) if predict else None))
    return out


def fit_of(given: Sequence[Answer], outputs: Sequence[str]) -> Fit:
    """Both fits over all stretches together."""
    simulated = [(one.y, one.simulated) for one in given if one.simulated is not None]
    predicted = [(one.y, one.predicted) for one in given if one.predicted is not None]
    return Fit(_percent(simulated, outputs), _percent(predicted, outputs))
