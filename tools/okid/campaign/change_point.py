# SPDX-License-Identifier: MIT
"""When did the structure change? The split of a series of residuals into two means, its probability, its interval."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from okid.campaign.trend_model import Regression, filled, whitened

Real = NDArray[np.float64]
_NULL, _BOOTSTRAP = 999, 400
_AT_ONCE = 4_000_000  # numbers
LEAST = 3  # groups on either side


class ChangePoint(NamedTuple):
    """`at`: first group after the change; `low`, `high`: 95 % interval of it; `p_value`: of no change at all.

    shift (d,): in the standardised units of the residuals.
    """

    at: int
    low: int
    high: int
    p_value: float
    statistic: float
    shift: Real


def _split(white: Real) -> tuple[NDArray[np.intp], Real]:
    """Best split of each of (c, n, d): first index of the second mean, and k (n-k)/n |difference of means|^2 there."""
    n = white.shape[1]
    sums = np.cumsum(white, axis=1)
    k = np.arange(LEAST, n - LEAST + 1)
    left = sums[:, k - 1] / k[None, :, None]
    right = (sums[:, -1:] - sums[:, k - 1]) / (n - k)[None, :, None]
    gain = np.sum((left - right) ** 2, axis=2) * (k * (n - k) / n)[None, :]
    best = np.argmax(gain, axis=1)
    return k[best], gain[np.arange(len(white)), best]


def _noise(rng: np.random.Generator, count: int, n: int, persistence: Real) -> Real:
    """Gaussian residuals (count, n, d) of unit variance with first-order persistence."""
    fresh = rng.standard_normal((count, n, len(persistence)))
    if not np.any(persistence > 0.0):
        return fresh
    out = fresh
    scale = np.sqrt(1.0 - persistence**2)
    for k in range(1, n):
        out[:, k] = persistence * out[:, k - 1] + scale * fresh[:, k]
    return out


def find_change(
    white: Real, training: NDArray[np.bool_], X: Real, weight: Real, model: Regression, seed: int
) -> ChangePoint | None:
    """The most probable single change of the mean of standardised residuals (n, d); None when there are too few.

    The probability without a change is that of simulated residuals, whose mean and temperature dependence were removed
    by the same fit on the same `training` rows (flags) of X (n, k), with the same values missing (weight 0); the
    interval is a parametric bootstrap of the shift that was found. Cost: O(1400 n d).
    """
    n, d = white.shape
    flags = training
    if n < 4 * LEAST or not np.any(flags):
        return None
    at, best = _split(white[None])
    k, statistic = int(at[0]), float(best[0])
    shift = white[k:].mean(axis=0) - white[:k].mean(axis=0)
    rng = np.random.default_rng([seed, 11])
    seen, root = weight > 0, np.linalg.cholesky(model.correlation).T
    learn = np.einsum("dkl,tl,td->dkt", model.inverse, X[flags], weight[flags])

    def residuals(count: int) -> Real:
        noise = np.where(seen, _noise(rng, count, n, model.persistence) @ root, 0.0)
        noise -= weight * (X @ np.einsum("dkt,ctd->ckd", learn, noise[:, flags], optimize=True))
        return whitened(filled(noise, seen, model.correlation), model.correlation)

    chunk = max(1, _AT_ONCE // (n * d))
    above, places = 0, []
    for first in range(0, _NULL, chunk):
        above += int(np.sum(_split(residuals(min(chunk, _NULL - first)))[1] >= statistic))
    step = np.zeros((n, d))
    step[k:] = shift
    for first in range(0, _BOOTSTRAP, chunk):
        noise = np.where(seen, _noise(rng, min(chunk, _BOOTSTRAP - first), n, model.persistence) @ root, 0.0)
        white_noise = whitened(filled(noise, seen, model.correlation), model.correlation)
        places.append(_split(white_noise + step)[0])
    low, high = np.quantile(np.concatenate(places), [0.025, 0.975])
    return ChangePoint(k, int(np.floor(low)), int(np.ceil(high)), (above + 1) / (_NULL + 1), statistic, shift)
