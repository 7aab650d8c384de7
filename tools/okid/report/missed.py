# SPDX-License-Identifier: MIT
"""Modes that come back over the orders of a stabilization diagram, but not in the model."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from okid.result.stabilization import Stabilization

SHARE = 0.7  # of the models that must have it
LEAST_MPC = 0.7  # noise poles have shapes out of phase
MOST_DAMPING = 0.2
NEAR = 0.02  # of the frequency: the same mode


def missed_modes(found: Stabilization, frequency_hz: NDArray[np.float64]) -> list[int]:
    """Clusters of the diagram, by their index, of which `frequency_hz` (modes of the model) has none."""
    out = []
    for k, one in enumerate(found.clusters):
        sure = one.physical and one.hits >= SHARE * one.models and one.mpc >= LEAST_MPC
        near = max(NEAR * one.frequency_hz, 3.0 * one.frequency_spread_hz)
        alone = not np.any(np.abs(frequency_hz - one.frequency_hz) <= near)
        if sure and alone and one.damping_ratio <= MOST_DAMPING:
            out.append(k)
    return out
