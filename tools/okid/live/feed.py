# SPDX-License-Identifier: MIT
"""The JSON lines of `[publish] socket`, read in a thread of their own; it waits for okid and comes back to it."""

from __future__ import annotations

import contextlib
import socket
import threading
from collections.abc import Callable
from pathlib import Path

from okid.data.line_splitter import LineSplitter

_RETRY_S, _RETRY_MOST_S = 0.1, 1.0
_CHUNK = 1 << 18


class Feed:
    """Reads a unix socket until stop(): on_line(bytes) for each line, on_link(True | False) when okid comes and goes.

    Both are called in the feed's own thread. Nothing is ever sent. A socket that is not there is tried ten times a
    second at first, then once a second: some 50 microseconds each.
    """

    def __init__(self, path: Path, on_line: Callable[[bytes], None], on_link: Callable[[bool], None]) -> None:
        self._path, self._on_line, self._on_link = path, on_line, on_link
        self._stop = threading.Event()
        self._wire: socket.socket | None = None
        self._thread = threading.Thread(target=self._run, name="okid-live feed", daemon=True)

    def start(self) -> None:
        """Begin to read."""
        self._thread.start()

    def stop(self) -> None:
        """End the thread; returns when it has ended."""
        self._stop.set()
        wire = self._wire
        if wire is not None:
            with contextlib.suppress(OSError):
                wire.shutdown(socket.SHUT_RDWR)
        if self._thread.is_alive():
            self._thread.join(5.0)

    def _run(self) -> None:
        pause = _RETRY_S
        while not self._stop.is_set():
            wire = self._connect()
            if wire is None:
                self._stop.wait(pause)
                pause = min(_RETRY_MOST_S, 1.5 * pause)
                continue
            pause = _RETRY_S
            self._on_link(True)
            with wire:
                self._read(wire)
            self._wire = None
            self._on_link(False)
            self._stop.wait(_RETRY_S)  # one that accepts and closes at once is not asked without rest

    def _connect(self) -> socket.socket | None:
        wire = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
        try:
            wire.connect(str(self._path))
        except OSError:  # not there, no program listens, no right to it: all of them may change
            wire.close()
            return None
        self._wire = wire
        return wire

    def _read(self, wire: socket.socket) -> None:
        lines = LineSplitter()
        while not self._stop.is_set():
            try:
                data = wire.recv(_CHUNK)
            except OSError:
                return
            if not data:
                return
            for line in lines.add(data):
                self._on_line(line)
