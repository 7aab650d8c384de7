# SPDX-License-Identifier: MIT
"""okid.demo(): a 3-storey frame on the computer, shaken, measured and identified."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import expm

from okid.identify import identify
from okid.result import Result

Real = NDArray[np.float64]


def frame() -> tuple[Real, Real, Real]:
    """Mass (kg), damping (N s/m) and stiffness (N/m) matrices, (3, 3) each, of three storeys on elastic columns."""
    masses, columns = np.array([1.0, 0.8, 1.2]), np.array([3e4, 2e4, 2.5e4])
    stiffness = np.diag(columns) + np.diag(np.append(columns[1:], 0.0))
    stiffness -= np.diag(columns[1:], 1) + np.diag(columns[1:], -1)
    mass = np.diag(masses)
    return mass, 1.0 * mass + 5e-5 * stiffness, stiffness


def simulate_frame(
    samples: int = 20000, fs: float = 1000.0, noise_percent: float = 1.0, seed: int = 1
) -> tuple[Real, Real]:
    """White shaker force u (N, 1) on the first storey, three noisy accelerations y (N, 3) in m/s^2."""
    mass, damping, stiffness = frame()
    inverse = np.linalg.inv(mass)
    motion = np.block([[np.zeros((3, 3)), np.eye(3)], [-inverse @ stiffness, -inverse @ damping]])
    push = np.concatenate([np.zeros(3), inverse[:, 0]])
    held = np.zeros((7, 7))
    held[:6, :6], held[:6, 6] = motion, push
    step = expm(held / fs)
    rng = np.random.default_rng(seed)
    force = rng.standard_normal(samples)
    state, y = np.zeros(6), np.empty((samples, 3))
    for n in range(samples):
        y[n] = motion[3:] @ state + push[3:] * force[n]
        state = step[:6, :6] @ state + step[:6, 6] * force[n]
    sigma = noise_percent / 100.0 * np.sqrt(np.mean(y**2, axis=0))
    return force[:, None], y + sigma * rng.standard_normal(y.shape)


def demo(verbose: bool = True) -> Result:
    """Shake the frame, identify it, print the modal table beside the truth; returns the Result."""
    force, acceleration = simulate_frame()
    names = [f"storey{k}" for k in (1, 2, 3)]
    result = identify(force, acceleration, fs=1000.0, input_names=["shaker"], output_names=names)
    if verbose:
        mass, damping, stiffness = frame()
        squares, shapes = np.linalg.eig(np.linalg.solve(mass, stiffness))
        rank = np.argsort(squares)
        omega, phi = np.sqrt(squares[rank]), shapes[:, rank]
        zeta = [phi[:, k] @ damping @ phi[:, k] / (2.0 * omega[k] * (phi[:, k] @ mass @ phi[:, k])) for k in range(3)]
        print(result.table())
        pairs = zip(omega / (2.0 * np.pi), zeta, strict=True)
        print("truth: " + ", ".join(f"{f:.5f} Hz {100 * z:.4f} %" for f, z in pairs))
    return result
