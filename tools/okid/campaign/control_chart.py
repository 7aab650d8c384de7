# SPDX-License-Identifier: MIT
"""Control charts of standardised residuals, with limits for a stated probability of a false alarm in a year.

Two charts: T^2 of every group (sudden change), and the same of an exponentially weighted mean (small change that stays;
Lowry et al. 1992). Limits are not read from tables: years without damage are simulated through the same regression on
the same temperatures, with as few training groups and with the persistence of the residuals (Gaussian, first order);
the limit is the quantile of the largest value of a year. Half of the probability goes to each chart.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from okid.campaign.trend_model import Regression, leverage

Real = NDArray[np.float64]
MEMORY = 0.2  # weight of the newest group in the mean
MOST_IN_YEAR = 20_000
_SIMULATED, _SIMULATED_LONG, _LONG = 4000, 1500, 2000


class Limits(NamedTuple):
    """Limits of both charts; `simulated` years behind them, of `per_year` groups each."""

    t2: float
    mean: float
    simulated: int
    per_year: int


class Charts(NamedTuple):
    """T^2 (n,) of each group and of the weighted mean, NaN before the training ends."""

    t2: Real
    mean: Real


def charts(white: Real) -> Charts:
    """Both charts of standardised residuals (n, d) in the order of time, the mean beginning at 0."""
    t2 = np.sum(white**2, axis=1)
    mean, state = np.empty(len(white)), np.zeros(white.shape[1])
    for k, one in enumerate(white):
        state = (1.0 - MEMORY) * state + MEMORY * one
        mean[k] = state @ state
    return Charts(t2, mean * (2.0 - MEMORY) / MEMORY)


class _Null:
    """Simulated campaigns without damage: `count` of them at a time, d residuals of unit variance with persistence."""

    def __init__(self, rng: np.random.Generator, count: int, persistence: Real) -> None:
        self._rng, self._rho = rng, persistence
        self._fresh = np.sqrt(1.0 - persistence**2)
        self._now = rng.standard_normal((count, len(persistence)))

    def step(self) -> Real:
        """Residuals of the next group (count, d)."""
        self._now = self._rho * self._now + self._fresh * self._rng.standard_normal(self._now.shape)
        return self._now


def _trained(null: _Null, X: Real, count: int) -> tuple[Real, Real]:
    """Training of each campaign: coefficients (count, k, d), and the inverse root of the covariance (count, d, d)."""
    y = np.stack([null.step() for _ in range(len(X))], axis=1)
    projector = np.linalg.solve(X.T @ X, X.T)
    coefficients = projector @ y
    residual = y - X @ coefficients
    covariance = residual.transpose(0, 2, 1) @ residual / (len(X) - X.shape[1])
    return coefficients, np.linalg.inv(np.linalg.cholesky(covariance))


def limits(
    X_training: Real, X_watched: Real, model: Regression, per_year: int, false_alarm_per_year: float, seed: int
) -> Limits:
    """Limits for P(any alarm in a year of `per_year` groups) = `false_alarm_per_year` without damage.

    `X_watched` (n, k): temperatures of the year, repeated as often as it takes. Cost: some thousand simulated years.
    """
    per_year = min(max(1, per_year), MOST_IN_YEAR)
    count = _SIMULATED if per_year <= _LONG else _SIMULATED_LONG
    rows = X_watched if len(X_watched) else X_training
    year = rows[np.arange(per_year) % len(rows)]
    shrink = 1.0 / np.sqrt(1.0 + leverage(year, model))
    rng = np.random.default_rng([seed, 7])
    largest_t2, largest_mean = [], []
    at_once = max(50, min(count, 4_000_000 // (len(X_training) * len(model.persistence))))
    for first in range(0, count, at_once):
        now = min(at_once, count - first)
        null = _Null(rng, now, model.persistence)
        coefficients, root = _trained(null, X_training, now)
        top, top_mean = np.zeros(now), np.zeros(now)
        state = np.zeros((now, len(model.persistence)))
        for k in range(per_year):
            raw = null.step() - year[k] @ coefficients
            white = (root @ raw[:, :, None])[:, :, 0] * shrink[k]
            state = (1.0 - MEMORY) * state + MEMORY * white
            np.maximum(top, np.sum(white**2, axis=1), out=top)
            np.maximum(top_mean, np.sum(state**2, axis=1), out=top_mean)
        largest_t2.append(top)
        largest_mean.append(top_mean * (2.0 - MEMORY) / MEMORY)
    share = 1.0 - false_alarm_per_year / 2.0
    return Limits(
        float(np.quantile(np.concatenate(largest_t2), share)), float(np.quantile(np.concatenate(largest_mean), share)),
        count, per_year,
    )  # fmt: skip
