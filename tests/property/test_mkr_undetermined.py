# SPDX-License-Identifier: MIT
"""M, K and R that the record does not determine are no numbers: the one force acts where a mode hardly moves."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import okid
from numpy.typing import NDArray
from scipy.signal import cont2discrete

Array = NDArray[np.float64]
FS = 200.0


def record(springs: Sequence[float], noise: float, seed: int) -> tuple[Array, Array]:
    """Three masses of 1 kg, four springs, a random force at the middle one, accelerations of all."""
    k = np.asarray(springs)
    K = np.diag(k[:-1] + k[1:]) - np.diag(k[1:-1], 1) - np.diag(k[1:-1], -1)
    R = 1e-4 * K + 0.3 * np.eye(3)
    a = np.block([[np.zeros((3, 3)), np.eye(3)], [-K, -R]])
    b = np.vstack([np.zeros((3, 1)), np.eye(3)[:, 1:2]])
    system = cont2discrete((a, b, a[3:], b[3:]), 1.0 / FS, "zoh")
    rng = np.random.default_rng(seed)
    u, x, y = rng.standard_normal((12_000, 1)), np.zeros(6), []
    for force in u:
        y.append(system[2] @ x + system[3] @ force)
        x = system[0] @ x + system[1] @ force
    out = np.array(y)
    return u, out + noise * np.std(out, axis=0) * rng.standard_normal(out.shape)


def test_a_force_near_the_node_of_a_mode() -> None:
    """The middle mass stands at 0.6 % of the largest motion of mode 2."""
    u, y = record([2000.0, 2500.0, 2520.0, 2010.0], 0.01, 1)
    found = okid.identify(u, y, fs=FS, input_dofs=[2], output_dofs=[1, 2, 3], method="n4sid-cva", order=6)
    said = {warning.code: warning.text for warning in found.warnings}
    assert "mkr_undetermined" in said, said
    assert "mode 2" in said["mkr_undetermined"] and "u1" in said["mkr_undetermined"]
    assert not {"mkr_polarity", "mkr_mass_indefinite", "mkr_likely_cause"} & said.keys()
    assert found.mkr is not None and np.isnan(found.mkr.M).all()


def test_a_force_where_every_mode_moves() -> None:
    u, y = record([2000.0, 2500.0, 4000.0, 1500.0], 0.01, 1)
    found = okid.identify(u, y, fs=FS, input_dofs=[2], output_dofs=[1, 2, 3])
    assert "mkr_undetermined" not in {warning.code for warning in found.warnings}
    assert found.mkr is not None
    np.testing.assert_allclose(np.diag(found.mkr.M), 1.0, atol=0.05)
