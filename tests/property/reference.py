# SPDX-License-Identifier: MIT
"""The tests' own slow identification in plain NumPy: explicit regressor matrix, least squares, eq. 40, ERA.

Written from the paper's equations with the corrections of numerics.md, independent of the library under test.
Samples stand in rows here: v is (N, m) with the inputs first. Regression rows that touch a missing sample are left
out, and there are no zero rows before the first sample (trap 4).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def lagged(records: Sequence[NDArray[np.floating]], p: int) -> Array:
    """Rows w_n = [v_n, v_(n-1), .., v_(n-p)] (rows, m(p+1)) over all records, rows with a missing sample dropped."""
    rows = []
    for v in records:
        for n in range(p, len(v)):
            window = v[n - p : n + 1][::-1]
            if np.all(np.isfinite(window)):
                rows.append(window.reshape(-1))
    m = records[0].shape[1]
    return np.array(rows, float).reshape(-1, m * (p + 1))


def gram(records: Sequence[NDArray[np.floating]], p: int, mean: bool, weights: Array | None = None) -> Array:
    """Sum of w w^T over the rows, centred by the (weighted) mean of each column when `mean`."""
    w = lagged(records, p)
    g = np.ones(len(w)) if weights is None else weights
    if mean:
        w = w - (g @ w) / g.sum()
    return (w * g[:, None]).T @ w


def gram_exact(codes: Sequence[NDArray[np.int16]], p: int) -> list[list[int]]:
    """The same sum with Python integers: no rounding at all."""
    m = codes[0].shape[1]
    size = m * (p + 1)
    total = [[0] * size for _ in range(size)]
    for v in codes:
        ints = [[int(x) for x in row] for row in v]
        for n in range(p, len(ints)):
            w = [x for lag in range(p + 1) for x in ints[n - lag]]
            for i in range(size):
                wi = w[i]
                row = total[i]
                for j in range(size):
                    row[j] += wi * w[j]
    return total


@dataclass
class Observer:
    """theta = [D, Ybar_1 .. Ybar_p] with Ybar_h = [Ybar^I_h, -Ybar^II_h] (n_y, q)."""

    theta: Array
    n_u: int
    n_y: int
    p: int
    ridge: float

    @property
    def feedthrough(self) -> Array:
        """D, (n_y, n_u)."""
        return self.theta[:, : self.n_u]

    def blocks(self) -> tuple[Array, Array]:
        """Ybar^I and Ybar^II of eq. 26, each (p, n_y, .): the minus sign of eq. 26 is taken out here (trap 2)."""
        m = self.n_u + self.n_y
        b = self.theta[:, self.n_u :].reshape(self.n_y, self.p, m).transpose(1, 0, 2)
        return b[:, :, : self.n_u], -b[:, :, self.n_u :]

    def radius(self) -> float:
        """Spectral radius of the ARX companion matrix."""
        _, ii = self.blocks()
        n = self.n_y
        companion = np.zeros((n * self.p, n * self.p))
        companion[:n] = -ii.transpose(1, 0, 2).reshape(n, -1)
        companion[n:, :-n] = np.eye(n * (self.p - 1))
        return float(np.max(np.abs(np.linalg.eigvals(companion))))


def observer(
    records: Sequence[NDArray[np.floating]],
    n_u: int,
    p: int,
    mean: bool = True,
    ridge: float = 0.0,
    weights: Array | None = None,
) -> Observer:
    """Least squares by np.linalg.lstsq on the explicit matrix, columns scaled to unit norm (eq. 36-39)."""
    w = lagged(records, p)
    g = np.ones(len(w)) if weights is None else weights
    if mean:
        w = w - (g @ w) / g.sum()
    w = w * np.sqrt(g)[:, None]
    m = records[0].shape[1]
    target = w[:, n_u:m]
    phi = np.delete(w, np.s_[n_u:m], axis=1)
    scale = np.linalg.norm(phi, axis=0)
    scaled = phi / scale
    if ridge > 0.0:
        q = phi.shape[1]
        scaled = np.vstack([scaled, np.sqrt(ridge) * np.eye(q)])
        target = np.vstack([target, np.zeros((q, m - n_u))])
    solution = np.linalg.lstsq(scaled, target, rcond=1e-13)[0]
    return Observer((solution / scale[:, None]).T, n_u, m - n_u, p, ridge)


def markov(obs: Observer, count: int, minus_sign: bool = True) -> Array:
    """Y_0 .. Y_count (count+1, n_y, n_u), eq. 40. `minus_sign` False shows what trap 2 does."""
    one, two = obs.blocks()
    if not minus_sign:
        two = -two
    y = np.zeros((count + 1, obs.n_y, obs.n_u))
    y[0] = obs.feedthrough
    for k in range(1, count + 1):
        if k <= obs.p:
            y[k] = one[k - 1]
        for h in range(1, min(k, obs.p) + 1):
            y[k] -= two[h - 1] @ y[k - h]
    return y


def hankel(y: Array, rows: int, cols: int, shift: int = 0) -> Array:
    """H(shift) with block (i, j) = Y_(1+i+j+shift), eq. 43, from system Markov parameters only (trap 1)."""
    _, n_y, n_u = y.shape
    h = np.empty((rows * n_y, cols * n_u))
    for i in range(rows):
        for j in range(cols):
            h[i * n_y : (i + 1) * n_y, j * n_u : (j + 1) * n_u] = y[1 + i + j + shift]
    return h


def era(y: Array, rows: int, order: int) -> tuple[Array, Array, Array, Array, Array]:
    """A, B, C, D and all singular values by SVD of H(0), eq. 48-54."""
    _, n_y, n_u = y.shape
    left, sigma, right = np.linalg.svd(hankel(y, rows, rows), full_matrices=False)
    root = np.sqrt(sigma[:order])
    obs = left[:, :order] * root
    con = root[:, None] * right[:order]
    core = left[:, :order].T @ hankel(y, rows, rows, 1) @ right[:order].T
    A = core / root[:, None] / root
    return A, con[:, :n_u], obs[:n_y], y[0], sigma


def modal(A: Array, C: Array, dt: float) -> tuple[Array, Array, NDArray[np.complex128]]:
    """Frequencies (Hz), damping ratios and shapes (modes, n_y) of the underdamped pairs below 99 % of Nyquist."""
    mu, psi = np.linalg.eig(A)
    keep = mu.imag > 0.0
    lam = np.log(mu[keep].astype(complex)) / dt
    f = np.abs(lam) / (2.0 * np.pi)
    zeta = -lam.real / np.abs(lam)
    shapes = (C @ psi[:, keep]).T
    good = (zeta > 0.0) & (zeta < 1.0) & (np.abs(lam.imag) < 0.99 * np.pi / dt)
    order = np.argsort(f[good])
    return f[good][order], zeta[good][order], shapes[good][order]


def mac(a: NDArray[np.complexfloating], b: NDArray[np.complexfloating]) -> float:
    """|a^H b|^2 / (a^H a)(b^H b)."""
    return float(abs(np.vdot(a, b)) ** 2 / (np.vdot(a, a).real * np.vdot(b, b).real))


def okid_era(
    records: Sequence[NDArray[np.floating]], n_u: int, p: int, rows: int, order: int, dt: float, mean: bool = True
) -> tuple[Array, Array, NDArray[np.complex128]]:
    """Everything in a row: modes of the model of the given order."""
    obs = observer(records, n_u, p, mean)
    A, _, C, _, _ = era(markov(obs, 2 * rows), rows, order)
    return modal(A, C, dt)
