# SPDX-License-Identifier: MIT
"""Frames of one message as they stand on the sample grid: the part that does not depend on how they are placed."""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from okid.capture.grid import Grid

NEVER = -(1 << 62)


@dataclass(slots=True)
class Frame:
    """Decoded: one number a column of its lane, finite. `loss`: why frames before it are missing, as the line told."""

    time_us: int
    values: list[float]
    counter: int | None = None
    loss: str | None = None


@dataclass
class BusCounts:
    """Of one bus. lost: frames missing on the grid, by cause."""

    received: int = 0
    out_of_order: int = 0
    duplicate: int = 0
    decode_errors: int = 0
    lost: dict[str, int] = field(default_factory=dict)

    @property
    def lost_in_all(self) -> int:
        """Under whatever cause."""
        return sum(self.lost.values())


class Lane:
    """`columns` of the grid that come in the same frames; place() says which sample a frame belongs to."""

    def __init__(self, grid: Grid, which: int, columns: Sequence[int], counts: BusCounts) -> None:
        self.grid = grid
        self.which = which
        self.columns = tuple(columns)
        self.counts = counts
        self.waiting = self.heard = False
        self.last = 0  # unwrapped place of the newest frame
        self.time_us = 0  # its stamp
        self.loss: str | None = None  # told by the line since
        self.recent: deque[int] = deque(maxlen=9)  # a frame may be eight places late
        self.passed = NEVER
        self.gap_first = -1
        self.gap_count = 0
        self.expected = self.received = 0
        self.marks: deque[tuple[int, int, str]] = deque(maxlen=64)

    @property
    def counter_bits(self) -> int | None:
        """Of the counter in its frames; None without one."""
        return None

    def begin(self, frame: Frame) -> None:
        """Its place from its first frame; lanes heard before are the reference."""
        self.time_us = frame.time_us
        self.loss = None
        self.last = self.first_place(frame)
        self.heard = True

    def first_place(self, frame: Frame) -> int:
        """By time beside the first lane that was heard."""
        for other in self.grid.lanes:
            if other.heard:
                return other.last + round((frame.time_us - other.time_us) / self.grid.period_us)
        return 0

    def step_on(self, frame: Frame) -> int:
        """Samples from the newest frame to this one, before the grid begins."""
        return round((frame.time_us - self.time_us) / self.grid.period_us)

    def hold(self, frame: Frame) -> None:
        """The newest frame of a lane before the grid begins."""
        self.time_us = frame.time_us

    def place(self, frame: Frame) -> None:
        """Put a frame behind the first one where it belongs."""
        raise NotImplementedError

    def settle(self, now_us: int, everything: bool) -> None:
        """Place frames that waited and need not wait any longer."""

    def end(self) -> None:
        """The stream ends: what waits for a judgement gets one."""

    def move_on(self, frame: Frame, index: int, pause: bool) -> None:
        """The newest frame is now at `index`; what it jumped over is lost unless it still comes."""
        if index > self.last + 1:
            self.marks.append((self.last + 1, index - 1, self.loss or ("stall" if pause else "sequence")))
        self.loss = None
        self.time_us = frame.time_us
        self.grid.insert(self, index, frame)
