# SPDX-License-Identifier: MIT
"""A tuned absorber: two modes of the same shape at every sensor, closer than 2.5 bandwidths, and both are modes."""

from __future__ import annotations

import numpy as np
import okid
from systems import Structure, chain, rayleigh, record


def test_both_modes_of_an_absorber_are_confident() -> None:
    M, K = chain([1.0, 0.8, 0.02], [3e4, 2e4, 0.0])
    R, _ = rayleigh(M[:2, :2], K[:2, :2], 0.005)
    lowest = np.sqrt(np.min(np.linalg.eigvals(np.linalg.solve(M[:2, :2], K[:2, :2]))))
    link = np.outer([0, -1, 1], [0, -1, 1])
    R = np.pad(R, (0, 1)) + 2 * 0.06 * 0.02 * lowest * link
    K = K + 0.97 * 0.02 * lowest**2 * link
    poles = np.linalg.eigvals(
        np.block([[np.zeros((3, 3)), np.eye(3)], [-np.linalg.solve(M, K), -np.linalg.solve(M, R)]])
    )
    true = sorted((abs(p) / 2 / np.pi, -p.real / abs(p)) for p in poles if p.imag > 0)
    s = Structure(M, R, K, force_dofs=(0,), sense_dofs=(0, 1), dt=0.004)
    u, y = record(s, 12000, 1.0, seed=2)
    found = okid.identify(u, y, fs=s.fs)
    shapes = np.array([m.shape for m in found.confident_modes[:2]])
    alike = abs(np.vdot(shapes[0], shapes[1])) ** 2 / np.prod([np.vdot(x, x).real for x in shapes])
    assert alike > 0.95 and true[1][0] - true[0][0] < 2.5 * (true[0][0] * true[0][1] + true[1][0] * true[1][1])
    assert len(found.confident_modes) == 3, found.table()
    for mode, (f, zeta) in zip(found.confident_modes, true, strict=True):
        assert abs(mode.frequency_hz / f - 1) < 0.005 and abs(mode.damping_ratio / zeta - 1) < 0.05
