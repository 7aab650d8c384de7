# SPDX-License-Identifier: MIT
"""Orders above that of a structure under a band-limited force without noise: the extra poles are not the structure's.

The truth comes from the frequency domain of laboratory.py; nothing there knows poles in samples.
"""

from __future__ import annotations

import numpy as np
import okid
import pytest
from laboratory import chain, forced


@pytest.mark.parametrize("method", ["n4sid-cva", "n4sid-moesp", "n4sid-ssarx"])
def test_orders_above_the_true_one_explain_the_record(method: str) -> None:
    lab = forced(41, count=8000, noise=0)
    u, y = lab.samples[:, : lab.n_u], lab.samples[:, lab.n_u :]
    true = 2 * len(lab.frequency_hz)
    for order in (true + 6, 60):
        result = okid.identify(u, y, fs=lab.fs, method=method, order=order)
        assert "poles_reflected" in [w.code for w in result.warnings], order
        assert min(p for p in result.fit.simulation_percent.values() if p is not None) > 98, order
        found = np.array([(m.frequency_hz, m.damping_ratio) for m in result.modes])
        for f, zeta in zip(lab.frequency_hz, lab.damping_ratio, strict=True):
            nearest = found[np.argmin(np.abs(found[:, 0] / f - 1) + 0.01 * np.abs(found[:, 1] / zeta - 1))]
            assert nearest == pytest.approx([f, zeta], rel=5e-3), (method, order)
    plain = okid.identify(u, y, fs=lab.fs, method="n4sid-cva", order=true)
    assert "poles_reflected" not in [w.code for w in plain.warnings]


def test_mass_and_stiffness_from_such_an_order() -> None:
    test = chain(3, count=8000, noise=0)
    u, y = test.lab.samples[:, :2], test.lab.samples[:, 2:]
    found = okid.identify(
        u, y, fs=test.lab.fs, method="n4sid-cva", order=20, hold="band", input_dofs=[1, 5], output_dofs=[1, 2, 3, 4, 5]
    )
    assert "poles_reflected" in [w.code for w in found.warnings]
    assert found.mkr is not None
    assert np.linalg.norm(found.mkr.M - test.M) < 0.01 * np.linalg.norm(test.M)
    assert np.linalg.norm(found.mkr.K - test.K) < 0.01 * np.linalg.norm(test.K)
