# SPDX-License-Identifier: MIT
"""Frequencies over temperature: a least-squares line (or parabola) of a training period, and what is left.

Every mode has its own rows and weights: a mode that a group does not show (weight 0) takes nothing from the others.
"""

from __future__ import annotations

from math import inf, lgamma, log, pi
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Real = NDArray[np.float64]
Flags = NDArray[np.bool_]
_LEAST_EIGENVALUE = 0.02  # of a correlation matrix whose entries come from different rows
_TAILS = (3.0, 3.5, 4.0, 5.0, 6.0, 8.0, 12.0, 20.0)  # degrees of freedom; the variance is finite
_FAR = 8.0  # robust standard deviations: such a row of the training is an accident


class Regression(NamedTuple):
    """Fit of d columns on k regressors by n training rows, each with its weight.

    coefficients (k, d) about `centre_c`, and their standard deviations; variance (d,) of the residuals of weight 1 with
    freedom (d,) degrees of freedom, correlation (d, d) shrunk to none; inverse (d, k, k) of X'WX; persistence (d,):
    lag-1 correlation of the residuals, 0 .. 0.95; tails: degrees of freedom of their Student's t, inf = Gaussian.
    """

    coefficients: Real
    deviations: Real
    centre_c: float
    variance: Real
    correlation: Real
    inverse: Real
    freedom: Real
    persistence: Real
    lag1: Real
    tails: float


def design(temperature: Real | None, centre_c: float, order: int, count: int) -> Real:
    """Regressors (count, k): 1 and powers of the temperature about `centre_c`, in units of 10 °C."""
    if temperature is None:
        return np.ones((count, 1))
    return np.column_stack([((temperature - centre_c) / 10.0) ** power for power in range(order + 1)])


def inverses(X: Real, weight: Real) -> Real:
    """(X' W X)^-1 of each column (d, k, k); weight (n, d): 1 / the standard deviation of a residual."""
    return np.linalg.inv(np.einsum("nk,nd,nl->dkl", X, weight**2, X))


def spread_of(residual: Real, weight: Real, k: int) -> tuple[Real, Real]:
    """Variance (..., d), shrunk correlation (..., d, d) of weighted residuals (..., n, d), 0 where one is missing."""
    seen = (weight > 0).astype(np.float64)
    freedom = seen.sum(axis=0) - k
    moments = np.swapaxes(residual, -1, -2) @ residual
    power = np.swapaxes(residual**2, -1, -2) @ seen  # of column i over the rows of column j
    bound = np.sqrt(power * np.swapaxes(power, -1, -2))
    d = residual.shape[-1]
    shrink = min(1.0, d / float(np.mean(freedom)))
    R = (1.0 - shrink) * moments / np.where(bound > 0.0, bound, 1.0)
    R[..., np.arange(d), np.arange(d)] = 1.0
    if np.any(seen == 0.0):
        values, vectors = np.linalg.eigh(R)
        R = (vectors * np.maximum(values, _LEAST_EIGENVALUE)[..., None, :]) @ np.swapaxes(vectors, -1, -2)
    return moments[..., np.arange(d), np.arange(d)] / freedom, R


def fit(y: Real, X: Real, centre_c: float, weight: Real) -> Regression:
    """Weighted least squares of y (n, d) on X (n, k); the lag-1 correlation is freed of its bias in small samples."""
    k, seen = X.shape[1], weight > 0
    inverse = inverses(X, weight)
    known = np.where(seen, y, 0.0)
    coefficients = np.einsum("dkl,nl,nd->kd", inverse, X, weight**2 * known)
    residual = np.where(seen, weight * (known - X @ coefficients), 0.0)
    variance, correlation = spread_of(residual, weight, k)
    power = np.sum(residual**2, axis=0)
    lag1 = np.sum(residual[1:] * residual[:-1], axis=0) / np.where(power > 0.0, power, 1.0)
    n = seen.sum(axis=0)
    persistence = np.clip(lag1 + (k + 3.0 * lag1) / n, 0.0, 0.95)
    deviations = np.sqrt(np.einsum("dkk->kd", inverse) * variance)
    fresh = residual[1:] - persistence * residual[:-1]
    tails = tails_of([fresh[seen[1:, j] & seen[:-1, j], j] for j in range(y.shape[1])])
    return Regression(
        coefficients, deviations, centre_c, variance, correlation, inverse, n - k, persistence, lag1, tails
    )


