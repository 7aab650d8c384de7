# SPDX-License-Identifier: MIT
"""Warnings that no other test provokes, each with its cause and with the cause taken away."""

from __future__ import annotations

from typing import Any

import numpy as np
import okid
import systems
from numpy.typing import NDArray
from scipy.signal import lfilter

Array = NDArray[np.float64]
W1, W2 = systems.w1(), systems.w2()


def codes(result: Any) -> list[str]:
    return [warning.code for warning in result.warnings]


def test_forces_that_are_nearly_one() -> None:
    rng = np.random.default_rng(1)
    one, other = rng.standard_normal((2, 6000, 1))
    for share, warned in ((3e-5, True), (1.0, False)):
        u = np.hstack([one, one + share * other])
        y = systems.simulate(W2.discrete(), u)
        y += 0.01 * y.std(axis=0) * rng.standard_normal(y.shape)
        found = okid.identify(u, y, fs=W2.fs, method="okid-era", p=10, order=12, sigma="none")
        assert ("weak_excitation" in codes(found)) == warned


def test_a_refinement_that_predicts_worse() -> None:
    """Two narrow-band disturbances as strong as twice the answer: a predictor uses them, a simulation cannot."""
    rng = np.random.default_rng(1)
    u, y = systems.record(W1, 4000, 2.0, 5)
    noise = np.stack([lfilter([1.0], [1.0, -1.9, 0.95], rng.standard_normal(4000)) for _ in range(3)], axis=1)
    for strength, warned in ((2.0, True), (0.0, False)):
        record = y + strength * y.std(axis=0) * noise / noise.std(axis=0)
        found = okid.identify(u, record, fs=W1.fs, method="n4sid-cva", order=10, refine=True, sigma="none")
        assert ("prediction_lower" in codes(found)) == warned


def test_matrices_of_two_of_six_modes() -> None:
    u, y = systems.record(W2, 8000, 1.0, 5)
    for sensors, warned in (([0, 3], True), ([0, 3, 1, 2, 4, 5], False)):
        dofs = {"input_dofs": [1, 2], "output_dofs": list(range(1, len(sensors) + 1))}
        found = okid.identify(u, y[:, sensors], fs=W2.fs, method="n4sid-cva", order=12, sigma="none", **dofs)
        assert ("mkr_choice_unclear" in codes(found)) == warned
