# SPDX-License-Identifier: MIT
"""Frequencies over temperature: least squares of a training period, and what is left.

Every mode has its own rows and weights: a mode that a group does not show (weight 0) takes nothing from the others.
"""

from __future__ import annotations

from math import inf, lgamma, log, pi
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

Real = NDArray[np.float64]
Flags = NDArray[np.bool_]
_LEAST_EIGENVALUE = 0.02  # of a correlation matrix whose entries come from different rows
_TAILS = (3.0, 3.5, 4.0, 5.0, 6.0, 8.0, 12.0, 20.0)  # degrees of freedom; the variance is finite
_NEAR_ZERO = 0.05  # standard deviations: a residual that is less tells no more of the scatter
FAR = 8.0  # robust standard deviations: such a row of the training is an accident


class Regression(NamedTuple):
    """Fit of d columns on k regressors by n training rows, each with its weight.

    coefficients (k, d); variance (d,) of the residuals of weight 1 with freedom (d,) degrees of freedom, correlation
    (d, d) shrunk to none; inverse (d, k, k) of X'WX; persistence (d,): lag-1 correlation of the residuals, 0 .. 0.95;
    tails: degrees of freedom of their Student's t, inf = Gaussian.
    """

    coefficients: Real
    variance: Real
    correlation: Real
    inverse: Real
    freedom: Real
    persistence: Real
    lag1: Real
    tails: float


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


def fit(y: Real, X: Real, weight: Real) -> Regression:
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
    fresh = residual[1:] - persistence * residual[:-1]
    tails = tails_of([fresh[seen[1:, j] & seen[:-1, j], j] for j in range(y.shape[1])])
    return Regression(coefficients, variance, correlation, inverse, n - k, persistence, lag1, tails)


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
    most, best = max((likelihood(nu), nu) for nu in _TAILS)
    return best if most - gaussian > 1.0 else inf


def usual_spread(y: Real, X: Real, weight: Real) -> tuple[Real, Real]:
    """Robust standard deviations (d,) of the columns, and their residuals (n, d): of least absolute deviations, then
    the median; NaN where there is no value."""
    left, usual = np.full(y.shape, np.nan), np.zeros(y.shape[1])
    for j in range(y.shape[1]):
        rows = np.flatnonzero(weight[:, j] > 0)
        Xw, yw = weight[rows, j, None] * X[rows], weight[rows, j] * y[rows, j]
        scale, b = float(np.std(yw)), np.linalg.lstsq(Xw, yw, rcond=None)[0]
        for _ in range(30):
            w = 1.0 / np.sqrt(np.maximum(np.abs(yw - Xw @ b), 1e-6 * scale + 1e-300))
            b = np.linalg.lstsq(w[:, None] * Xw, w * yw, rcond=None)[0]
        left[rows, j] = yw - Xw @ b
        usual[j] = (
            1.4826 * float(np.median(np.abs(left[rows, j]))) * np.sqrt(len(rows) / max(1, len(rows) - X.shape[1]))
        )
    return usual, left


def far(residual: Real, usual: Any) -> Flags:
    """Residuals of weight 1 that are an accident by the usual spread of the training, of each column; NaN is none."""
    return np.asarray((np.abs(residual) > FAR * usual) & (usual > 0.0))


def scatter_slope(left: Real, usual: Real, temperature: Real) -> Real:
    """Change of the logarithm of the scatter with the regressor `temperature` (n,), of each column (d,) of residuals.

    Least squares of log |residual| (Harvey 1976); 0 where it is not above two of its standard deviations.
    """
    slope = np.zeros(left.shape[1])
    for j in np.flatnonzero(usual > 0.0):
        rows = np.isfinite(left[:, j])
        size = np.log(np.maximum(np.abs(left[rows, j]), _NEAR_ZERO * usual[j]))
        x = temperature[rows] - np.mean(temperature[rows])
        power = float(np.sum(x**2))
        if len(x) < 3 or power <= 0.0:
            continue
        found = float(np.sum(x * size)) / power
        rest = size - np.mean(size) - found * x
        deviation = np.sqrt(float(np.sum(rest**2)) / (len(x) - 2) / power)
        slope[j] = found if abs(found) > 2.0 * deviation else 0.0
    return slope


def filled(z: Real, seen: Flags, correlation: Real) -> Real:
    """Standardised residuals (..., n, d) with what is missing (seen (n, d) false) as the others of its row expect it.

    z' R^-1 z of such a row is that of the columns that were seen alone. `correlation` (..., d, d).
    """
    out = np.where(seen, z, 0.0)
    patterns, which = np.unique(seen, axis=0, return_inverse=True)
    for p, pattern in enumerate(patterns):
        if np.all(pattern) or not np.any(pattern):
            continue
        rows = np.flatnonzero(which.ravel() == p)
        known = correlation[..., pattern, :]
        guess = np.linalg.solve(known[..., pattern], known[..., ~pattern])
        out[..., rows[:, None], np.flatnonzero(~pattern)] = out[..., rows[:, None], np.flatnonzero(pattern)] @ guess
    return out


def whitened(z: Real, correlation: Real) -> Real:
    """Rows (..., d) without the correlation of their columns."""
    return np.asarray(z @ np.swapaxes(np.linalg.inv(np.linalg.cholesky(correlation)), -1, -2))


def standardised(y: Real, X: Real, model: Regression, weight: Real, fitted: bool = False) -> Real:
    """Residuals (n, d) over their standard deviation at that temperature, filled and whitened.

    Each is about N(0, 1): the whole row has the squared length T^2. `fitted`: the rows are those of the fit, whose
    residuals are smaller than the scatter by their leverage; those of new rows are larger.
    """
    seen = weight > 0
    left = weight * (np.where(seen, y, 0.0) - X @ model.coefficients)
    z = left / np.sqrt(model.variance * spread_at(leverage(X, model, weight), fitted))
    return whitened(filled(z, seen, model.correlation), model.correlation)


def leverage(X: Real, model: Regression, weight: Real) -> Real:
    """w^2 x' (X'WX)^-1 x of each row and column (n, d): how far its temperature lies from those of the training."""
    return np.asarray(weight**2 * np.einsum("nk,dkl,nl->nd", X, model.inverse, X))


def spread_at(lever: Real, fitted: bool) -> Real:
    """Variance of a residual with that leverage over the variance of the scatter."""
    return np.maximum(1.0 - lever, _LEAST_EIGENVALUE) if fitted else 1.0 + lever
