# SPDX-License-Identifier: MIT
"""Absolute deadlines: a late one does not move those behind it, so there is no drift. How late they were is counted."""

from __future__ import annotations

import contextlib
import ctypes
import math
import sys
import time
from collections.abc import Callable

_PIECE_S = 0.1
_PR_SET_TIMERSLACK = 29


class Pacer:
    """Offset 0 is the first call of wait(). `late_mean_s`, `late_sd_s`, `late_worst_s` of `count` deadlines.

    `clock` and `sleep` are for tests.
    """

    def __init__(
        self, clock: Callable[[], float] = time.monotonic, sleep: Callable[[float], None] = time.sleep
    ) -> None:
        self._clock, self._sleep = clock, sleep
        self._begin: float | None = None
        self._squares = 0.0
        self.count = 0
        self.late_mean_s = self.late_worst_s = 0.0

    def begin(self) -> float:
        """Offset 0 is now, if it is not yet; the kernel shall wake this thread without slack (default 50 us)."""
        if self._begin is None:
            if sys.platform == "linux":
                with contextlib.suppress(OSError, AttributeError):
                    ctypes.CDLL(None).prctl(_PR_SET_TIMERSLACK, 1, 0, 0, 0)
            self._begin = self._clock()
        return self._begin

    def now(self) -> float:
        """Seconds since offset 0."""
        return self._clock() - self.begin()

    def wait(self, offset_s: float, stop: Callable[[], bool] | None = None) -> bool:
        """Sleep until the offset; False when `stop()` said so. Asked at least ten times a second."""
        due = self.begin() + offset_s
        while (left := due - self._clock()) > 0:
            if stop is not None and stop():
                return False
            self._sleep(min(left, _PIECE_S))
        if stop is not None and stop():
            return False
        late = self._clock() - due
        self.count += 1
        step = late - self.late_mean_s
        self.late_mean_s += step / self.count
        self._squares += step * (late - self.late_mean_s)
        self.late_worst_s = max(self.late_worst_s, late)
        return True

    @property
    def late_sd_s(self) -> float:
        """Standard deviation of the lateness; 0 below two deadlines."""
        return math.sqrt(self._squares / (self.count - 1)) if self.count > 1 else 0.0

    def text(self) -> str:
        """One line for a person."""
        mean, sd, worst = (1e6 * each for each in (self.late_mean_s, self.late_sd_s, self.late_worst_s))
        return f"{self.count} deadlines, late by {mean:.0f} us (sd {sd:.0f}, worst {worst:.0f})"
