# SPDX-License-Identifier: MIT
"""Is what the model leaves over noise? Correlations of the innovation with itself and with the inputs, with bounds."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.special import bdtr, chdtrc, ndtri  # scipy.stats takes a second to load

Real = NDArray[np.float64]
BOUND_95, BOUND_99 = float(ndtri(0.975)), float(ndtri(0.995))
SMALL = 0.1  # a correlation below this explains less than 1 % of the variance


class Whiteness(NamedTuple):
    """Correlations of the innovation e.

    auto (lags + 1, n_y): of each output with itself, 1 at lag 0. cross (2 lags + 1, n_y, n_u): e(t) with u(t - lag),
    lag from -lags to lags. used (n_y,): samples in them. cross_unit (n_y, n_u): the standard deviation of `cross` were
    e independent of u. p_value (n_y,): of the Ljung-Box test over all lags. rms (n_y,): of e, unit of the output.
    """

    auto: Real
    cross: Real
    used: NDArray[np.int64]
    cross_unit: Real
    p_value: Real
    rms: Real

    @property
    def lags(self) -> int:
        """The largest lag, samples."""
        return len(self.auto) - 1

    def verdict(self, output: int) -> str:
        """ "white", "nearly white" (significant, but every correlation below 0.1) or "not white"."""
        if self.p_value[output] >= 0.01:
            return "white"
        return "nearly white" if np.max(np.abs(self.auto[1:, output])) < SMALL else "not white"

    def beyond(self, output: int, into: int) -> tuple[int, int]:
        """Lags >= 0 at which e and u correlate beyond the 99 % bound, and how many chance allows (in 1 of 1000)."""
        past = np.abs(self.cross[self.lags :, output, into])
        allowed = int(np.argmax(bdtr(np.arange(len(past) + 1), len(past), 0.01) >= 0.999))
        return int(np.sum(past > BOUND_99 * self.cross_unit[output, into])), allowed


def _sums(first: Real, second: Real, lags: int) -> Real:
    """sum over t of second(t) first(t - k), k = 0 .. lags: (lags + 1, columns of second, columns of first)."""
    out = np.zeros((lags + 1, second.shape[1], first.shape[1]))
    for k in range(min(lags, len(first) - 1) + 1):
        out[k] = second[k:].T @ first[: len(first) - k]
    return out


def whiteness(pieces: Sequence[tuple[Real, Real]], lags: int) -> Whiteness | None:
    """Correlations over stretches (e (N, n_y), u (N, n_u)) up to `lags` samples; NaN in e carries no weight.

    None when no output has ten samples a lag. Centred by the mean of all stretches. Cost: N lags n_y (n_y + n_u).
    Source: Ljung and Box (1978); bounds of the cross-correlation by Bartlett's formula (Ljung, System Identification).
    """
    e, u = np.vstack([one for one, _ in pieces]), np.vstack([one for _, one in pieces])
    count = np.sum(np.isfinite(e), axis=0)
    if lags < 1 or np.min(count) < 10 * lags:
        return None
    e_mean, u_mean = np.nanmean(e, axis=0), np.mean(u, axis=0)
    n_y, n_u = e.shape[1], u.shape[1]
    own, hits = np.zeros((lags + 1, n_y)), np.zeros((lags + 1, n_y))
    push = np.zeros((lags + 1, n_u))
    cross = np.zeros((2 * lags + 1, n_y, n_u))
    for e_part, u_part in pieces:
        there = np.isfinite(e_part)
        error, drive = np.where(there, e_part - e_mean, 0.0), u_part - u_mean
        for k in range(min(lags, len(error) - 1) + 1):
            own[k] += np.sum(error[k:] * error[: len(error) - k], axis=0)
            hits[k] += np.sum(there[k:] & there[: len(error) - k], axis=0)
            push[k] += np.sum(drive[k:] * drive[: len(drive) - k], axis=0)
        if n_u:
            cross[lags:] += _sums(drive, error, lags)
            cross[: lags + 1] += _sums(error, drive, lags)[::-1].transpose(0, 2, 1)
            cross[lags] -= error.T @ drive  # lag 0 is in both
    power, strength = np.maximum(own[0], 1e-300), np.maximum(push[0], 1e-300)
    auto = own / power * np.where(hits > 0, count / np.maximum(hits, 1), 0.0)
    cross /= np.sqrt(power[:, None] * strength)
    spread = 1.0 + 2.0 * np.einsum("ky,ku->yu", own[1:] / power, push[1:] / strength)
    unit = np.sqrt(np.maximum(spread, 0.05) / count[:, None])
    weights = count * (count + 2.0) / np.maximum(count - np.arange(1, lags + 1)[:, None], 1.0)
    statistic = np.sum(weights * auto[1:] ** 2, axis=0)
    return Whiteness(auto, cross, count, unit, chdtrc(lags, statistic), np.sqrt(power / np.maximum(count, 1)))
