# SPDX-License-Identifier: MIT
"""Lanes whose frames carry a counter of samples: unwrapped, late and double frames told apart, jumps believed or not.

The rules are those of firmware_host/align/grid_lane.cpp, so that a script and `okid replay` see the same samples.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from okid.capture.lane import BusCounts, Frame, Lane

if TYPE_CHECKING:
    from okid.capture.grid import Grid

_LONGEST_PAUSE_US = 5e6  # beyond it the clock says how often a counter went round
LONGEST_SILENCE_US = 400 * 86400e6  # a stamp further ahead is no time but an error


def wrapped_step(start: int, end: int, bits: int) -> int:
    """Difference of two counters of so many bits, the short way round."""
    step = (end - start) & ((1 << bits) - 1)
    return step if step < 1 << (bits - 1) else step - (1 << bits)


def _kinship(bits: int) -> int:
    """Two counters this close at the start count the same samples."""
    return 64 if bits >= 9 else max(1, (1 << bits) >> 3)


class CountedLane(Lane):
    """`bits`: width of the counter, 2 to 63. Every frame has one."""

    def __init__(self, grid: Grid, which: int, columns: Sequence[int], counts: BusCounts, bits: int) -> None:
        super().__init__(grid, which, columns, counts)
        self.bits = bits
        self.counter = 0  # as last received
        self.suspect: Frame | None = None  # far off: believed when a second frame agrees
        self.suspect_age = 0  # frames that came in their places since

    @property
    def counter_bits(self) -> int | None:
        return self.bits

    def first_place(self, frame: Frame) -> int:
        self.counter = frame.counter or 0
        beside = self._beside_kin(self.counter)
        return super().first_place(frame) if beside is None else beside

    def step_on(self, frame: Frame) -> int:
        return self._step(frame)

    def hold(self, frame: Frame) -> None:
        super().hold(frame)
        self.counter = frame.counter or 0

    def _step(self, frame: Frame) -> int:
        return wrapped_step(self.counter, frame.counter or 0, self.bits)

    def _beside_kin(self, counter: int) -> int | None:
        """The place of a counter beside the lanes whose counters count the same samples."""
        for other in self.grid.lanes:
            if not other.heard or other is self or not isinstance(other, CountedLane):
                continue
            bits = min(self.bits, other.bits)
            apart = wrapped_step(other.counter, counter, bits)
            if abs(apart) <= _kinship(bits):
                return other.last + apart
        return None

    def place(self, frame: Frame) -> None:
        step, grid = self._step(frame), self.grid
        if step <= 0 and (step >= -grid.reorder or grid.awaited(self, self.last + step, frame)):  # again, or late
            self._doubt()
            grid.insert(self, self.last + step, frame)
            return
        far = self._with_rounds(frame, step)
        if far is None and (step < 0 or step > (grid.window if self.loss else grid.reorder)):
            self._judge(frame)
            return
        self._doubt()
        self.counter = frame.counter or 0
        self.move_on(frame, self.last + (step if far is None else far), False)
        if self.suspect is not None:
            self._recall()

    def _with_rounds(self, frame: Frame, step: int) -> int | None:
        """After a known loss or a long silence the clock tells how often the counter went round, if the two agree."""
        pause = frame.time_us - self.time_us
        if step == 1 or (not self.loss and pause < _LONGEST_PAUSE_US) or not 0 < pause <= LONGEST_SILENCE_US:
            return None
        guess = pause / self.grid.period_us
        found = step + max(0, round((guess - step) / (1 << self.bits))) * (1 << self.bits)
        if found < 1 or abs(found - guess) > max(self.grid.window, 0.2 * guess):
            return None
        return found

    def _recall(self) -> None:
        """The lane has come near the counter that was far off, or gone beyond it: it was right."""
        suspect = self.suspect
        assert suspect is not None
        step = self._step(suspect)
        if abs(step) > self.grid.reorder and (step > 0 or not self.grid.awaited(self, self.last + step, suspect)):
            return
        self.suspect = None
        self.place(suspect)

    def _doubt(self) -> None:
        """A frame in its place came after a counter far off: it may have been on its way for long, a ninth was not."""
        if self.suspect is not None:
            self.suspect_age += 1
            if self.suspect_age > self.grid.reorder // 2:
                self._drop()

    def _drop(self) -> None:
        """The counter far off was one damaged frame."""
        self.counts.decode_errors += self.suspect is not None
        self.suspect = None

    def _judge(self, frame: Frame) -> None:
        """A counter far off: one damaged frame, a loss, or a sender that jumped? Two frames that agree decide."""
        suspect = self.suspect
        if suspect is not None:
            apart = wrapped_step(suspect.counter or 0, frame.counter or 0, self.bits)
            if apart == 0:
                self.counts.duplicate += 1
                return
            ahead = all(0 < self._step(each) <= self.grid.window for each in (suspect, frame))
            if abs(apart) <= (self.grid.window if ahead else self.grid.reorder):
                self.suspect = None
                sooner, later = (suspect, frame) if apart > 0 else (frame, suspect)
                self._accept(sooner)
                self.place(later)
                return
            self._drop()  # nothing followed the one before
        self.suspect, self.suspect_age = frame, 0

    def _accept(self, frame: Frame) -> None:
        """The lane goes on at this frame."""
        step = self._step(frame)
        index = self.last + step if step > 0 else self._restart_place(frame)
        self.counter = frame.counter or 0
        self.move_on(frame, index, False)

    def _restart_place(self, frame: Frame) -> int:
        """The sender's counter began anew: beside lanes that did so already, else by time, with a sample between."""
        index = self._beside_kin(frame.counter or 0)
        if index is not None and index > self.last + 1:
            return index
        pause = (frame.time_us - self.time_us) / self.grid.period_us
        return self.last + (round(pause) if 2 < pause < LONGEST_SILENCE_US / self.grid.period_us else 2)

    def end(self) -> None:
        """Nothing can confirm a jump any more: one ahead is taken for a loss, one back for damage."""
        suspect = self.suspect
        if suspect is None:
            return
        if not 0 < self._step(suspect) <= self.grid.window:
            self._drop()
            return
        self.suspect = None
        self._accept(suspect)
