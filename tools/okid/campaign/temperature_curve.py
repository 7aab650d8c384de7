# SPDX-License-Identifier: MIT
"""How frequencies follow the temperature: a line with as many bends as the training asks for.

A bend lies at one temperature for all modes, as where the ground freezes; each mode has its own slopes. Bends are added
one after the other while Bayes' information criterion (Schwarz 1978) falls, of all modes together with the correlation
of their residuals. Persistent residuals count as fewer groups, so that a slow influence is not taken for a bend.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from okid.campaign.trend_model import Regression, far, inverses, spread_of, usual_spread

Real = NDArray[np.float64]
MOST_BENDS = 2
LEAST = 8  # groups of each mode on either side of a bend
_LEAST_SPAN_C = 0.5  # of them
_PLACES, _HALVINGS = 24, 5  # temperatures at which a bend is tried, and steps of half the distance from the best one


class Curve(NamedTuple):
    """Temperatures (°C) of the bends in their order, None: the temperature is not used; `centre_c`: where the first
    regressor of it is 0."""

    centre_c: float
    bends: tuple[float, ...] | None

    def regressors(self, temperature: Real | None, count: int) -> Real:
        """(count, k): 1, the temperature about `centre_c`, and that above each bend; in units of 10 °C."""
        if self.bends is None or temperature is None:
            return np.ones((count, 1))
        above = [np.maximum(temperature - bend, 0.0) for bend in self.bends]
        return np.column_stack([np.ones(count), *((one / 10.0) for one in (temperature - self.centre_c, *above))])


def slopes(model: Regression) -> tuple[Real, Real]:
    """Change of the columns per °C and its standard deviation (pieces, d), of each straight piece from the cold on."""
    k = len(model.coefficients)
    sums = np.column_stack([np.zeros(k - 1), np.tri(k - 1)])
    variance = model.variance * np.einsum("pk,dkl,pl->pd", sums, model.inverse, sums)
    return sums @ model.coefficients / 10.0, np.sqrt(variance) / 10.0


def _residual(y: Real, X: Real, weight: Real) -> Real:
    known = np.where(weight > 0, y, 0.0)
    b = np.einsum("dkl,nl,nd->kd", inverses(X, weight), X, weight**2 * known)
    return np.where(weight > 0, weight * (known - X @ b), 0.0)


def _enough(temperature: Real, weight: Real, bends: tuple[float, ...]) -> bool:
    """Has each mode LEAST groups, at different temperatures, on either side of every bend?"""
    side = np.searchsorted(bends, temperature)
    pieces = [temperature[(side == k) & seen] for k in range(len(bends) + 1) for seen in (weight > 0).T]
    return all(len(piece) >= LEAST and np.ptp(piece) >= _LEAST_SPAN_C for piece in pieces)


class _Search:
    """Bends of one training; residuals far from a curve of many bends are left out."""

    def __init__(self, y: Real, temperature: Real, weight: Real) -> None:
        self._y, self._t, self.centre = y, temperature, float(np.mean(temperature))
        many: tuple[float, ...] = ()
        for place in np.quantile(temperature, np.linspace(0.0, 1.0, 10)[1:-1]):
            if _enough(temperature, weight, (*many, float(place))):
                many = (*many, float(place))
        usual, left = usual_spread(y, self._X(many), weight)
        self._weight = weight * ~far(left, usual)
        seen = np.any(weight > 0, axis=1)
        low, high = float(np.min(temperature[seen])), float(np.max(temperature[seen]))
        self._places = np.linspace(low, high, _PLACES + 2)[1:-1].tolist()
        z = np.nan_to_num(left) * (self._weight > 0)
        rho = float(np.max(np.sum(z[1:] * z[:-1], axis=0) / np.maximum(np.sum(z**2, axis=0), 1e-300)))
        rho = min(max(rho, 0.0), 0.95)
        self._count = float(np.sum(seen)) * (1.0 - rho) / (1.0 + rho)

    def _X(self, bends: tuple[float, ...]) -> Real:
        return Curve(self.centre, bends).regressors(self._t, len(self._t))

    def spread(self, bends: tuple[float, ...]) -> tuple[Real, float]:
        """Variance (d,) about the curve, and the criterion; infinite where there are too few groups."""
        d = self._y.shape[1]
        if bends and not _enough(self._t, self._weight, bends):
            return np.full(d, np.inf), np.inf
        X = self._X(bends)
        variance, correlation = spread_of(_residual(self._y, X, self._weight), self._weight, X.shape[1])
        size = float(np.sum(np.log(np.maximum(variance, 1e-300)))) + float(np.linalg.slogdet(correlation)[1])
        return variance, self._count * size + (d + 1) * len(bends) * float(np.log(self._count))

    def best(self, others: tuple[float, ...]) -> tuple[float, ...]:
        """The others and one more bend at its best place: on a grid, then ever closer to it."""

        def value(place: float) -> float:
            return self.spread(tuple(sorted({*others, place})))[1]

        at, step = min(self._places, key=value), self._places[1] - self._places[0]
        for _ in range(_HALVINGS):
            step /= 2.0
            at = min((at, at - step, at + step), key=value)
        return tuple(sorted({*others, at}))


def find_curve(y: Real, temperature: Real, weight: Real, count: int | None = None) -> tuple[Curve, float]:
    """The curve of frequencies y (n, d) with weights over temperatures (n,), and how many times as large the scatter
    about a line is, of the mode that gains most.

    `count` bends where the groups allow it; None: as many as the training asks for, at most MOST_BENDS. Deterministic;
    cost: some hundreds of regressions.
    """
    search = _Search(y, temperature, weight)
    chosen: tuple[float, ...] = ()
    line, least = search.spread(())
    for _ in range(MOST_BENDS if count is None else count):
        bends = search.best(chosen)
        for old in bends:
            bends = search.best(tuple(b for b in bends if b != old))  # each again, beside the others
        value = search.spread(bends)[1]
        if not np.isfinite(value) or (count is None and value >= least):
            break
        chosen, least = bends, value
    curved = search.spread(chosen)[0]
    return Curve(search.centre, chosen), float(np.sqrt(np.max(line / np.maximum(curved, 1e-300))))
