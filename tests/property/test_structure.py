# SPDX-License-Identifier: MIT
"""okid.Structure: modes and sampled models of known M, R and K against SciPy, and identified back."""

from __future__ import annotations

import re
from typing import Any

import numpy as np
import okid
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.linalg import eigh
from scipy.signal import cont2discrete


@settings(max_examples=30, deadline=None)
@given(seed=st.integers(0, 2**31), n=st.integers(1, 6), hold=st.sampled_from(["zoh", "foh"]))
def test_model_is_scipys(seed: int, n: int, hold: str) -> None:
    rng = np.random.default_rng(seed)
    s = okid.Structure.chain(rng.uniform(0.5, 2.0, n), rng.uniform(1e3, 3e3, n), (0.01, 0.02))
    forces = [int(x) for x in rng.integers(1, n + 1, rng.integers(1, 3))]
    sensors = [int(x) * int(rng.choice([-1, 1])) for x in rng.integers(1, n + 1, rng.integers(1, 4))]
    kinds = [str(x) for x in rng.choice(["displacement", "velocity", "acceleration"], len(sensors))]
    ours = s.model(200.0, forces, sensors, kinds, hold)
    minv = np.linalg.inv(s.M)
    a = np.block([[np.zeros((n, n)), np.eye(n)], [-minv @ s.K, -minv @ s.R]])
    push = np.zeros((n, len(forces)))
    push[[dof - 1 for dof in forces], range(len(forces))] = 1.0
    b = np.vstack([np.zeros_like(push), minv @ push])
    rows = {"displacement": (np.eye(n, 2 * n), 0 * push), "velocity": (np.eye(n, 2 * n, n), 0 * push),
            "acceleration": (a[n:], b[n:])}  # fmt: skip
    c = np.array([np.sign(dof) * rows[kind][0][abs(dof) - 1] for dof, kind in zip(sensors, kinds, strict=True)])
    d = np.array([np.sign(dof) * rows[kind][1][abs(dof) - 1] for dof, kind in zip(sensors, kinds, strict=True)])
    theirs = cont2discrete((a, b, c, d), 1.0 / 200.0, hold)
    for left, right in zip((ours.A, ours.B, ours.C, ours.D), theirs[:4], strict=True):
        np.testing.assert_allclose(left, right, rtol=0, atol=1e-11 * max(1.0, float(np.max(np.abs(right)))))


@settings(max_examples=30, deadline=None)
@given(seed=st.integers(0, 2**31), n=st.integers(1, 6))
def test_modes_are_scipys(seed: int, n: int) -> None:
    rng = np.random.default_rng(seed)
    s = okid.Structure.chain(rng.uniform(0.5, 2.0, n), rng.uniform(1e3, 3e3, n), (0.01, 0.02))
    squares, phi = eigh(s.K, s.M)
    modes = s.modes()
    assert [m.frequency_hz for m in modes] == pytest.approx(np.sqrt(squares) / (2 * np.pi), rel=1e-10)
    for k, mode in enumerate(modes):
        assert okid.modal.mac(mode.shape, phi[:, k]) == pytest.approx(1.0, abs=1e-8)
    assert modes[0].damping_ratio == pytest.approx(0.01, rel=1e-8)
    assert n == 1 or modes[-1].damping_ratio == pytest.approx(0.02, rel=1e-8)


def test_there_and_back() -> None:
    """Force in, accelerations out, M, K and R again."""
    frame = okid.demo_frame()
    u = np.random.default_rng(1).standard_normal((8000, 1))
    y = frame.model(1000.0, [1], [1, 2, 3]).simulate(u)
    result = okid.identify(u, y, fs=1000.0, order=6, input_dofs=[1], output_dofs=[1, 2, 3], sigma_blocks=0)
    assert result.mkr is not None
    for found, true in ((result.mkr.M, frame.M), (result.mkr.K, frame.K), (result.mkr.R, frame.R)):
        np.testing.assert_allclose(found, true, atol=1e-4 * float(np.max(np.abs(true))))


@pytest.mark.parametrize(
    ("arguments", "text"),
    [
        ({"force_dofs": [0]}, "force_dofs: found 0, expected degrees of freedom from 1 to 2"),
        ({"sense_dofs": [3]}, "sense_dofs: found 3"),
        ({"sense_dofs": []}, "sense_dofs is empty"),
        ({"sensing": "strain"}, "sensing is 'strain'"),
        ({"sensing": ["velocity", "velocity"]}, "for all sensors or for each"),
        ({"hold": "linear"}, "hold is 'linear'"),
        ({"fs": 0.0}, "fs is 0.0"),
    ],
)
def test_wrong_channels(arguments: dict[str, Any], text: str) -> None:
    s = okid.Structure.chain([1.0, 1.0], [1e3, 1e3])
    with pytest.raises(okid.InputError, match=re.escape(text)):
        s.model(**{"fs": 100.0, "force_dofs": [1], "sense_dofs": [1], **arguments})


def test_wrong_matrices() -> None:
    with pytest.raises(okid.InputError, match="one spring for each mass"):
        okid.Structure.chain([1.0], [1e3, 1e3])
    with pytest.raises(okid.InputError, match="M has shape"):
        okid.Structure(np.ones((2, 3)), np.eye(2), np.eye(2))
    with pytest.raises(okid.InputError, match="K has 1 degrees of freedom, M has 2"):
        okid.Structure(np.eye(2), np.eye(2), np.eye(1))
    with pytest.raises(okid.InputError, match="M is not positive definite"):
        okid.Structure(-np.eye(2), np.eye(2), np.eye(2))
