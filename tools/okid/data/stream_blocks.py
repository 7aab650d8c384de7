# SPDX-License-Identifier: MIT
"""The blocks of a running stream that are left out in turn for standard deviations, as `okid run` has them."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from okid.abi.accumulator import Accumulator
from okid.abi.identifier import Identifier
from okid.result.mkr import Plan
from okid.result.model import Model
from okid.result.uncertainty import Uncertainty, without_each

_REMEMBERED = 0.99  # share of a fading memory that the blocks cover


class StreamBlocks:
    """Sums of parts of what goes into `whole`: a window has them in its slots already; for a growing or fading memory
    each part has an accumulator of its own.

    `blocks` to leave out: a window has about so many, a growing memory from so many to twice as many (neighbours are
    paired when all are full), a fading one twice as many.
    """

    def __init__(self, whole: Accumulator, blocks: int) -> None:
        arguments = whole.arguments
        self.window, self.fading = arguments["slots"] > 0, arguments["forgetting"] < 1.0
        if self.window:
            arguments |= {"block": 0, "slots": 0, "spare_slots": 0}
        self._whole, self._blocks, self._lags = whole, blocks, whole.lags
        self._slot, self._forgetting = int(arguments["block"]), float(arguments["forgetting"])
        self._first_length = self._lags
        if self.fading:  # whole slots, so many that all parts together cover what is remembered
            rows = math.log(1.0 - _REMEMBERED) / math.log(self._forgetting) / (2 * blocks)
            self._first_length = max(1, round(rows / self._slot)) * self._slot
        count = 2 if self.window else 2 * blocks + (1 if self.fading else 0)
        self._parts = [Accumulator(**arguments) for _ in range(count)]
        self._closed_at = [0] * count  # rows in closed slots of the whole when the part ended
        self._history: NDArray[Any] = np.zeros((0, whole.channels))
        self._open, self._length = 0, self._first_length

    def set_units(self, scale: Any, offset: Any) -> None:
        """Those of the whole."""
        for part in self._parts:
            part.set_units(scale, offset)

    def reset(self) -> None:
        """Begin anew, as the whole does."""
        for part in self._parts:
            part.reset()
        self._history = self._history[:0]
        self._open, self._length = 0, self._first_length

    def room(self, count: int) -> int:
        """How many of `count` samples may go into the whole before the next add()."""
        if self.window:
            return count
        left = self._slot - self._open_rows() if self.fading else self._length - self._parts[self._open].rows
        return min(count, max(1, left))

    def add(self, samples: NDArray[Any]) -> None:
        """The same samples that went into the whole just now."""
        if self.window:
            return
        self._parts[self._open].add(samples)
        if len(samples) < self._lags and len(self._history):
            samples = np.concatenate([self._history, samples])
        self._history = samples[-self._lags :].copy()
        self._turn()

    def gap(self, count: int) -> None:
        """The same gap."""
        if self.window:
            return
        self._parts[self._open].gap(count)
        self._history = self._history[:0]
        self._turn()

    def deviations(self, identifier: Identifier, full: Model, plan: Plan | None) -> Uncertainty | None:
        """Standard deviations of `full`, the model of the identifier's last run(), which was on the whole; None while
        there are too few blocks."""
        whole = self._whole
        if self.window:
            whole = self._parts[0]
            whole.reset()
            whole.take_slots(self._whole, 0, self._whole.slots)
        return without_each(identifier, whole, self._groups() if self.window else self._weighted(), full, plan)

    def _weighted(self) -> Iterator[tuple[Accumulator, float]]:
        """The parts, with what is left of them in a fading memory."""
        closed = self._whole.rows - self._open_rows()
        for k in range(self._open + 1):
            age = closed - self._closed_at[k] if k < self._open else 0
            yield self._parts[k], self._forgetting**age if self.fading else 1.0

    def _groups(self) -> Iterator[tuple[Accumulator, float]]:
        """Groups of consecutive slots with about equal rows, one after the other in the same accumulator."""
        slots, rows = self._whole.slots, self._whole.rows
        seen, first, group = 0, 0, 1
        while first < slots:
            last = first
            while True:
                seen += self._whole.slot_rows(last)
                last += 1
                if last >= slots or seen * self._blocks >= group * rows:
                    break
            self._parts[1].reset()
            self._parts[1].take_slots(self._whole, first, last - first)
            yield self._parts[1], 1.0
            first, group = last, group + 1

    def _open_rows(self) -> int:
        return self._whole.slot_rows(self._whole.slots - 1)

    def _turn(self) -> None:
        """Begin another part when the open one is full; of a fading memory only where a slot of the whole ended."""
        if self._parts[self._open].rows < self._length or (self.fading and self._open_rows() > 0):
            return
        self._closed_at[self._open] = self._whole.rows - self._open_rows()
        self._open += 1
        if self._open == len(self._parts):
            if self.fading:
                self._parts.append(self._parts.pop(0))
                self._closed_at.append(self._closed_at.pop(0))
                self._open -= 1
            else:
                self._pair_up()
        part = self._parts[self._open]
        part.reset()
        part.add(self._history)  # what stood before belongs to the lags of its first rows

    def _pair_up(self) -> None:
        """All parts are full: neighbours become one, of twice the length."""
        for k in range(self._blocks):
            self._parts[2 * k].merge(self._parts[2 * k + 1])
            self._parts[k], self._parts[2 * k] = self._parts[2 * k], self._parts[k]
        self._open, self._length = self._blocks, 2 * self._length
