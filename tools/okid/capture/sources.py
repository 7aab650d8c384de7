# SPDX-License-Identifier: MIT
"""What a capture is fed from: buses of python-can, messages of a log, ports of pyserial, files of recorded bytes."""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from okid.capture.config import CaptureConfig
from okid.capture.reader_thread import ReaderThread
from okid.capture.stream import Capture

if TYPE_CHECKING:
    import can

Real = NDArray[np.float64]
Stop = Callable[[], bool] | None
_BATCH = 512  # frames of one call
_EVERY_S = 0.05  # .. or what came in so long
_MOST_BYTES = 4096  # of one read


def feed_messages(
    bus: can.BusABC | Iterable[can.Message],
    capture: Capture,
    *,
    duration: float | None = None,
    stop: Stop = None,
    tap: Callable[[can.Message], None] | None = None,
    idle: Callable[[], None] | None = None,
) -> Iterator[None]:
    """Messages into a capture until it is done, batch by batch: yields after each.

    `bus`: an open python-can bus, or messages that end by themselves, such as messages_for() a log. A bus is read in a
    thread of its own for `duration` s (and a second more, by the clock), or until `stop()` says so; what it still holds
    then is taken. `tap` sees every message, `idle` is called while there is none. Raises what the bus raises, once what
    came before is in the capture.
    """
    live = hasattr(bus, "recv")
    items = _live_messages(bus, duration, stop) if live else _given(bus, stop)  # type: ignore[arg-type]
    waiting: list[can.Message] = []
    pushed = time.monotonic()
    try:
        for item in items:
            if item is not None:
                if tap is not None:
                    tap(item)
                waiting.append(item)
            elif idle is not None:
                idle()
            if len(waiting) >= _BATCH or item is None or (live and time.monotonic() - pushed >= _EVERY_S):
                capture.push(waiting)
                waiting, pushed = [], time.monotonic()
                yield
                if capture.done:
                    return
    finally:  # also what came before the bus failed
        if waiting and not capture.done:
            capture.push(waiting)
    yield


def _given(messages: Iterable[can.Message], stop: Stop) -> Iterator[can.Message | None]:
    for message in messages:
        if stop is not None and stop():
            return
        yield message


def _live_messages(bus: can.BusABC, duration: float | None, stop: Stop) -> Iterator[can.Message | None]:
    reader = ReaderThread(lambda timeout: bus.recv(timeout=timeout))
    try:
        yield from reader.items(stop, duration)
    finally:
        reader.close()


def feed_bytes(
    port: Any,
    capture: Capture,
    *,
    duration: float | None = None,
    stop: Stop = None,
    tap: Callable[[bytes], None] | None = None,
    clock: Callable[[], float] = time.time,
) -> Iterator[None]:
    """Bytes into a capture until it is done: yields after each read.

    `port`: an open pyserial port, or a binary file of bytes that were recorded, which ends by itself. A port is read in
    a thread of its own for `duration` s (and a second more) or until `stop()`; `tap` gets the bytes there.
    `clock` stamps them, s. Raises OSError when the port fails, as when it is unplugged, or what `tap` raises.
    """
    chunks = _port_chunks(port, duration, stop, tap, clock) if hasattr(port, "in_waiting") else _file_chunks(port, stop)
    for chunk in chunks:
        if chunk is None:
            capture.serve()
        else:
            capture.push_bytes(*chunk)
        yield
        if capture.done:
            return


def _file_chunks(file: Any, stop: Stop) -> Iterator[tuple[bytes, None]]:
    while not (stop is not None and stop()):
        data = file.read(_MOST_BYTES)
        if not data:
            return
        yield data, None


def _port_chunks(
    port: Any, duration: float | None, stop: Stop, tap: Callable[[bytes], None] | None, clock: Callable[[], float]
) -> Iterator[tuple[bytes, float] | None]:
    def read(timeout: float) -> tuple[bytes, float] | None:
        port.timeout = timeout
        data = port.read(1)
        if not data:
            return None
        port.timeout = 0  # and what came with it: not every kind of port can tell how much that is
        data += port.read(_MOST_BYTES)
        stamp = clock()
        if tap is not None:
            tap(data)
        return data, stamp

    reader = ReaderThread(read)
    try:
        yield from reader.items(stop, duration)
    finally:
        reader.close()


def _blocks(feed: Iterator[None], capture: Capture, block: int, latency_s: float) -> Iterator[Real]:
    waiting: list[Real] = []
    given_at = time.monotonic()
    fault: Exception | None = None
    try:
        for _ in feed:
            waiting += capture.take()
            if sum(map(len, waiting)) >= block or time.monotonic() - given_at >= latency_s:
                yield from waiting
                waiting, given_at = [], time.monotonic()
    except Exception as failed:  # of the device's library: what came before it is given out first
        fault = failed
    capture.finish()
    yield from waiting + capture.take()
    if fault is not None:
        raise fault


def can_blocks(
    bus: can.BusABC | Iterable[can.Message],
    config: CaptureConfig | str | Path,
    *,
    samples: Capture | None = None,
    block: int = 256,
    latency_s: float = 0.1,
    duration: float | None = None,
    stop: Stop = None,
    tap: Callable[[can.Message], None] | None = None,
    idle: Callable[[], None] | None = None,
) -> Iterator[Real]:
    """Blocks (n, inputs + outputs) in SI units as they come, for Session.feed(); NaN where a sample is missing.

    The arguments are those of feed_messages(). Blocks come after `block` samples or `latency_s`, whichever is sooner.
    `samples` keeps the counts: make a Capture(config, identify=False) to look at them.
    Raises InputError (config), can.CanError or OSError (the bus failed: what came before has been given out).
    """
    kept = samples or Capture(config, identify=False, duration=duration, keep_events=False)
    yield from _blocks(
        feed_messages(bus, kept, duration=duration, stop=stop, tap=tap, idle=idle), kept, block, latency_s
    )


def serial_blocks(
    port: Any,
    config: CaptureConfig | str | Path,
    *,
    samples: Capture | None = None,
    block: int = 256,
    latency_s: float = 0.1,
    duration: float | None = None,
    stop: Stop = None,
    tap: Callable[[bytes], None] | None = None,
    clock: Callable[[], float] = time.time,
) -> Iterator[Real]:
    """The same for a serial line, with the arguments of feed_bytes()."""
    kept = samples or Capture(config, identify=False, duration=duration, keep_events=False)
    yield from _blocks(
        feed_bytes(port, kept, duration=duration, stop=stop, tap=tap, clock=clock), kept, block, latency_s
    )


class RawFile:
    """Appends bytes as they come, each write handed to the system at once."""

    def __init__(self, path: str | os.PathLike[str]) -> None:
        self.path = Path(path)
        self.bytes = 0
        self._fd = os.open(path, os.O_WRONLY | os.O_APPEND | os.O_CREAT | os.O_CLOEXEC, 0o644)

    def add(self, data: bytes) -> None:
        """OSError when the disk is full."""
        while data:
            written = os.write(self._fd, data)
            self.bytes += written
            data = data[written:]

    def close(self) -> None:
        """To the disk, and close."""
        try:
            os.fsync(self._fd)
        finally:
            os.close(self._fd)

    def __enter__(self) -> RawFile:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()
