# SPDX-License-Identifier: MIT
"""Lanes whose frames have no counter: placed by the time stamps of their arrival.

An arrival is never early and may be late by a burst (an adapter that hands on every 16 ms): a late frame waits, and
either one behind it is on time, then nothing was lost before that one, or all stay late, and by as much as the least
late one of them samples are missing. The line of least delays is followed by its earliest arrivals, which may pull it
forward at once and drift back by 300 ppm; `okid run` fits it instead and is the better judge of noisy stamps.
"""

from __future__ import annotations

from bisect import bisect_right
from collections import deque
from collections.abc import Sequence
from typing import TYPE_CHECKING

from okid.capture.counted_lane import LONGEST_SILENCE_US
from okid.capture.lane import BusCounts, Frame, Lane

if TYPE_CHECKING:
    from okid.capture.grid import Grid

_ON_TIME = 0.75  # of a period; what is later was held up, or a sample before it is missing
_DRIFT = 300e-6  # by which a sensor may miss its nominal rate
_AS_LATE = 0.3  # periods
_ONE_BEAT = 0.7  # a silence of a period, give or take so much, held no loss
_ONE_BURST = 1.5  # periods; a silence longer by so much than others is not of the bursts
_CUT_OFF = 0.3  # of the longest wait: frames that came within it may lack the rest of a burst
_FORGETS = 0.99  # a frame, of how late the latest was
_LONGEST_BEAT_US = 1e6  # a lane that pauses longer has stalled
_CLOCK_SET_US = -1e6  # so early is nothing but a clock that was set
_SAME_STAMP = 8  # frames that wait and may have one stamp
_WHOLE_BURST = 64  # frames that may wait at once, beside those of the longest wait


