# SPDX-License-Identifier: MIT
"""Frequencies over temperature: a least-squares line (or parabola) of a training period, and what is left."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Real = NDArray[np.float64]
Flags = NDArray[np.bool_]


class Regression(NamedTuple):
    """Fit of d columns on k regressors by n training rows.

    coefficients (k, d) about `centre_c`, and their standard deviations; covariance (d, d) of the residuals with n - k
    degrees of freedom; inverse (k, k) of X'X; persistence (d,): lag-1 correlation of the residuals, 0 .. 0.95.
    """

    coefficients: Real
    deviations: Real
    centre_c: float
    covariance: Real
    inverse: Real
    freedom: int
    persistence: Real
    lag1: Real


def design(temperature: Real | None, centre_c: float, order: int, count: int) -> Real:
    """Regressors (count, k): 1 and powers of the temperature about `centre_c`, in units of 10 °C."""
    if temperature is None:
        return np.ones((count, 1))
    return np.column_stack([((temperature - centre_c) / 10.0) ** power for power in range(order + 1)])


def fit(y: Real, X: Real, centre_c: float) -> Regression:
    """Least squares of y (n, d) on X (n, k), n > k; the lag-1 correlation is freed of its bias in small samples."""
    n, k = X.shape
    inverse = np.asarray(np.linalg.inv(X.T @ X), dtype=np.float64)
    coefficients = inverse @ X.T @ y
    residual = y - X @ coefficients
    covariance = residual.T @ residual / (n - k)
    power = np.sum(residual**2, axis=0)
    lag1 = np.sum(residual[1:] * residual[:-1], axis=0) / np.where(power > 0.0, power, 1.0)
    deviations: Real = np.sqrt(np.outer(np.diag(inverse), np.diag(covariance)))
    persistence = np.clip(lag1 + (k + 3.0 * lag1) / n, 0.0, 0.95)
    freedom = n - k
    return Regression(coefficients, deviations, centre_c, np.asarray(covariance), inverse, freedom, persistence, lag1)


def standardised(y: Real, X: Real, model: Regression) -> Real:
    """Residuals (n, d) whitened by the covariance, and shortened by the error of the fit at that temperature.

    Of a new row of the same structure each is about N(0, 1): the whole row has the squared length T^2.
    """
    root = np.linalg.cholesky(model.covariance)
    white = np.linalg.solve(root, (y - X @ model.coefficients).T).T
    return np.asarray(white / np.sqrt(1.0 + leverage(X, model))[:, None])


def leverage(X: Real, model: Regression) -> Real:
    """x' (X'X)^-1 x of each row (n,): how far its temperature lies from those of the training."""
    return np.asarray(np.einsum("nk,kl,nl->n", X, model.inverse, X))
