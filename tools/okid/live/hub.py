# SPDX-License-Identifier: MIT
"""What waits for each browser: bounded, so that a slow one loses old frames and holds up no other."""

from __future__ import annotations

import json
import math
import threading
from collections import deque
from collections.abc import Callable
from typing import Any, NamedTuple

MOST_FRAMES, MOST_BYTES = 256, 8 << 20
MOST_PAGES = 16


class Frame(NamedTuple):
    """A message as it goes over the wire; a passing one (lanes) may be left out when the browser is slow."""

    kind: str
    data: bytes
    passing: bool = False


def _finite(content: Any) -> Any:
    if isinstance(content, dict):
        return {key: _finite(value) for key, value in content.items()}
    if isinstance(content, list | tuple):
        return [_finite(value) for value in content]
    return None if isinstance(content, float) and not math.isfinite(content) else content


def frame(kind: str, content: Any, passing: bool = False) -> Frame:
    """A server-sent event of that name with JSON content; what is no number (NaN, infinite) is null."""
    try:
        text = json.dumps(content, separators=(",", ":"), allow_nan=False)
    except ValueError:
        text = json.dumps(_finite(content), separators=(",", ":"), allow_nan=False)
    return Frame(kind, f"event: {kind}\ndata: {text}\n\n".encode(), passing)


class Outbox:
    """Frames for one browser: put() never waits. When it is full the oldest passing frames go; when it is still full
    everything goes, and a snapshot of all that is known comes in its place."""

    def __init__(self, snapshot: Callable[[], Frame], frames: int = MOST_FRAMES, size: int = MOST_BYTES) -> None:
        self.dropped = 0
        self._snapshot, self._most_frames, self._most_bytes = snapshot, frames, size
        self._waiting: deque[Frame] = deque()
        self._bytes = 0
        self._resync = False
        self._closed = False
        self._news = threading.Condition()

    def put(self, one: Frame) -> None:
        """Add a frame."""
        with self._news:
            if self._resync:  # the snapshot that is taken later holds it
                self.dropped += 1
                return
            self._waiting.append(one)
            self._bytes += len(one.data)
            if self._full():
                self._thin_out()
            self._news.notify()

    def _full(self) -> bool:
        return len(self._waiting) > self._most_frames or self._bytes > self._most_bytes

    def _thin_out(self) -> None:
        """Half of the room is made at once: this is not done again for every frame."""
        kept: deque[Frame] = deque()
        for k, one in enumerate(self._waiting):
            if one.passing and (len(self._waiting) - k > self._most_frames // 2 or self._bytes > self._most_bytes // 2):
                self._bytes -= len(one.data)
                self.dropped += 1
            else:
                kept.append(one)
        self._waiting = kept
        if self._full():
            self.dropped += len(kept)
            self._waiting, self._bytes, self._resync = deque(), 0, True

    def take(self, timeout: float) -> list[bytes]:
        """All that waits; after `timeout` s without anything an empty list, at once when closed."""
        with self._news:
            if not self._waiting and not self._resync and not self._closed:
                self._news.wait(timeout)
            out = [one.data for one in self._waiting]
            self._waiting.clear()
            self._bytes = 0
            resync, self._resync = self._resync, False
        return [self._snapshot().data, *out] if resync else out

    @property
    def closed(self) -> bool:
        """close() was called."""
        return self._closed

    def close(self) -> None:
        """Nothing more comes."""
        with self._news:
            self._closed = True
            self._news.notify()


class Hub:
    """All pages that are open. `on_change(count)` is called when one comes or goes."""

    def __init__(self, on_change: Callable[[int], None], most: int = MOST_PAGES) -> None:
        self._on_change, self._most = on_change, most
        self._pages: list[Outbox] = []
        self._lock = threading.Lock()

    def __len__(self) -> int:
        return len(self._pages)

    def open(self, outbox: Outbox) -> bool:
        """Add a page; False when there are as many as there may be."""
        with self._lock:
            if len(self._pages) >= self._most:
                return False
            self._pages.append(outbox)
            count = len(self._pages)
        self._on_change(count)
        return True

    def leave(self, outbox: Outbox) -> None:
        """A page was closed."""
        with self._lock:
            self._pages.remove(outbox)
            count = len(self._pages)
        outbox.close()
        self._on_change(count)

    def send(self, one: Frame) -> None:
        """To every page."""
        with self._lock:
            pages = list(self._pages)
        for page in pages:
            page.put(one)

    def close(self) -> None:
        """End every page."""
        with self._lock:
            pages = list(self._pages)
        for page in pages:
            page.close()
