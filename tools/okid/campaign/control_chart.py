# SPDX-License-Identifier: MIT
"""Control charts of standardised residuals, with limits for a stated probability of a false alarm in a year.

Two charts: the smallest T^2 of three groups in a row (sudden change), and that of an exponentially weighted mean (small
change that stays; Lowry et al. 1992). One or two outlying groups, such as bad records, are in neither. Limits are not
read from tables: years without damage are simulated through the same regression on the same temperatures, with as few
training groups, with the persistence (first order) and the tails (Student's t) of the residuals; the limit is the
quantile of the largest value of a year. Half of the probability goes to each chart.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from okid.campaign.trend_model import Regression, leverage, spread_of

Real = NDArray[np.float64]
MEMORY = 0.2  # weight of the newest group in the mean
IN_A_ROW = 3  # groups that a sudden change must last
MOST_IN_YEAR = 20_000
_SIMULATED, _SIMULATED_LONG, _LONG = 4000, 1500, 2000


class Limits(NamedTuple):
    """Limits of both charts; of `single` groups; `simulated` years behind them, of `per_year` groups each."""

    t2: float
    mean: float
    single: float
    simulated: int
    per_year: int


class Charts(NamedTuple):
    """T^2 (n,) of three groups in a row, of the weighted mean, and of each alone; NaN before the training ends."""

    t2: Real
    mean: Real
    single: Real


class _Chart:
    """The values of the charts group by group, of one campaign or many: residuals (..., d)."""

    def __init__(self, shape: tuple[int, ...]) -> None:
        self._state = np.zeros(shape)
        self._held = [np.zeros(shape)] * (IN_A_ROW - 1)
        self._far_before = np.zeros(shape[:-1], dtype=np.int64)
        self._row = [np.zeros(shape[:-1])] * IN_A_ROW
        d = shape[-1]
        self._far = d + 6.0 * np.sqrt(2.0 * d) + 15.0  # T^2 of a group that waits for others
        self._ordinary = d + 3.0 * np.sqrt(2.0 * d)  # of one behind it that shows that nothing has changed

    def _take(self, white: Real, flags: Any) -> None:
        """One more group where the flags are set."""
        single = np.sum(white**2, axis=-1)
        capped = white * np.sqrt(np.minimum(1.0, self._far / np.maximum(single, 1e-300)))[..., None]
        new = (1.0 - MEMORY) * self._state + MEMORY * capped
        self._state = np.where(flags[..., None], new, self._state)
        row = [*self._row[1:], single]
        self._row = [np.where(flags, one, old) for one, old in zip(row, self._row, strict=True)]

    def add(self, white: Real) -> tuple[Real, Real, Real]:
        """T^2 (...,) of groups in a row, of the mean, alone.

        A far group and those behind it wait until they are IN_A_ROW, or until an ordinary one tells that it was alone.
        """
        single = np.sum(white**2, axis=-1)
        goes_on = single > np.where(self._far_before > 0, self._ordinary, self._far)
        far_now = np.where(goes_on, self._far_before + 1, 0)
        for held in self._held:
            self._take(held, far_now == IN_A_ROW)
        self._take(white, (far_now == 0) | (far_now >= IN_A_ROW))
        self._far_before, self._held = far_now, [*self._held[1:], white]
        waits = (far_now > 0) & (far_now < IN_A_ROW)
        row = np.where(waits, 0.0, np.minimum.reduce(self._row))
        return row, np.sum(self._state**2, axis=-1) * (2.0 - MEMORY) / MEMORY, single


def charts(white: Real) -> Charts:
    """The charts of standardised residuals (n, d) in the order of time, the mean beginning at 0."""
    chart = _Chart((white.shape[1],))
    return Charts(*(np.array(column) for column in zip(*(chart.add(one) for one in white), strict=True)))


class _Null:
    """Simulated campaigns without damage: `count` of them at a time, d residuals of unit variance with the correlation,
    the persistence and the tails of the training."""

    def __init__(self, rng: np.random.Generator, count: int, model: Regression) -> None:
        self._rng, self._rho, self._tails = rng, model.persistence, model.tails
        self._fresh = np.sqrt(1.0 - model.persistence**2)
        self._root = np.linalg.cholesky(model.correlation).T
        self._now = self._new((count, len(model.persistence)))

    def _new(self, shape: tuple[int, ...]) -> Real:
        if np.isinf(self._tails):
            return np.asarray(self._rng.standard_normal(shape) @ self._root)
        return np.asarray(self._rng.standard_t(self._tails, shape) * np.sqrt(1.0 - 2.0 / self._tails) @ self._root)

    def step(self) -> Real:
        """Residuals of the next group (count, d)."""
        self._now = self._rho * self._now + self._fresh * self._new(self._now.shape)
        return self._now


class _Trained:
    """What each of many simulated campaigns learns from its training: as fit() does it, from the same rows."""

    def __init__(self, null: _Null, X: Real, weight: Real, model: Regression) -> None:
        seen = weight > 0
        y = np.where(seen, np.stack([null.step() for _ in range(len(X))], axis=1), 0.0)
        learn = np.einsum("dkl,nl,nd->dkn", model.inverse, X, weight)
        self.coefficients = np.einsum("dkn,cnd->ckd", learn, y, optimize=True)
        self.variance, self.correlation = spread_of(
            np.where(seen, y - weight * (X @ self.coefficients), 0.0), weight, X.shape[1]
        )
        self.root = np.linalg.inv(np.linalg.cholesky(self.correlation))
        self._guesses: dict[bytes, Real] = {}

    def white(self, now: Real, x: Real, weight: Real, lever: Real) -> Real:
        """Residuals `now` (count, d) of one more group, as standardised() gives them."""
        z = (now - weight * (x @ self.coefficients)) / np.sqrt(self.variance * (1.0 + lever))
        seen = weight > 0
        if not np.all(seen):
            key, R = seen.tobytes(), self.correlation
            if key not in self._guesses:
                self._guesses[key] = np.asarray(np.linalg.solve(R[:, seen][:, :, seen], R[:, seen][:, :, ~seen]))
            z[:, ~seen] = (z[:, None, seen] @ self._guesses[key])[:, 0]
        return np.asarray((self.root @ z[:, :, None])[:, :, 0])


def limits(
    training: tuple[Real, Real], watched: tuple[Real, Real], model: Regression, per_year: int,
    false_alarm_per_year: float, seed: int,
) -> Limits:  # fmt: skip
    """Limits for P(any alarm in a year of `per_year` groups) = `false_alarm_per_year` without damage.

    Regressors (n, k) and weights (n, d) of the training and of the groups that are watched: temperatures of a year and
    what is missing in it, repeated as often as it takes. Cost: some thousand simulated years.
    """
    per_year = min(max(1, per_year), MOST_IN_YEAR)
    count = _SIMULATED if per_year <= _LONG else _SIMULATED_LONG
    rows, weights = watched if len(watched[0]) else training
    at = np.arange(per_year) % len(rows)
    year, weight = rows[at], weights[at]
    lever = leverage(year, model, weight)
    rng = np.random.default_rng([seed, 7])
    largest = []
    at_once = max(50, min(count, 4_000_000 // (len(training[0]) * len(model.persistence))))
    for first in range(0, count, at_once):
        now = min(at_once, count - first)
        null = _Null(rng, now, model)
        learned = _Trained(null, *training, model)
        chart, top = _Chart((now, len(model.persistence))), np.zeros((3, now))
        for k in range(per_year):
            white = learned.white(null.step(), year[k], weight[k], lever[k])
            np.maximum(top, chart.add(white), out=top)
        largest.append(top)
    t2, mean, single = np.quantile(np.hstack(largest), 1.0 - false_alarm_per_year / 2.0, axis=1).tolist()
    return Limits(t2, mean, single, count, per_year)