def tails_of(columns: list[Real]) -> float:
    """Degrees of freedom of the Student's t that is likeliest for all columns, each with its own scale.

    Gaussian (inf) unless the likelihood speaks for tails by more than the one parameter that they cost (Akaike 1974).
    """
    columns = [one for one in columns if len(one) > 2 and np.any(one != 0.0)]

    def likelihood(nu: float) -> float:
        total = 0.0
        for one in columns:
            scale = float(np.mean(one**2))
            for _ in range(50):  # of the scale, by its own fixed point
                scale = float(np.mean((nu + 1.0) * one**2 / (nu + one**2 / scale)))
            constant = lgamma((nu + 1.0) / 2.0) - lgamma(nu / 2.0) - 0.5 * log(nu * pi * scale)
            total += len(one) * constant - (nu + 1.0) / 2.0 * float(np.sum(np.log1p(one**2 / (nu * scale))))
        return total

    gaussian = -0.5 * sum(len(one) * (log(2.0 * pi * float(np.mean(one**2))) + 1.0) for one in columns)
    best = max(_TAILS, key=likelihood)
    return best if likelihood(best) - gaussian > 1.0 else inf


def far_rows(y: Real, X: Real, weight: Real) -> Flags:
    """Values (n, d) far from what the others of their column tell: least absolute deviations, then the median."""
    out = np.zeros(y.shape, dtype=np.bool_)
    for j in range(y.shape[1]):
        rows = np.flatnonzero(weight[:, j] > 0)
        Xw, yw = weight[rows, j, None] * X[rows], weight[rows, j] * y[rows, j]
        scale, b = float(np.std(yw)), np.linalg.lstsq(Xw, yw, rcond=None)[0]
        for _ in range(30):
            w = 1.0 / np.sqrt(np.maximum(np.abs(yw - Xw @ b), 1e-6 * scale + 1e-300))
            b = np.linalg.lstsq(w[:, None] * Xw, w * yw, rcond=None)[0]
        left = np.abs(yw - Xw @ b)
        usual = 1.4826 * float(np.median(left)) * np.sqrt(len(rows) / max(1, len(rows) - X.shape[1]))
        out[rows, j] = left > _FAR * usual if usual > 0.0 else False
    return out


def filled(z: Real, seen: Flags, correlation: Real) -> Real:
    """Standardised residuals (..., n, d) with what is missing (seen (n, d) false) as the others of its row expect it.

    z' R^-1 z of such a row is that of the columns that were seen alone.
    """
    out = np.where(seen, z, 0.0)
    patterns, which = np.unique(seen, axis=0, return_inverse=True)
    for p, pattern in enumerate(patterns):
        if np.all(pattern) or not np.any(pattern):
            continue
        rows = np.flatnonzero(which.ravel() == p)
        guess = np.linalg.solve(correlation[np.ix_(pattern, pattern)], correlation[np.ix_(pattern, ~pattern)])
        out[..., rows[:, None], np.flatnonzero(~pattern)] = out[..., rows[:, None], np.flatnonzero(pattern)] @ guess
    return out


def whitened(z: Real, correlation: Real) -> Real:
    """Rows (..., d) without the correlation of their columns."""
    return z @ np.linalg.inv(np.linalg.cholesky(correlation)).T


def standardised(y: Real, X: Real, model: Regression, weight: Real) -> Real:
    """Residuals (n, d) over their standard deviation and that of the fit at that temperature, filled and whitened.

    Of a new row of the same structure each is about N(0, 1): the whole row has the squared length T^2.
    """
    seen = weight > 0
    left = weight * (np.where(seen, y, 0.0) - X @ model.coefficients)
    z = left / np.sqrt(model.variance * (1.0 + leverage(X, model, weight)))
    return whitened(filled(z, seen, model.correlation), model.correlation)


def leverage(X: Real, model: Regression, weight: Real) -> Real:
    """w^2 x' (X'WX)^-1 x of each row and column (n, d): how far its temperature lies from those of the training."""
    return np.asarray(weight**2 * np.einsum("nk,dkl,nl->nd", X, model.inverse, X))
