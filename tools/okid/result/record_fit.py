# SPDX-License-Identifier: MIT
"""How well a model explains whole records: simulation and one-step prediction, output by output."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from okid._errors import IdentificationError
from okid.result.model import Model
from okid.result.result import Fit

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


def fit_records(
    model: Model, records: Sequence[Real], outputs: Sequence[str], predict: bool = True
) -> tuple[Fit, Real | None]:
    """Both fits over all records (N, n_u + n_y), inputs first, already detrended, and x0 (records, n_z) of each.

    A record is cut where an input is missing: each stretch has its own least-squares initial state, stretches of fewer
    than max(20, 2 order) samples are left out. x0 of a record is that of its first stretch, zero when it has none.
    Missing outputs carry no weight. `predict` False leaves the prediction None (unstable predictor). Without inputs
    there is nothing to simulate: prediction from rest, no x0.
    """
    if model.B.shape[1] == 0:
        pairs = [(r, model.predict(np.zeros((len(r), 0)), r)) for r in records] if predict else []
        return Fit({name: None for name in outputs}, _percent(pairs, outputs)), None
    n_u, radius, states = model.B.shape[1], model.radius(), []
    informed = math.log(1e-16) / math.log(radius) if 0.0 < radius < 1.0 else math.inf  # then x0 has died away
    simulated: list[tuple[Real, Real]] = []
    predicted: list[tuple[Real, Real]] = []
    for record in records:
        first = np.zeros(model.order)
        for turn, piece in enumerate(stretches(record[:, :n_u], max(20, 2 * model.order))):
            u, y = record[piece, :n_u], record[piece, n_u:]
            used = max(1, int(min(len(u), informed)))
            try:
                x0 = model.initial_state(u[:used], y[:used])
            except IdentificationError:
                x0 = np.zeros(model.order)
            if turn == 0:
                first = x0
            simulated.append((y, model.simulate(u, x0)))
            if predict:
                predicted.append((y, model.predict(u, y, x0)))
        states.append(first)
    return Fit(_percent(simulated, outputs), _percent(predicted, outputs)), np.array(states)
