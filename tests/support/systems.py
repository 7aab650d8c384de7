# SPDX-License-Identifier: MIT
"""Virtual structures with known M, K, R for the property tests (SI units, all formulas written out here).

The tests keep their own simulator: nothing of the package under test is used.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import eigh, expm
from scipy.signal import lfilter

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Structure:
    """M q'' + R q' + K q = f, forces and sensors on chosen degrees of freedom (0-based)."""

    M: Array
    R: Array
    K: Array
    force_dofs: tuple[int, ...]
    sense_dofs: tuple[int, ...]
    dt: float
    sensing: tuple[str, ...] = ()  # of each sensor, all acceleration when empty

    @property
    def fs(self) -> float:
        """Sample rate, Hz."""
        return 1.0 / self.dt

    def modes(self) -> tuple[Array, Array]:
        """Undamped frequencies (Hz) and damping ratios; R must be proportional."""
        w2, phi = eigh(self.K, self.M)
        omega = np.sqrt(w2)
        zeta = np.einsum("ik,ij,jk->k", phi, self.R, phi) / (2.0 * omega)
        return omega / (2.0 * np.pi), zeta

    def discrete(self) -> tuple[Array, Array, Array, Array]:
        """A, B, C, D for a force held over the sample."""
        n = len(self.M)
        minv = np.linalg.inv(self.M)
        a_c = np.block([[np.zeros((n, n)), np.eye(n)], [-minv @ self.K, -minv @ self.R]])
        pick = np.eye(n)[:, list(self.force_dofs)]
        b_c = np.vstack([np.zeros((n, len(self.force_dofs))), minv @ pick])
        z = 2 * n + b_c.shape[1]
        big = np.zeros((z, z))
        big[: 2 * n, : 2 * n] = a_c
        big[: 2 * n, 2 * n :] = b_c
        step = expm(big * self.dt)
        first = {"displacement": 0, "velocity": 1, "acceleration": 2}  # block row of [q; q'; q'']
        motion = np.vstack([np.eye(2 * n), a_c[n:]]), np.vstack([np.zeros((2 * n, b_c.shape[1])), b_c[n:]])
        kinds = self.sensing or ("acceleration",) * len(self.sense_dofs)
        rows = [first[kind] * n + dof for kind, dof in zip(kinds, self.sense_dofs, strict=True)]
        return step[: 2 * n, : 2 * n], step[: 2 * n, 2 * n :], motion[0][rows], motion[1][rows]


def rayleigh(M: Array, K: Array, zeta: float = 0.01) -> tuple[Array, float]:
    """R = alpha M + beta K with the given ratio at the first and last mode, and the highest frequency in rad/s."""
    omega = np.sqrt(eigh(K, M, eigvals_only=True))
    ends = omega[[0, -1]]
    alpha, beta = np.linalg.solve(np.column_stack([0.5 / ends, 0.5 * ends]), [zeta, zeta])
    return alpha * M + beta * K, float(ends[1])


def chain(masses: list[float], springs: list[float]) -> tuple[Array, Array]:
    """Mass and stiffness of a chain whose first spring stands on the ground."""
    n = len(masses)
    K = np.zeros((n, n))
    for i, k in enumerate(springs):
        K[i, i] += k
        if i > 0:
            K[i - 1, i - 1] += k
            K[i, i - 1] -= k
            K[i - 1, i] -= k
    return np.diag(np.asarray(masses, float)), K


def _finish(M: Array, K: Array, forces: tuple[int, ...]) -> Structure:
    R, omega_max = rayleigh(M, K)
    return Structure(M, R, K, forces, tuple(range(len(M))), 0.6 * np.pi / omega_max)


def w1() -> Structure:
    """3 DOF chain, force at mass 1 (numerics.md)."""
    return _finish(*chain([1.0, 0.8, 1.2], [3e4, 2e4, 2.5e4]), (0,))


def w2() -> Structure:
    """6 DOF chain, forces at masses 1 and 4."""
    return _finish(*chain([2.0, 1.5, 1.8, 1.2, 1.6, 1.0], [8e4, 6e4, 7e4, 5e4, 5.5e4, 4e4]), (0, 3))


def w3() -> Structure:
    """10 DOF chain with mass coupling and braces, forces at 1, 5 and 10."""
    masses = np.linspace(4.0, 2.2, 10)
    M, K = chain(list(masses), list(np.linspace(4e5, 2e5, 10)))
    for i in range(9):
        M[i, i + 1] = M[i + 1, i] = 0.05 * masses[i]
    for i in range(8):
        K[np.ix_([i, i + 2], [i, i + 2])] += 3e4 * np.array([[1.0, -1.0], [-1.0, 1.0]])
    return _finish(M, K, (0, 4, 9))


def simulate(model: tuple[Array, Array, Array, Array], u: Array, x0: Array | None = None) -> Array:
    """y_n = C x_n + D u_n for u (N, n_u); returns (N, n_y). In modal coordinates, a first-order filter for each pole;
    sample by sample where the states of the model have no such coordinates (condition beyond 1e6)."""
    A, B, C, D = model
    x = np.zeros(len(A)) if x0 is None else np.array(x0, float)
    poles, V = np.linalg.eig(A)
    if np.linalg.cond(V) > 1e6:
        y = np.empty((len(u), len(C)))
        for n, drive in enumerate(u):
            y[n] = C @ x + D @ drive
            x = A @ x + B @ drive
        return y
    begin, drives = np.linalg.solve(V, x + 0j), np.linalg.solve(V, B + 0j) @ np.asarray(u, float).T
    states = [lfilter([0, 1], [1, -p], d, zi=[b])[0] for p, d, b in zip(poles, drives, begin, strict=True)]
    return np.real((C @ V) @ np.array(states)).T + u @ D.T


def record(s: Structure, samples: int, noise_percent: float, seed: int, x0: Array | None = None) -> tuple[Array, Array]:
    """White unit force and measured accelerations: u (N, n_u), y (N, n_y)."""
    rng = np.random.default_rng(seed)
    u = rng.standard_normal((samples, len(s.force_dofs)))
    y = simulate(s.discrete(), u, x0)
    sigma = noise_percent / 100.0 * np.sqrt(np.mean(y**2, axis=0))
    return u, y + sigma * rng.standard_normal(y.shape)


def w2_codes(samples: int) -> NDArray[np.int16]:
    """(samples, 8): two forces and six accelerations with 1 % noise, int16 at a quarter of full scale (peak)."""
    u, y = record(w2(), samples, 1.0, seed=11)
    data = np.hstack([u, y])
    return np.asarray(np.round(8000 * data / np.abs(data).max(axis=0)), np.int16)


def w2_frequencies(rate_hz: float) -> NDArray[np.float64]:
    """Of the same numbers when they are played at another rate."""
    return w2().modes()[0] * rate_hz / w2().fs
