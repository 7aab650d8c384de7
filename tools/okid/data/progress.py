# SPDX-License-Identifier: MIT
"""What a long command does and how long it goes on, on stderr; nothing for what takes less than 2 s, nor where
OKID_PROGRESS is 0. The same as files/progress.cpp of the program."""

from __future__ import annotations

import os
import sys
import threading
import time
from typing import TextIO

from okid._errors import one_line

FIRST_S, REDRAW_S, LINE_S = 2.0, 0.5, 10.0
WIDTH = 78


def progress_text(stage: str, share: float | None, seconds: float, begun_at: float = 0.0) -> str:
    """ "reading a.csv, 40 %, 12 s left". `share` 0 to 1, None = not known; it was `begun_at` so many seconds ago."""
    if share is None:
        return stage
    share = min(max(share, 0.0), 1.0)
    gained = share - begun_at
    left_s = seconds * (1.0 - share) / gained if gained > 0.05 else 0.0
    return f"{stage}, {100.0 * share:.0f} %" + (f", {left_s:.0f} s left" if left_s >= 1.0 else "")


def _fitted(text: str, room: int) -> str:
    """Without its middle, where it is too long: the end of a path tells more than its begin."""
    return text if len(text) <= room else f"{text[: room // 3]}..{text[len(text) - (room - room // 3 - 2) :]}"


class Progress:
    """A context. A terminal has one line that is drawn again; anything else gets a line every 10 s. A thread writes: a
    stage that reports nothing for a minute is seen to go on."""

    def __init__(self, program: str, wanted: bool = True, out: TextIO | None = None, hurry: float = 1.0) -> None:
        self._program, self._out = program, out or sys.stderr
        self._wanted = wanted and os.environ.get("OKID_PROGRESS") != "0"
        self._terminal, self._hurry = self._out.isatty(), hurry
        self._lock, self._end, self._shown = threading.Lock(), threading.Event(), False
        self._stage, self._detail, self._begun_at = "working", "", 0.0
        self._share: float | None = None
        self._begin = self._since = time.monotonic()
        self._thread = threading.Thread(target=self._show, name="okid progress", daemon=True)

    def __enter__(self) -> Progress:
        if self._wanted:
            self._thread.start()
        return self

    def __exit__(self, *_fault: object) -> None:
        self._end.set()
        if self._wanted:
            self._thread.join()
        if self._shown and self._terminal:
            self._write(f"\r{'':{WIDTH}}\r")

    def stage(self, text: str, share: float | None = None, detail: str = "") -> None:
        """What is done now, and how much of it is done; the time that is left counts from the first call of a stage.
        `detail`: numbers that change within it."""
        with self._lock:
            if text != self._stage:
                self._stage, self._since, self._begun_at = text, time.monotonic(), share or 0.0
            self._share, self._detail = share, detail

    def _write(self, text: str) -> None:
        try:
            self._out.write(text)
            self._out.flush()
        except (OSError, ValueError):  # its reader is gone
            self._end.set()

    def _show(self) -> None:
        due = self._begin + (FIRST_S if self._terminal else LINE_S) / self._hurry
        while not self._end.wait(max(0.0, due - time.monotonic())):
            now = time.monotonic()
            with self._lock:
                stage = one_line(f"{self._stage} {self._detail}".rstrip())
                tail = progress_text("", self._share, now - self._since, self._begun_at)
            head = f"{self._program}: {now - self._begin:.0f} s, "
            if self._terminal:
                self._write(f"\r{head + _fitted(stage, WIDTH - len(head) - len(tail)) + tail:{WIDTH}}")
            else:
                self._write(f"{head}{stage}{tail}\n")
            self._shown = True
            due += (REDRAW_S if self._terminal else LINE_S) / self._hurry
