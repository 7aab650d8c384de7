# SPDX-License-Identifier: MIT
"""Frames of several messages onto one sample grid: by counter where there is one, else by time stamps.

Nothing is interpolated: a sample that did not arrive is NaN and counted. Memory is bounded: a ring of two seconds.
The rules are those of firmware_host/align/grid.cpp.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from okid.capture.cadence_lane import CadenceLane
from okid.capture.counted_lane import CountedLane
from okid.capture.lane import BusCounts, Frame, Lane

Real = NDArray[np.float64]
_NAN = float("nan")
_CHUNK = 65536  # missing samples in one block


class Grid:
    """`columns` numbers a sample at `rate_hz`; add a lane for each message, push its frames, take() the samples.

    A stream may be joined in the middle: sample 0 is the first one that every lane can have.
    """

    reorder = 16  # samples by which a frame may be late or ahead without being doubted

    def __init__(self, rate_hz: float, columns: int, limit: int | None = None) -> None:
        self.period_us = 1e6 / rate_hz
        self.columns = columns
        self.limit = limit
        self.window = min(max(round(rate_hz / 4), 4 * self.reorder), 4096)
        self._lag = min(max(round(rate_hz), self.window), 16384)  # so far a silent lane may be behind: a second
        self.hold = self.window // 2  # periods a frame without counter may wait
        self._mask = (1 << (2 * self._lag - 1).bit_length()) - 1
        self.lanes: list[Lane] = []
        self._values = [[_NAN] * columns for _ in range(self._mask + 1)]
        self._present = [0] * (self._mask + 1)  # a bit for each lane
        self._next = self._opened = 0
        self._anchored = False
        self._held: list[tuple[Lane, Frame]] = []
        self._ready: list[list[float]] = []
        self._blocks: list[Real] = []
        self._all = 0

    def add_lane(self, columns: Sequence[int], counts: BusCounts, bits: int | None) -> Lane:
        """Frames that carry these columns; `bits` of their counter, None = placed by time stamps."""
        which = len(self.lanes)
        lane: Lane
        if bits is None:
            lane = CadenceLane(self, which, columns, counts)
        else:
            lane = CountedLane(self, which, columns, counts, bits)
        self.lanes.append(lane)
        self._all = (1 << len(self.lanes)) - 1
        return lane

    @property
    def emitted(self) -> int:
        """Samples that went out, missing ones included."""
        return self._next

    def end_after(self, seconds: float | None) -> None:
        """Let no sample from there on go out, unless there is a limit already."""
        if seconds is not None and self.limit is None:
            self.limit = max(1, round(seconds * 1e6 / self.period_us))

    @property
    def full(self) -> bool:
        """The limit is reached: no sample goes out any more."""
        return self.limit is not None and self._next >= self.limit

    def push(self, lane: Lane, frame: Frame) -> None:
        """Place a frame."""
        if frame.loss:
            for each in self.lanes:
                if each.counts is lane.counts:
                    each.loss = frame.loss
        for each in self.lanes:
            each.settle(frame.time_us, False)
        if self._anchored:
            self._put(lane, frame)
        else:
            self._hold_until_anchored(lane, frame)

    def take(self) -> list[Real]:
        """Samples (n, columns) that went out since the last call, in order."""
        self._close_block()
        out, self._blocks = self._blocks, []
        return out

    @property
    def waiting(self) -> int:
        """Samples that take() would give, long gaps not counted."""
        return len(self._ready) + sum(map(len, self._blocks))

    def finish(self) -> None:
        """The stream ends: everything that waits goes out. A last sample that was cut by the end is left off."""
        if not self._anchored and self._held:
            self._anchor()
        for lane in self.lanes:
            lane.settle(0, True)
            lane.end()
        if self._opened > self._next and self._present[(self._opened - 1) & self._mask] != self._all:
            self._opened -= 1
        self._drain(True)
        for lane in self.lanes:
            if lane.gap_count:
                self._close_gap(lane, False)

    def awaited(self, lane: Lane, index: int, frame: Frame) -> bool:
        """Is the sample still waiting for this lane, or does it hold just these numbers (a frame that came twice)?"""
        if index < 0 or index >= self._opened or index < self._opened - self._mask:
            return False
        if not self._present[index & self._mask] >> lane.which & 1:
            return index >= self._next
        row = self._values[index & self._mask]
        return all(row[c] == value for c, value in zip(lane.columns, frame.values, strict=True))

    def insert(self, lane: Lane, index: int, frame: Frame) -> None:
        """The frame's numbers into their row."""
        late, bit = index < lane.last, 1 << lane.which
        lane.last = max(lane.last, index)
        lane.recent.append(index)
        if len(lane.recent) == 9:
            lane.passed = min(lane.recent)
        if index < self._next:
            if index >= 0:  # else before the grid begins
                if self._opened - index <= self._mask and self._present[index & self._mask] & bit:
                    lane.counts.duplicate += 1
                else:
                    lane.counts.out_of_order += 1  # too late: the sample has gone out without it
            return
        self._open_rows(index)
        slot = index & self._mask
        if self._present[slot] & bit:
            lane.counts.duplicate += 1
            return
        lane.counts.out_of_order += late
        self._present[slot] |= bit
        row = self._values[slot]
        for column, value in zip(lane.columns, frame.values, strict=True):
            row[column] = value
        self._drain(False)

    def _put(self, lane: Lane, frame: Frame) -> None:
        if lane.heard:
            lane.place(frame)
            return
        lane.begin(frame)
        self.insert(lane, lane.last, frame)

    def _hold_until_anchored(self, lane: Lane, frame: Frame) -> None:
        """Before the grid begins frames wait until every lane was heard, or until no more can wait."""
        lane.waiting = True
        self._held.append((lane, frame))
        if all(each.waiting for each in self.lanes) or len(self._held) >= 64 * len(self.lanes) + 256:
            self._anchor()

    def _anchor(self) -> None:
        """Sample 0 is the first one that every lane can have."""
        self._anchored = True
        first: dict[int, tuple[int, Frame]] = {}
        for lane, frame in self._held:  # first pass: where each lane's first frame stands
            if not lane.heard:
                lane.begin(frame)
                first[lane.which] = (lane.last, frame)
                continue
            step = lane.step_on(frame)  # the reference of the lanes to come moves on
            if 0 < step <= self.window:
                lane.last += step
                lane.hold(frame)
        begin = max(index for index, _ in first.values())
        for lane in self.lanes:  # every lane back to just its first frame
            if lane.heard:
                index, frame = first[lane.which]
                lane.last = index - begin
                lane.hold(frame)
        held, self._held = self._held, []
        for lane, frame in held:  # second pass: for good
            if first[lane.which][1] is frame:
                self.insert(lane, lane.last, frame)
            else:
                lane.place(frame)

    def _open_rows(self, upto: int) -> None:
        """Lay rows out up to and including `upto`; makes room by letting the oldest go."""
        if upto - self._next > self._mask:
            while self._next < self._opened and upto - self._next > self._mask:
                self._emit_front()
            if self._next == self._opened and upto - self._next > self.window:
                self._skip_to(upto - self.window // 2)
        while self._opened <= upto:
            slot = self._opened & self._mask
            self._values[slot] = [_NAN] * self.columns
            self._present[slot] = 0
            self._opened += 1

    def _may_come(self, lane: Lane) -> bool:
        """May the lane still bring the sample that goes out next?

        One that is silent has a second for it, one that jumped over it until its newest frames all lie beyond.
        """
        ahead = self._opened - self._next
        if not lane.heard or lane.last < self._next:
            return ahead <= self._lag
        return lane.passed <= self._next and ahead <= self._mask

    def _drain(self, everything: bool) -> None:
        while self._next < self._opened and not self.full:
            have = self._present[self._next & self._mask]
            if have != self._all and not everything:
                if self._opened - self._next <= 1:
                    return
                if any(not have >> lane.which & 1 and self._may_come(lane) for lane in self.lanes):
                    return
            self._emit_front()

    def _emit_front(self) -> None:
        slot = self._next & self._mask
        have = self._present[slot]
        for lane in self.lanes:
            if have >> lane.which & 1:
                if lane.gap_count:
                    self._close_gap(lane, True)
                lane.expected += 1
                lane.received += 1
            else:
                self._extend_gap(lane, self._next, 1)
        self._next += 1
        if self.limit is None or self._next <= self.limit:
            self._ready.append(self._values[slot])

    def _skip_to(self, index: int) -> None:
        """Nothing at all arrived between the next sample and `index`."""
        first, count = self._next, index - self._next
        for lane in self.lanes:
            self._extend_gap(lane, first, count)
        self._next = self._opened = index
        for each in range(max(first, index - self._mask), index):
            self._present[each & self._mask] = 0
        self._close_block()
        count = count if self.limit is None else max(0, min(count, self.limit - first))
        missing = np.full((1, self.columns), np.nan)
        while count > 0:  # rows of the same memory: a long silence costs none
            self._blocks.append(np.broadcast_to(missing, (min(count, _CHUNK), self.columns)))
            count -= _CHUNK

    def _close_block(self) -> None:
        if self._ready:
            self._blocks.append(np.array(self._ready, dtype=np.float64))
            self._ready = []

    def _extend_gap(self, lane: Lane, first: int, count: int) -> None:
        if lane.gap_count == 0:
            lane.gap_first = first
        lane.gap_count += count
        lane.expected += count

    def _close_gap(self, lane: Lane, resumed: bool) -> None:
        """The cause is what was known when the lane jumped over the gap."""
        last = lane.gap_first + lane.gap_count - 1
        cause = "sequence" if resumed or lane.gap_count <= self.reorder else "stall"
        for begin, end, known in lane.marks:
            if begin <= last and end >= lane.gap_first:
                cause = known
        lane.counts.lost[cause] = lane.counts.lost.get(cause, 0) + lane.gap_count
        lane.gap_count = 0
