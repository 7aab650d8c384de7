# SPDX-License-Identifier: MIT
"""The newest samples of all channels on the sample grid, gaps as NaN: what averages and diagram are made from."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Real = NDArray[np.float64]


class Placed(NamedTuple):
    """Samples that follow the ones before without a hole: `first`, block (count, m), the first `filled` rows are NaN
    because their samples never came; `fresh`: the hole before was too long, this is a new beginning."""

    first: int
    block: Real
    filled: int
    fresh: bool


class Recent:
    """A ring of the last `capacity` samples of m channels, 8 m capacity bytes."""

    def __init__(self, channels: int, capacity: int) -> None:
        self.channels, self.capacity = channels, max(1, capacity)
        self._ring = np.full((self.capacity, channels), np.nan)
        self.first = 0  # oldest sample that was ever taken since the last beginning
        self.end = 0  # one behind the newest

    def add(self, first: int, values: Real) -> Placed | None:
        """Take samples first .. of values (m, count); what was there already is left out, None when that is all.

        O(m count), and O(m capacity) after a hole.
        """
        fresh = self.end == self.first or first - self.end > self.capacity
        if fresh:
            self._ring[:] = np.nan
            self.first = self.end = first
        cut = max(0, self.end - first)
        if cut >= values.shape[1]:
            return None
        new = values[:, cut:].T
        filled = first + cut - self.end
        block = np.vstack([np.full((filled, self.channels), np.nan), new]) if filled else new
        start = self.end
        self._put(block)
        return Placed(start, block, filled, fresh)

    def _put(self, block: Real) -> None:
        end = self.end + len(block)
        kept = block[-self.capacity :]
        at = (end - len(kept)) % self.capacity
        head = min(len(kept), self.capacity - at)
        self._ring[at : at + head] = kept[:head]
        self._ring[: len(kept) - head] = kept[head:]
        self.end = end

    @property
    def oldest(self) -> int:
        """The first sample that read() still has."""
        return max(self.first, self.end - self.capacity)

    def read(self, first: int, count: int) -> Real:
        """A copy (count, m) of samples first ..; rows that are not in the ring are NaN."""
        index = np.arange(first, first + count)
        out: Real = self._ring[index % self.capacity]
        out[(index < self.oldest) | (index >= self.end)] = np.nan
        return out
