# SPDX-License-Identifier: MIT
"""One line on a terminal that says how far a campaign is; nothing when stderr is no terminal."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable
from typing import TextIO

_EVERY_S, _WIDTH = 0.25, 24


class ProgressLine:
    """records and groups done of all, a rate, the time that is left."""

    def __init__(
        self, records: int, groups: int, out: TextIO | None = None, clock: Callable[[], float] = time.monotonic
    ) -> None:
        self._records, self._groups = records, groups
        self._out, self._clock = out or sys.stderr, clock
        self._shown = self._out.isatty()
        self._begin = self._last = clock()
        self._first: int | None = None

    def show(self, records: int, groups: int, last: bool = False) -> None:
        """Draw, at most four times a second."""
        now = self._clock()
        if not self._shown or (now - self._last < _EVERY_S and not last):
            return
        self._first = records if self._first is None else self._first
        self._last = now
        share = (records + groups) / max(1, self._records + self._groups)
        bar = "#" * round(_WIDTH * share)
        rate = (records - self._first) / max(1e-9, now - self._begin)
        left = f", {(self._records - records) / rate:.0f} s left" if rate > 0 and records < self._records else ""
        text = (
            f"[{bar:<{_WIDTH}}] {records}/{self._records} records, {groups}/{self._groups} groups, {rate:.1f}/s{left}"
        )
        self._out.write(f"\r\x1b[K{text}" + ("\n" if last else ""))
        self._out.flush()
