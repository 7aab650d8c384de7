# SPDX-License-Identifier: MIT
"""Control charts of standardised residuals, with limits for a stated probability of a false alarm in a year.

Two charts: T^2 that all but one of four to six groups in a row exceed (sudden change), and that of an exponentially
weighted mean (small change that stays; Lowry et al. 1992). Outlying groups that stay alone, such as bad records, are
in neither: groups_needed() says how many in a row are a change. T^2 of a group is taken by its rank among the groups
of the training, whatever the law of their scatter. Limits are not read from tables: years without damage are
simulated through the same regression on the same temperatures, with as few training groups, ranked in the same way,
with the persistence (first order) and the tails (Student's t) of the residuals; the limit is the quantile of the
largest value of a year. Half of the probability goes to each chart.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.special import chdtri

from okid.campaign.trend_model import Flags, Regression, filled, leverage, spread_at, spread_of, whitened

Real = NDArray[np.float64]
MEMORY = 0.2  # weight of the newest group in the mean
LEAST_NEEDED, MOST_NEEDED = 3, 5  # outlying groups that are a sudden change, of one more in a row
MOST_IN_YEAR = 20_000
_BY_CHANCE = 0.1  # share of the false alarms that wrong groups in a row may be
_SIMULATED, _SIMULATED_LONG, _LONG = 4000, 1500, 2000


class Limits(NamedTuple):
    """Limits of both charts; `needed` outlying groups, of one more in a row, are a sudden change; `simulated` years
    behind the limits, of `per_year` groups each."""

    t2: float
    mean: float
    needed: int
    simulated: int
    per_year: int


class Charts(NamedTuple):
    """T^2 (n,) that all but one of some groups in a row exceed, and of the weighted mean; NaN before the training ends.

    `alone` (n,): outlying groups that too few others followed: they are in neither chart.
    """

    t2: Real
    mean: Real
    alone: Flags


class Ranks:
    """T^2 of new groups by their rank among those of the training: the T^2 that a Gaussian group of that rank has.

    The rank of a new value among old ones has the same distribution for every law of the scatter. A value above all of
    them stays as many times the largest one as it was. Of one campaign or of many: training (..., n, d).
    """

    def __init__(self, training: Real) -> None:
        n, self._d = training.shape[-2:]
        t2 = np.sort(np.sum(training**2, axis=-1), axis=-1).reshape(-1, n)
        self._known = np.hstack([np.zeros((len(t2), 1)), t2])
        self._score = np.concatenate([[0.0], chdtri(self._d, 1.0 - np.arange(1, n + 1) / (n + 1.0))])
        self._row = np.arange(len(t2))
        self._flat = (self._squeeze(self._known) + self._row[:, None]).ravel()

    def _squeeze(self, t2: Real) -> Real:
        """Into 0 .. 1, in order: so one search serves all campaigns."""
        return np.asarray(t2 / (t2 + self._d))

    def scored(self, white: Real) -> Real:
        """Residuals (campaigns, d) of a group, or (n, d) of one campaign, with the length that their rank has."""
        t2 = np.sum(white**2, axis=-1)
        last = self._known.shape[1] - 1
        at = np.searchsorted(self._flat, self._squeeze(t2) + self._row, side="right") - 1 - self._row * (last + 1)
        at = np.clip(at, 0, last)
        low, high = self._known[self._row, at], self._known[self._row, np.minimum(at + 1, last)]
        share = np.clip((t2 - low) / np.where(high > low, high - low, 1.0), 0.0, 1.0)
        within = (1.0 - share) * self._score[at] + share * self._score[np.minimum(at + 1, last)]
        beyond = self._score[last] * t2 / np.maximum(self._known[:, last], 1e-300)
        score = np.where(at == last, beyond, within)
        return np.asarray(white * np.sqrt(score / np.maximum(t2, 1e-300))[..., None])


def ordinary(d: int) -> float:
    """T^2 of d residuals above which a group is unusual."""
    return float(d + 3.0 * np.sqrt(2.0 * d))


def bounded(white: Real) -> Real:
    """Residuals (..., d) of ordinary length at most: no single group moves a mean by more."""
    t2 = np.sum(white**2, axis=-1)
    return np.asarray(white * np.sqrt(np.minimum(1.0, ordinary(white.shape[-1]) / np.maximum(t2, 1e-300)))[..., None])


class _Chart:
    """The values of the charts group by group, of one campaign or many: ranked residuals (..., d).

    `joined`: which of the groups before the newest were taken with it, the oldest first; `waits`: is the newest held?
    """

    def __init__(self, shape: tuple[int, ...], needed: int) -> None:
        never = np.zeros(shape[:-1], dtype=np.bool_)
        self._state, self._needed = np.zeros(shape), needed
        self._held, self._waiting, self._unusual = [np.zeros(shape)] * needed, [never] * needed, [never] * needed
        self._row = [np.zeros(shape[:-1])] * (needed + 1)
        self.joined, self.waits = self._waiting, never
        d = shape[-1]
        self._ordinary, self._far = ordinary(d), d + 6.0 * np.sqrt(2.0 * d) + 15.0

    def _take(self, white: Real, flags: Any) -> None:
        """One more group where the flags are set."""
        new = (1.0 - MEMORY) * self._state + MEMORY * bounded(white)
        self._state = np.where(flags[..., None], new, self._state)
        row = [*self._row[1:], np.sum(white**2, axis=-1)]
        self._row = [np.where(flags, one, old) for one, old in zip(row, self._row, strict=True)]

    def add(self, white: Real, far: Any = False) -> tuple[Real, Real]:
        """T^2 (...,) of groups in a row, of the mean.

        An outlying group waits, so does an unusual one behind it (with at most one between), until there are enough.
        """
        single = np.sum(white**2, axis=-1)
        far = far | (single > self._far)
        unusual = [*self._unusual, far | (single > self._ordinary)]
        enough = np.sum(unusual, axis=0) >= self._needed
        self.waits = ~enough & unusual[-1] & (far | self._waiting[-1] | self._waiting[-2])
        self.joined = [enough & waited for waited in self._waiting]
        for held, joined in zip(self._held, self.joined, strict=True):
            if np.any(joined):
                self._take(held, joined)
        self._take(white, ~self.waits)
        self._waiting = [one & ~enough for one in [*self._waiting[1:], self.waits]]
        self._unusual, self._held = unusual[1:], [*self._held[1:], white]
        row = np.where(self.waits, 0.0, np.partition(self._row, 1, axis=0)[1])
        return row, np.sum(self._state**2, axis=-1) * (2.0 - MEMORY) / MEMORY


def charts(scored: Real, far: Flags, needed: int) -> Charts:
    """The charts of ranked residuals (n, d) in the order of time, the mean beginning at 0.

    `far` (n,): groups that would have been left out of the training.
    """
    n, d = scored.shape
    chart, values, alone = _Chart((d,), needed), np.zeros((2, n)), np.zeros(n, dtype=np.bool_)
    for k in range(n):
        values[:, k] = chart.add(scored[k], far[k])
        alone[k] = chart.waits
        for back, joined in zip(range(needed, 0, -1), chart.joined, strict=True):
            if joined:
                alone[k - back] = False
    return Charts(values[0], values[1], alone)


def groups_needed(wrong: int, groups: int, per_year: int, false_alarm_per_year: float) -> int:
    """How many outlying groups, of one more in a row, are a change: so many that wrong groups, as frequent as the
    training lets expect (Jeffreys' estimate), are by chance in a year with at most a tenth of the probability of a
    false alarm; three to five."""
    share = (wrong + 0.5) / (groups + 1.0)
    for count in range(LEAST_NEEDED, MOST_NEEDED):
        if per_year * count * share**count <= _BY_CHANCE * false_alarm_per_year:
            return count
    return MOST_NEEDED


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
        left = np.where(seen, y - weight * (X @ self.coefficients), 0.0)
        self.variance, self.correlation = spread_of(left, weight, X.shape[1])
        self.root = np.linalg.inv(np.linalg.cholesky(self.correlation))
        z = left / np.sqrt(self.variance[:, None] * spread_at(leverage(X, model, weight), True))
        self.ranks = Ranks(whitened(filled(z, seen, self.correlation), self.correlation)[:, np.any(seen, axis=1)])
        self._guesses: dict[bytes, Real] = {}

    def white(self, now: Real, x: Real, weight: Real, lever: Real) -> Real:
        """Residuals `now` (count, d) of one more group, as standardised() and the ranks give them."""
        z = (now - weight * (x @ self.coefficients)) / np.sqrt(self.variance * spread_at(lever, False))
        seen = weight > 0
        if not np.all(seen):
            key, R = seen.tobytes(), self.correlation
            if key not in self._guesses:
                self._guesses[key] = np.asarray(np.linalg.solve(R[:, seen][:, :, seen], R[:, seen][:, :, ~seen]))
            z[:, ~seen] = (z[:, None, seen] @ self._guesses[key])[:, 0]
        return self.ranks.scored((self.root @ z[:, :, None])[:, :, 0])


def limits(
    training: tuple[Real, Real], watched: tuple[Real, Real], model: Regression, per_year: int,
    false_alarm_per_year: float, needed: int, seed: int,
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
        chart, top = _Chart((now, len(model.persistence)), needed), np.zeros((2, now))
        for k in range(per_year):
            white = learned.white(null.step(), year[k], weight[k], lever[k])
            np.maximum(top, chart.add(white), out=top)
        largest.append(top)
    t2, mean = np.quantile(np.hstack(largest), 1.0 - false_alarm_per_year / 2.0, axis=1, method="weibull").tolist()
    return Limits(t2, mean, needed, count, per_year)
