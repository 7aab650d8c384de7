# SPDX-License-Identifier: MIT
"""A device is read in a thread of its own: while a model is computed nothing stays in its small buffer."""

from __future__ import annotations

import threading
import time
from collections import deque
from collections.abc import Callable, Iterator
from typing import Generic, TypeVar

Item = TypeVar("Item")
_MOST = 65536  # items that wait; beyond that the device waits, and counts what it loses
_END_S = 1.0  # what the device still holds at the end is taken, for no longer than this


class ReaderThread(Generic[Item]):
    """`read(timeout)` returns the next item or None; it runs in the thread until close() or its first error."""

    def __init__(self, read: Callable[[float], Item | None], poll_s: float = 0.1) -> None:
        self._read, self._poll_s = read, poll_s
        self._items: deque[Item] = deque()
        self._some = threading.Event()
        self._end = threading.Event()
        self._fault: Exception | None = None
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    def _run(self) -> None:
        until = None
        while True:
            if self._end.is_set():
                until = time.monotonic() + _END_S if until is None else until
                if time.monotonic() > until:
                    return
            try:
                item = self._read(0.0 if self._end.is_set() else self._poll_s)
            except Exception as fault:  # whatever the device's library raises is handed to the reader of the items
                self._fault = fault
                self._some.set()
                return
            if item is not None:
                self._items.append(item)
                self._some.set()
            elif self._end.is_set():
                return
            while len(self._items) >= _MOST and not self._end.is_set():
                time.sleep(0.001)

    def items(
        self, stop: Callable[[], bool] | None, duration: float | None = None, idle_s: float = 0.05
    ) -> Iterator[Item | None]:
        """What comes, in order; None when nothing came for `idle_s`. After `stop()` what is still there, then the end;
        likewise a second after `duration` s, counted from the first item, or from now while there is none.

        Raises what read() raised, after the items before it.
        """
        until, heard = None if duration is None else time.monotonic() + duration + 1.0, False

        def ended() -> bool:
            return (stop is not None and stop()) or (until is not None and time.monotonic() >= until)

        while True:
            while self._items:
                if duration is not None and not heard:
                    until, heard = time.monotonic() + duration + 1.0, True
                yield self._items.popleft()
                if not self._end.is_set() and ended():
                    self._end.set()
            if not self._end.is_set() and ended():
                self._end.set()
            if not self._thread.is_alive() and not self._items:
                break
            self._some.clear()
            if not self._items:
                if self._end.is_set():
                    self._thread.join()
                elif not self._some.wait(idle_s):
                    yield None
        if self._fault is not None:
            raise self._fault

    def close(self) -> None:
        """End the thread."""
        self._end.set()
        self._thread.join(2.0 + self._poll_s)
