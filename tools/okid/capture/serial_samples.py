# SPDX-License-Identifier: MIT
"""Bytes of a serial line to blocks of samples: decoded, on the sample grid, in SI units; and the bytes kept."""

from __future__ import annotations

import math
import os
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from okid.capture.config import BusConfig, CaptureConfig, load_config
from okid.capture.framing import Rows, framing_of
from okid.capture.grid import Grid
from okid.capture.lane import BusCounts, Frame, Lane
from okid.capture.reader_thread import ReaderThread

Real = NDArray[np.float64]
_IN_FRAME = 7  # fields that okid carries in one frame of a line
_BYTE_US = 0.25  # packets read together are stamped apart in their order
_MOST_BYTES = 4096  # of one read


class SerialSamples:
    """Push bytes, take blocks (n, inputs + outputs) in SI units; NaN where a sample is missing.

    `counts` as of a CAN bus; `damaged` packets or lines were refused, `skipped` bytes belonged to nothing.
    """

    def __init__(self, config: CaptureConfig, bus: BusConfig, *, limit: int | None = None) -> None:
        self.config, self.bus = config, bus
        wanted = config.wanted
        self.grid = Grid(config.rate_hz, len(wanted), limit)
        self.counts = BusCounts()
        self.framing = framing_of(bus)
        self.silent: list[str] = []
        self._scale = np.array([channel.scale for channel in wanted])
        self._offset = np.array([channel.offset for channel in wanted])
        self._period_us = 1e6 / config.rate_hz
        counted = bus.framing == "cobs" or bus.counter_field is not None
        self._bits = bus.counter_bits if bus.framing == "ascii" else 32
        groups: dict[int, list[int]] = {}
        for column, channel in enumerate(wanted):
            if channel.field is not None:
                groups.setdefault(channel.field // _IN_FRAME, []).append(column)
        self._lanes: list[tuple[Lane, list[int]]] = []
        for columns in groups.values():
            fields = [wanted[column].field or 0 for column in columns]
            self._lanes.append((self.grid.add_lane(columns, self.counts, self._bits if counted else None), fields))

    def push(self, data: bytes, time_us: int | None) -> None:
        """Bytes that came at `time_us`; None = out of a file: by the node's clock, else one sample after the other."""
        for found in self.framing.add(data):
            if self.grid.full:
                return
            self._place(found, time_us)

    def _place(self, found: Rows, time_us: int | None) -> None:
        if time_us is None:
            first_us = float(found.time_us if found.time_us is not None else self.counts.received * self._period_us)
        else:
            first_us = time_us - found.unread * _BYTE_US - (len(found.rows) - 1) * self._period_us
        loss = "crc" if found.broken else None
        for number, row in enumerate(found.rows):
            stamp = int(first_us + number * self._period_us)
            counter = None if found.sequence is None else (found.sequence + number) & ((1 << self._bits) - 1)
            self.counts.received += 1
            for lane, fields in self._lanes:
                values = [row[field] if field < len(row) else math.nan for field in fields]
                if any(map(math.isnan, values)):
                    self.counts.decode_errors += 1
                    continue
                self.grid.push(lane, Frame(stamp, values, counter, loss))
                loss = None

    @property
    def damaged(self) -> int:
        """Packets or lines refused."""
        return self.framing.damaged

    @property
    def skipped(self) -> int:
        """Bytes that belonged to nothing."""
        return self.framing.skipped

    def take(self) -> list[Real]:
        """Blocks that are complete, in order."""
        return [block * self._scale + self._offset for block in self.grid.take()]

    def finish(self) -> list[Real]:
        """The stream ends: the last blocks."""
        self.grid.finish()
        wanted = self.config.wanted
        self.silent = [wanted[c].name for lane, _ in self._lanes if not lane.heard for c in lane.columns]
        return self.take()


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


def serial_blocks(
    port: Any,
    config: CaptureConfig | str | Path,
    *,
    samples: SerialSamples | None = None,
    block: int = 256,
    duration: float | None = None,
    stop: Callable[[], bool] | None = None,
    tap: Callable[[bytes], None] | None = None,
    clock: Callable[[], float] = time.time,
) -> Iterator[Real]:
    """Blocks (n, inputs + outputs) in SI units as they come, for Session.feed(); NaN where a sample is missing.

    `port`: an open pyserial port, or a binary file of bytes that were recorded, which ends by itself. A port is read in
    a thread of its own for `duration` s of samples (of a silent line: a second more by the clock) or until `stop()`;
    `tap` gets the bytes there, as they come. `clock` stamps them, s. Raises InputError (config) or OSError (the port
    failed, as when it is unplugged: what came before has been given out), or what `tap` raises.
    """
    if isinstance(config, str | Path):
        config = load_config(config)
    kept = samples or SerialSamples(config, config.bus("serial"))
    kept.grid.end_after(duration)
    chunks = _port_chunks(port, duration, stop, tap, clock) if hasattr(port, "in_waiting") else _file_chunks(port, stop)
    fault: Exception | None = None
    try:
        for chunk in chunks:
            if chunk is not None:
                kept.push(*chunk)
            if kept.grid.full:
                break
            if kept.grid.waiting >= block or chunk is None:
                yield from kept.take()
    except OSError as failed:
        fault = failed
    yield from kept.finish()
    if fault is not None:
        raise fault


def _file_chunks(file: Any, stop: Callable[[], bool] | None) -> Iterator[tuple[bytes, None]]:
    while not (stop is not None and stop()):
        data = file.read(_MOST_BYTES)
        if not data:
            return
        yield data, None


def _port_chunks(
    port: Any,
    duration: float | None,
    stop: Callable[[], bool] | None,
    tap: Callable[[bytes], None] | None,
    clock: Callable[[], float],
) -> Iterator[tuple[bytes, int] | None]:
    def read(timeout: float) -> tuple[bytes, int] | None:
        port.timeout = timeout
        data = port.read(1)
        if not data:
            return None
        port.timeout = 0  # and what came with it: not every kind of port can tell how much that is
        data += port.read(_MOST_BYTES)
        stamp = round(clock() * 1e6)
        if tap is not None:
            tap(data)
        return data, stamp

    reader = ReaderThread(read)
    try:
        yield from reader.items(stop, duration)
    finally:
        reader.close()
