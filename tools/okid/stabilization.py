# SPDX-License-Identifier: MIT
"""Which poles hold while the model order grows: the rows of a stabilization diagram."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from okid.modal import mac_matrix

Real = NDArray[np.float64]
Complex = NDArray[np.complex128]
Flags = NDArray[np.bool_]


class OrderPoles(NamedTuple):
    """Poles of one order, (k,) each, shapes (k, n_y); the flags compare with the next lower order of the diagram."""

    order: int
    frequency_hz: Real
    damping_ratio: Real
    shapes: Complex
    stable_frequency: Flags
    stable_damping: Flags
    stable_shape: Flags

    @property
    def stable(self) -> Flags:
        """Frequency, damping and shape all hold."""
        return self.stable_frequency & self.stable_damping & self.stable_shape


def compare(
    runs: Sequence[tuple[int, Real, Real, Complex]],
    frequency: float = 0.01,
    damping: float = 0.05,
    shape: float = 0.98,
) -> list[OrderPoles]:
    """Flag every pole that has a partner at the order before.

    `runs`: (order, frequency_hz, damping_ratio, shapes) ascending in order. The partner is the one with the highest
    MAC among the poles within the frequency criterion (default 1 %); damping holds within 5 %, the shape at MAC 0.98.
    """
    out: list[OrderPoles] = []
    for order, f, zeta, shapes in runs:
        hold = np.zeros((3, len(f)), dtype=bool)
        if out and len(f) and len(out[-1].frequency_hz):
            last = out[-1]
            off = np.abs(last.frequency_hz[None, :] - f[:, None]) / f[:, None]
            likeness = np.where(off <= frequency, mac_matrix(shapes, last.shapes), -1.0)
            partner = np.argmax(likeness, axis=1)
            hold[0] = likeness[np.arange(len(f)), partner] >= 0.0
            hold[1] = hold[0] & (np.abs(last.damping_ratio[partner] - zeta) <= damping * zeta)
            hold[2] = hold[0] & (likeness[np.arange(len(f)), partner] >= shape)
        out.append(OrderPoles(order, f, zeta, shapes, hold[0], hold[1], hold[2]))
    return out
