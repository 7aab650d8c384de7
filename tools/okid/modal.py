# SPDX-License-Identifier: MIT
"""Mode shapes and poles: modal assurance, phase collinearity, poles of a discrete model."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from okid._errors import InputError
from okid.shown.notebook_html import own_fields

Real = NDArray[np.float64]
Complex = NDArray[np.complex128]


def mac_matrix(a: ArrayLike, b: ArrayLike | None = None) -> Real:
    """Modal assurance criterion of every shape in `a` (modes, n_y) with every shape in `b` (default: a itself).

    |a^H b|^2 / (a^H a)(b^H b), 0..1; a zero shape gives 0, and an entry that is missing (NaN) in one of them counts in
    none. Raises InputError when the lengths differ.
    """
    first = np.atleast_2d(np.asarray(a, dtype=np.complex128))
    second = first if b is None else np.atleast_2d(np.asarray(b, dtype=np.complex128))
    if first.shape[1] != second.shape[1]:
        raise InputError(f"shapes have {first.shape[1]} and {second.shape[1]} entries: they cannot be compared")
    there = np.all(np.isfinite(first), axis=0) & np.all(np.isfinite(second), axis=0)
    first, second = first[:, there], second[:, there]
    cross = np.abs(first.conj() @ second.T) ** 2
    power = np.outer(np.sum(np.abs(first) ** 2, axis=1), np.sum(np.abs(second) ** 2, axis=1))
    return np.asarray(np.divide(cross, power, out=np.zeros_like(cross), where=power > 0.0), dtype=np.float64)


def mac(a: ArrayLike, b: ArrayLike) -> float:
    """Modal assurance criterion of two shapes of n_y entries.

    >>> from okid import modal
    >>> round(modal.mac([1.0, 0.5, 0.2], [2.0, 1.0, 0.4]), 6), round(modal.mac([1.0, 0.0], [0.0, 1.0]), 6)
    (1.0, 0.0)
    """
    return float(mac_matrix(a, b)[0, 0])


def mpc(shape: ArrayLike) -> float:
    """Modal phase collinearity 0..1 of one complex shape: 1 = all entries on one line through the origin.

    ((Sxx - Syy)^2 + 4 Sxy^2) / (Sxx + Syy)^2 with the sums of real and imaginary parts about zero.
    """
    x = np.asarray(shape, dtype=np.complex128)
    x = x[np.isfinite(x)]
    sxx, syy, sxy = float(x.real @ x.real), float(x.imag @ x.imag), float(x.real @ x.imag)
    total = sxx + syy
    return ((sxx - syy) ** 2 + 4.0 * sxy**2) / total**2 if total > 0.0 else 0.0


def mean_phase(shape: ArrayLike) -> float:
    """Angle in rad, -pi/2 .. pi/2, of the line through the origin that lies nearest to the entries of a shape."""
    x = np.asarray(shape, dtype=np.complex128)
    x = x[np.isfinite(x)]
    return float(0.5 * np.angle(np.sum(x**2))) if np.any(x != 0.0) else 0.0


def mpd(shape: ArrayLike) -> float:
    """Mean phase deviation in degrees, 0 .. 90: how far the entries of one complex shape lie off their mean line,
    weighted by their size. Source: Phillips, Allemang (1993); Reynders, Houbrechts, De Roeck (2012).

    >>> from okid import modal
    >>> round(modal.mpd([1.0, -0.5, 0.25]), 6), round(modal.mpd([1.0, 1.0j]), 1)
    (0.0, 45.0)
    """
    x = np.asarray(shape, dtype=np.complex128)
    x = x[np.isfinite(x)]
    size = np.abs(x)
    if float(np.sum(size)) == 0.0:
        return 0.0
    turned = x * np.exp(-1j * mean_phase(x))
    angle = np.arctan2(np.abs(turned.imag), np.abs(turned.real))
    return float(np.degrees(np.sum(size * angle) / np.sum(size)))


def mcf(shape: ArrayLike) -> float:
    """Modal complexity factor 0 .. 1 of one complex shape, 1 - mpc: 0 = a real mode. Source: Imregun, Ewins (1995)."""
    return 1.0 - mpc(shape)


def real_shape(shape: ArrayLike) -> Real:
    """The shape turned to its mean phase, its real part, largest entry 1 in size: the nearest real mode.

    Entries across the mean phase count little, as they do in mpc.
    """
    x = np.asarray(shape, dtype=np.complex128)
    turned = np.asarray((x * np.exp(-1j * mean_phase(x))).real, dtype=np.float64)
    largest = turned[np.argmax(np.nan_to_num(np.abs(turned)))]
    return turned / largest if largest != 0.0 else turned


def mean_shape(shapes: ArrayLike) -> Complex:
    """One shape out of several estimates (k, n_y) of it: brought to one scale, averaged with their MPC as weights,
    largest entry 1; an entry that is missing (NaN) counts in none. A complex estimate, as of noise, weighs little.

    >>> from okid import modal
    >>> modal.mean_shape([[1.0, 0.5], [-2.0, -1.0], [1.0, 1.0j]]).round(3).real.tolist()
    [1.0, 0.5]
    """
    given = np.atleast_2d(np.asarray(shapes, dtype=np.complex128))
    first = given[int(np.argmax([mpc(one) for one in given]))]
    total, weight = np.zeros(given.shape[1], np.complex128), np.zeros(given.shape[1])
    for one in given:
        both = np.isfinite(one) & np.isfinite(first)
        power = float(np.vdot(one[both], one[both]).real)
        if power > 0.0:
            scaled, there = one * (np.vdot(one[both], first[both]) / power), np.isfinite(one)
            total[there] += mpc(one) * scaled[there]
            weight[there] += mpc(one)
    out = np.full(len(total), np.nan + 0.0j)
    np.divide(total, weight, out=out, where=weight > 0.0)
    return normalised(out)


def comac(a: ArrayLike, b: ArrayLike) -> Real:
    """Coordinate MAC (n_y,) of paired shapes a and b (modes, n_y): the sensors that two tests differ at.

    (sum over modes of |a_k conj(b_k)|)^2 / (sum |a_k|^2 sum |b_k|^2), 0 .. 1; shapes are brought to one scale first.
    Source: Lieven, Ewins (1988). Raises InputError when the shapes do not pair.
    """
    first, second = (np.atleast_2d(np.asarray(x, dtype=np.complex128)) for x in (a, b))
    if first.shape != second.shape:
        raise InputError(f"shapes of {first.shape} and {second.shape} do not pair, expected (modes, n_y) twice")
    first, second = (x / np.maximum(np.linalg.norm(x, axis=1, keepdims=True), 1e-300) for x in (first, second))
    cross = np.sum(np.abs(first * second.conj()), axis=0) ** 2
    power = np.sum(np.abs(first) ** 2, axis=0) * np.sum(np.abs(second) ** 2, axis=0)
    return np.asarray(np.divide(cross, power, out=np.zeros_like(cross), where=power > 0.0), dtype=np.float64)


def normalised(shape: ArrayLike) -> Complex:
    """The shape scaled so that its largest entry is 1 (a zero shape stays)."""
    x = np.asarray(shape, dtype=np.complex128)
    largest = x[np.argmax(np.nan_to_num(np.abs(x)))]
    return x / largest if largest != 0.0 else x


class Poles(NamedTuple):
    """Underdamped pairs, ascending in frequency: (modes,), (modes,), (modes, n_y)."""

    frequency_hz: Real
    damping_ratio: Real
    shapes: Complex

    def _repr_html_(self) -> str:
        return own_fields(self)


def poles(A: ArrayLike, C: ArrayLike, dt: float) -> Poles:
    """Frequencies, damping ratios and shapes of the pairs 0 < zeta < 1 of x+ = A x, y = C x below 99 % of Nyquist.

    lambda = log(mu)/dt, f = |lambda|/(2 pi), zeta = -Re lambda/|lambda| (paper eq. 104 onwards).
    """
    mu, psi = np.linalg.eig(np.asarray(A, dtype=np.float64))
    upper = mu.imag > 0.0
    lam = np.log(mu[upper].astype(np.complex128)) / dt
    size = np.abs(lam)
    zeta = -lam.real / size
    shapes = (np.asarray(C, dtype=np.float64) @ psi[:, upper]).T
    good = (zeta > 0.0) & (zeta < 1.0) & (np.abs(lam.imag) < 0.99 * np.pi / dt)
    rank = np.argsort(size[good])
    scaled = np.array([normalised(s) for s in shapes[good][rank]], dtype=np.complex128)
    return Poles(size[good][rank] / (2.0 * np.pi), zeta[good][rank], scaled.reshape(-1, shapes.shape[1]))
