# SPDX-License-Identifier: MIT
"""Frequency response functions: H1 with multiple coherence from records, and synthesised from a model."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.signal import get_window

from okid._errors import InputError

Real = NDArray[np.float64]
Complex = NDArray[np.complex128]


class Frf(NamedTuple):
    """Measured response functions.

    frequency_hz (F,), response (F, n_y, n_u), coherence (F, n_y): multiple coherence of each output with all inputs,
    NaN where there are not more averages than inputs. averages: segments used. resolution_hz: line spacing.
    """

    frequency_hz: Real
    response: Complex
    coherence: Real
    averages: int
    resolution_hz: float


def is_hit(u: ArrayLike, fraction: float = 0.05) -> bool:
    """True when 99 % of the energy of the inputs u (N, n_u) lies within `fraction` of the record: a hammer blow."""
    drive = np.nan_to_num(np.asarray(u, dtype=np.float64).reshape(len(np.asarray(u)), -1))
    power = np.sum((drive - np.median(drive, axis=0)) ** 2, axis=1)
    total = float(np.sum(power))
    if total == 0.0:
        return False
    width = max(1, int(fraction * len(power)))
    run = np.convolve(power, np.ones(width), mode="valid")
    return bool(np.max(run) > 0.99 * total)


def _segments(data: Real, length: int, step: int) -> list[Real]:
    """Pieces of `length` complete samples; a missing sample starts the search anew behind it."""
    broken = np.flatnonzero(~np.all(np.isfinite(data), axis=1))
    edges = np.concatenate(([-1], broken, [len(data)]))
    pieces = []
    for left, right in zip(edges[:-1], edges[1:], strict=True):
        for start in range(int(left) + 1, int(right) - length + 1, step):
            pieces.append(data[start : start + length])
    return pieces


def h1(
    u: ArrayLike | Sequence[ArrayLike],
    y: ArrayLike | Sequence[ArrayLike],
    fs: float,
    nperseg: int | None = None,
    window: str | None = None,
) -> Frf:
    """H1 estimate by Welch's method for all inputs together: G_yu G_uu^-1, averaged over segments and records.

    u (N, n_u) or 1-D, y (N, n_y) or 1-D, or lists of such arrays (several records); NaN = missing, segments avoid it.
    Default: Hann windows of about 1/8 of the record with half overlap; the whole record, no window, for hammer blows.
    Raises InputError when no complete segment is left. Source: Bendat and Piersol, multiple-input H1.
    """
    from okid.records import paired  # records imports nothing of this module

    inputs, outputs = paired(u, y)
    n_u = inputs[0].shape[1]
    shortest = min(len(one) for one in inputs)
    hit = all(is_hit(one) for one in inputs)
    if nperseg is None:
        nperseg = shortest if hit else min(shortest, 2 ** max(6, int(np.log2(max(shortest // 8, 1)))))
    shape = get_window(window or ("boxcar" if hit else "hann"), nperseg)
    n_y, lines, count = outputs[0].shape[1], nperseg // 2 + 1, 0
    guu, gyu = np.zeros((lines, n_u, n_u), np.complex128), np.zeros((lines, n_y, n_u), np.complex128)
    gyy = np.zeros((lines, n_y))
    for drive, answer in zip(inputs, outputs, strict=True):
        for piece in _segments(np.hstack([drive, answer]), nperseg, nperseg if hit else max(1, nperseg // 2)):
            spectrum = np.fft.rfft((piece - piece.mean(axis=0)) * shape[:, None], axis=0)
            fu, fy = spectrum[:, :n_u], spectrum[:, n_u:]
            guu += fu[:, :, None] * fu[:, None, :].conj()
            gyu += fy[:, :, None] * fu[:, None, :].conj()
            gyy += np.abs(fy) ** 2
            count += 1
    if count == 0:
        raise InputError(f"no {nperseg} consecutive complete samples for a response function: shorten nperseg")
    response: Complex = np.matmul(gyu, np.linalg.pinv(guu, rcond=1e-10, hermitian=True), dtype=np.complex128)
    coherence = np.full(gyy.shape, np.nan)
    if count > n_u:
        explained = np.einsum("fij,fij->fi", response, gyu.conj()).real
        np.divide(explained, gyy, out=coherence, where=gyy > 0.0)
    spacing = fs / nperseg
    return Frf(np.arange(lines, dtype=np.float64) * spacing, response, np.clip(coherence, 0.0, 1.0), count, spacing)


def synthesise(A: ArrayLike, B: ArrayLike, C: ArrayLike, D: ArrayLike, dt: float, frequency_hz: ArrayLike) -> Complex:
    """Response (F, n_y, n_u) of x+ = A x + B u, y = C x + D u: C (z I - A)^-1 B + D at z = exp(2 pi i f dt)."""
    a, b = np.asarray(A, dtype=np.float64), np.asarray(B, dtype=np.float64)
    c, d = np.asarray(C, dtype=np.float64), np.asarray(D, dtype=np.float64)
    z = np.exp(2j * np.pi * np.asarray(frequency_hz, dtype=np.float64) * dt)
    out = np.empty((len(z), len(c), b.shape[1]), dtype=np.complex128)
    eye = np.eye(len(a))
    for k, point in enumerate(z):
        out[k] = c @ np.linalg.solve(point * eye - a, b) + d
    return out


def cmif(response: Complex) -> Real:
    """Complex mode indicator: the largest singular value of the response matrix at each line, (F,)."""
    return np.asarray(np.linalg.svd(response, compute_uv=False)[:, 0], dtype=np.float64)
