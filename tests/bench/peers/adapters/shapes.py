# SPDX-License-Identifier: MIT
"""What the adapters share: a list of modes as arrays, samples in columns."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from problem import Modes


def found_modes(modes: Sequence[Any]) -> Modes:
    return Modes(np.array([m.frequency_hz for m in modes]), np.array([m.damping_ratio for m in modes]))


def columns(samples: Any) -> Any:
    """(samples, channels) -> contiguous (channels, samples), the layout most peers want."""
    return np.ascontiguousarray(samples.T)
