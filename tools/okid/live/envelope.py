# SPDX-License-Identifier: MIT
"""Lowest and highest value of every channel in each hundredth of a second: what a lane on the screen can show."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from okid.live.recent import Placed

Real = NDArray[np.float64]
Small = NDArray[np.float32]
MISSING, NOT_SENT = 1, 2  # a sample of the column was missing on the bus / never came to the page


class Envelope:
    """Columns of `width` samples for m channels; the newest `capacity` columns are kept, 9 m capacity bytes.

    Column k holds samples k width .. (k + 1) width - 1. `end`: one behind the last whole column.
    """

    def __init__(self, channels: int, rate_hz: float, seconds: float = 60.0, columns_per_s: float = 100.0) -> None:
        self.width = max(1, round(rate_hz / columns_per_s))
        self.channels, self.capacity = channels, int(np.ceil(seconds * rate_hz / self.width))
        self.begin = self.end = 0
        self._low = np.full((self.capacity, channels), np.nan, np.float32)
        self._high = np.full((self.capacity, channels), np.nan, np.float32)
        self._marks = np.zeros((self.capacity, channels), np.uint8)
        self._rest = np.empty((0, channels))
        self._unsent = np.empty(0, np.bool_)

    def add(self, placed: Placed) -> None:
        """Take samples that follow each other, see Recent.add(). O(m samples)."""
        rows = placed.block
        unsent = np.zeros(len(rows), np.bool_)
        unsent[: placed.filled] = True
        if placed.fresh:
            lead = placed.first % self.width
            self.begin = self.end = placed.first // self.width
            rows = np.vstack([np.full((lead, self.channels), np.nan), rows])
            unsent = np.concatenate([np.ones(lead, np.bool_), unsent])
        else:
            rows = np.vstack([self._rest, rows])
            unsent = np.concatenate([self._unsent, unsent])
        whole = len(rows) // self.width
        self._rest, self._unsent = rows[whole * self.width :], unsent[whole * self.width :]
        if whole:
            self._put(rows[: whole * self.width], unsent[: whole * self.width], whole)

    def _put(self, rows: Real, unsent: NDArray[np.bool_], whole: int) -> None:
        pieces = np.ascontiguousarray(rows.T).reshape(self.channels, whole, self.width)
        hole = unsent.reshape(whole, self.width)
        if hole.any():
            marks = np.where(np.any(np.isnan(pieces) & ~hole, axis=2), MISSING, 0)
            marks = np.where(np.any(hole, axis=1) & (marks == 0), NOT_SENT, marks)
        else:
            marks = np.where(np.isnan(np.minimum.reduce(pieces, axis=2)), MISSING, 0)
        kept = min(whole, self.capacity)
        at = np.arange(self.end + whole - kept, self.end + whole) % self.capacity
        self._low[at] = np.fmin.reduce(pieces[:, -kept:], axis=2).T
        self._high[at] = np.fmax.reduce(pieces[:, -kept:], axis=2).T
        self._marks[at] = marks[:, -kept:].T
        self.end += whole

    def since(self, first: int) -> tuple[int, Small, Small, NDArray[np.uint8]]:
        """Columns first .. end: the first one that is there, low and high (m, columns), marks (m, columns).

        low and high are NaN where a column holds no sample.
        """
        start = max(first, self.begin, self.end - self.capacity)
        at = np.arange(start, max(start, self.end)) % self.capacity
        return start, self._low[at].T, self._high[at].T, self._marks[at].T