class CadenceLane(Lane):
    """Frames that come once a sample period."""

    def __init__(self, grid: Grid, which: int, columns: Sequence[int], counts: BusCounts) -> None:
        super().__init__(grid, which, columns, counts)
        self._due_us = 0.0  # when the newest frame placed was due on the line
        self._usual = 0.0  # how late frames were, of late, before which nothing was lost, periods
        self._late: list[Frame] = []  # by their stamps
        self._least: tuple[float, int] | None = None  # _least_late(0), kept up while frames only come behind
        self._beats: deque[Frame] = deque(maxlen=9)

    def begin(self, frame: Frame) -> None:
        super().begin(frame)
        self._due_us = frame.time_us

    def hold(self, frame: Frame) -> None:
        super().hold(frame)
        self._due_us = frame.time_us

    def _lateness(self, frame: Frame, before: int) -> float:
        """By how many periods it is late when `before` more stand between it and the newest one placed."""
        return (frame.time_us - self._due_us) / self.grid.period_us - 1 - before

    def _is_double(self, frame: Frame, early: bool, before: int) -> bool:
        """It says what another one says, stamped alike, or about alike and so early that there is no place for it."""
        near = 0.5 * self.grid.period_us if early else 0.0
        waiting = self._late if early else self._late[max(0, before - _SAME_STAMP) : before]
        return any(
            abs(other.time_us - frame.time_us) <= near and other.values == frame.values
            for frames in (waiting, self._beats)
            for other in frames
        )

    def _overtaken(self, frame: Frame) -> bool:
        """Its stamp is older than that of the newest one placed, and its sample is still awaited, or came before."""
        index = self.last + round((frame.time_us - self._due_us) / self.grid.period_us)
        if frame.time_us >= self.time_us or index >= self.last or not self.grid.awaited(self, index, frame):
            return False
        self.grid.insert(self, index, frame)
        return True

    def place(self, frame: Frame) -> None:
        ahead = frame.time_us - self._due_us
        if ahead < _CLOCK_SET_US or ahead > LONGEST_SILENCE_US:
            self.settle(frame.time_us, True)
            self._due_us = frame.time_us - self.grid.period_us
            self._beat(frame, 1)
            return
        before = len(self._late)
        if before and frame.time_us < self._late[-1].time_us:
            before = bisect_right(self._late, frame.time_us, key=lambda each: each.time_us)
        lateness = self._lateness(frame, before)
        if self._is_double(frame, lateness < -_ONE_BEAT, before):
            self.counts.duplicate += 1
            return
        if self._overtaken(frame):
            return
        if not self._late and lateness <= _ON_TIME:  # as nearly always
            self._usual = max(_FORGETS * self._usual, lateness)
            frame.loss, self.loss = self.loss, None
            self._beat(frame, 1)
            return
        frame.loss, self.loss = self.loss, None  # it tells where something was lost, and why
        self._late.insert(before, frame)
        self._see(lateness, before)
        self.settle(frame.time_us, False)

    def settle(self, now_us: int, everything: bool) -> None:
        late, period, hold = self._late, self.grid.period_us, self.grid.hold
        if not late:
            return
        ended = everything or now_us - late[-1].time_us > 0.5 * hold * period
        first = 0
        while first < len(late):
            least, which = self._least_late(first) if first or self._least is None else self._least
            if first == 0:
                self._least = least, which
            if least <= _ON_TIME:
                for frame in late[first : which + 1]:
                    self._usual = max(_FORGETS * self._usual, self._lateness(frame, 0))
                    self._beat(frame, 1)
                first = which + 1
                continue
            waited = (late[-1].time_us - late[first].time_us) / period
            if waited > (_CUT_OFF * hold if ended else hold) or (ended and least > self._usual + _ONE_BEAT):
                first = self._place_after_loss(first, which, int(least + 1 - _ON_TIME))
            elif ended or len(late) - first >= hold + _WHOLE_BURST - 1:
                self._beat(late[first], 1)  # a burst that was cut off, or is more than can wait
                first += 1
            else:
                break
        if first:
            del late[:first]
            self._least = None

    def _see(self, lateness: float, place: int) -> None:
        """Frames wait by the hundred after a loss: each is looked at once."""
        if self._least is None or place < len(self._late) - 1:
            self._least = None
            return
        least, which = self._least
        if least > _ON_TIME:
            self._least = min(least, lateness), place if lateness < least + _AS_LATE else which

    def _least_late(self, first: int) -> tuple[float, int]:
        """Of those that wait, from `first` on until one is on time: the least lateness, and the last as late."""
        least, which = self._lateness(self._late[first], 0), first
        for i in range(first + 1, len(self._late)):
            if least <= _ON_TIME:
                break
            lateness = self._lateness(self._late[i], i - first)
            which = i if lateness < least + _AS_LATE else which
            least = min(least, lateness)
        return least, which

    def _place_after_loss(self, first: int, last: int, lost: int) -> int:
        """`lost` samples are missing before the frame `last`: where the line told of a loss and the arrivals do not
        speak against it, else at a silence that is longer than that before the first. Returns the frame to go on with.
        """
        late = self._late

        def silence(i: int) -> float:
            before = late[i - 1].time_us if i > first else self.time_us
            return (late[i].time_us - before) / self.grid.period_us

        place = first
        for i in range(first + 1, last + 1):
            place = i if silence(i) > silence(place) + _ONE_BURST else place
        told = 0
        for i in range(last, first - 1, -1):
            if late[i].loss and abs(silence(i) - 1) >= _ONE_BEAT:
                told += 1
                place = i
        for frame in late[first:place]:
            self._beat(frame, 1)
        self._beat(late[place], 1 + max(1, lost - max(0, told - 1)))
        return place + 1

    def _beat(self, frame: Frame, step: int) -> None:
        """The next frame stands `step` samples after the one before it."""
        self._beats.append(frame)
        pause = frame.time_us - self.time_us > _LONGEST_BEAT_US
        pending, self.loss = self.loss, frame.loss
        self.move_on(frame, self.last + step, pause)
        self.loss = pending
        self._due_us += step * self.grid.period_us
        late = frame.time_us - self._due_us
        self._due_us += late if late < 0 else min(late, _DRIFT * step * self.grid.period_us)
