# SPDX-License-Identifier: MIT
"""Frames of a CAN bus into a `candump -L` log that canplayer, SavvyCAN and `okid replay` read.

The log is only ever appended to, in whole lines and at short intervals: after a crash or a kill everything up to the
last interval is there. Nothing is decoded on the way to disk; a DBC only adds a table beside the log.
"""

from __future__ import annotations

import csv
import os
import time
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

from okid._errors import InputError
from okid.formats.candump_text import identifier_text, log_line

if TYPE_CHECKING:
    import can

_POLL_S = 0.1
_MOST_IDENTIFIERS = 4096  # counted one by one


@dataclass
class Summary:
    """What a recording holds. Times in s since 1970 as stamped by the driver; `fault` tells why it ended early."""

    path: Path
    frames: int = 0
    errors: int = 0
    undecoded: int = 0
    first: float | None = None
    last: float | None = None
    identifiers: dict[str, int] = field(default_factory=dict)
    fault: str | None = None

    def text(self) -> str:
        """Some lines for a person."""
        span = 0.0 if self.first is None or self.last is None else self.last - self.first
        rate = f", {(self.frames - 1) / span:.1f} frames/s" if span > 0.0 else ""
        lines = [f"{self.path}: {self.frames} frames over {span:.3f} s{rate}, {self.errors} error frames"]
        busiest = sorted(self.identifiers.items(), key=lambda item: (-item[1], item[0]))
        lines += [f"  {name:>8}  {count}" for name, count in busiest[:16]]
        if len(busiest) > 16:
            lines.append(f"  and {len(busiest) - 16} more identifiers")
        if self.undecoded:
            lines.append(f"  {self.undecoded} frames could not be decoded with the DBC")
        return "\n".join(lines)


class LineFile:
    """Appends whole lines: each write() to the system holds only complete lines, so a kill tears none."""

    def __init__(self, path: Path) -> None:
        self._waiting: list[str] = []
        self._fd = os.open(path, os.O_WRONLY | os.O_APPEND | os.O_CREAT | os.O_CLOEXEC, 0o644)
        if self._torn(path):
            self._waiting.append("\n")  # an older file that ends in the middle of a line keeps its last line

    @staticmethod
    def _torn(path: Path) -> bool:
        with open(path, "rb") as old:
            if old.seek(0, os.SEEK_END) == 0:
                return False
            old.seek(-1, os.SEEK_END)
            return old.read(1) != b"\n"

    def add(self, line: str) -> None:
        """Keep a line (with its end) for the next flush()."""
        self._waiting.append(line)

    def flush(self) -> None:
        """Hand everything to the system. OSError (disk full ..) leaves the lines waiting."""
        data = "".join(self._waiting).encode()
        while data:
            data = data[os.write(self._fd, data) :]
            self._waiting = [data.decode()]
        self._waiting = []

    def close(self) -> None:
        """Flush, bring to disk, close."""
        try:
            self.flush()
            os.fsync(self._fd)
        finally:
            os.close(self._fd)


class _Table:
    """Decoded signals as a table of events: one row a frame, the cells of other messages stay empty."""

    def __init__(self, database: Any, path: Path) -> None:
        self._database = database
        self._names = [f"{m.name}.{s.name}" for m in database.messages for s in m.signals]
        self._file = LineFile(path)
        self._put(["time_s", *self._names])

    def _put(self, cells: Sequence[object]) -> None:
        sink: list[str] = []
        csv.writer(_Lines(sink), lineterminator="\n").writerow(cells)
        self._file.add("".join(sink))

    def add(self, message: can.Message) -> bool:
        """Decode one frame; False when the DBC cannot."""
        try:
            definition = self._database.get_message_by_frame_id(message.arbitration_id)
            values = definition.decode(bytes(message.data), decode_choices=False)
        except Exception:  # cantools raises KeyError, its own DecodeError and bitstruct.Error: all mean "not this one"
            return False
        cells = {f"{definition.name}.{name}": value for name, value in values.items()}
        self._put([f"{message.timestamp:.6f}", *(cells.get(name, "") for name in self._names)])
        return True

    def flush(self) -> None:
        self._file.flush()

    def close(self) -> None:
        self._file.close()


class _Lines:
    """The part of a text file that csv.writer needs."""

    def __init__(self, sink: list[str]) -> None:
        self._sink = sink

    def write(self, text: str) -> int:
        self._sink.append(text)
        return len(text)


class Recorder:
    """Takes frames into a log, and with a cantools database into a table beside it; hands them to the system every
    `flush_s`. A context manager. Raises OSError when a file cannot be written.
    """

    def __init__(
        self,
        path: str | os.PathLike[str],
        *,
        channel: str = "can0",
        database: Any = None,
        csv_path: str | os.PathLike[str] | None = None,
        flush_s: float = 0.25,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        if (database is None) != (csv_path is None):
            raise InputError("decoding needs both a DBC and a file for the table")
        self.summary = Summary(Path(path))
        self._channel, self._flush_s, self._clock = channel, flush_s, clock
        self._log = LineFile(Path(path))
        self._table: _Table | None = None
        try:
            self._table = None if csv_path is None else _Table(database, Path(csv_path))
        except OSError:
            self._log.close()
            raise
        self._flushed = clock()

    def __enter__(self) -> Recorder:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def add(self, message: can.Message) -> None:
        """Keep a frame."""
        summary = self.summary
        self._log.add(log_line(message, self._channel))
        summary.frames += 1
        summary.first = message.timestamp if summary.first is None else summary.first
        summary.last = message.timestamp
        name = identifier_text(message)
        if name not in summary.identifiers and len(summary.identifiers) >= _MOST_IDENTIFIERS:
            name = "others"
        summary.identifiers[name] = summary.identifiers.get(name, 0) + 1
        if message.is_error_frame:
            summary.errors += 1
        elif self._table is not None and not message.is_remote_frame and not self._table.add(message):
            summary.undecoded += 1
        self.tick()

    def tick(self) -> None:
        """Hand over what waits when it is time; call it while the bus is silent too."""
        now = self._clock()
        if now - self._flushed < self._flush_s:
            return
        self._log.flush()
        if self._table is not None:
            self._table.flush()
        self._flushed = now

    def close(self) -> None:
        """Everything to disk."""
        try:
            self._log.close()
        finally:
            if self._table is not None:
                self._table.close()


def record_bus(
    bus: can.BusABC | Iterable[can.Message],
    path: str | os.PathLike[str],
    *,
    channel: str = "can0",
    duration: float | None = None,
    frames: int | None = None,
    database: Any = None,
    csv_path: str | os.PathLike[str] | None = None,
    flush_s: float = 0.25,
    stop: Callable[[], bool] | None = None,
    clock: Callable[[], float] = time.monotonic,
) -> Summary:
    """Append every frame of an open python-can bus, or of messages that end by themselves, to a `candump -L` log.

    Ends after `duration` s, after `frames` frames, when `stop()` says so, or when the bus fails (Summary.fault then
    says why; what came before is kept). `database` (cantools) with `csv_path` also writes decoded signals, one row a
    frame. The bus stays open: it is the caller's. Raises OSError when a file cannot be written.
    """
    from can import CanError

    with Recorder(
        path, channel=channel, database=database, csv_path=csv_path, flush_s=flush_s, clock=clock
    ) as recorder:
        summary = recorder.summary
        begun, given = clock(), None if hasattr(bus, "recv") else iter(bus)
        while not (stop is not None and stop()):
            now = clock()
            if (duration is not None and now - begun >= duration) or (frames is not None and summary.frames >= frames):
                break
            recorder.tick()
            if given is not None:
                message = next(given, None)
                if message is None:
                    break
                recorder.add(message)
                continue
            left = _POLL_S if duration is None else min(_POLL_S, max(0.0, duration - (now - begun)))
            try:
                message = bus.recv(timeout=left)  # type: ignore[union-attr]
            except (CanError, OSError) as fault:
                summary.fault = str(fault) or type(fault).__name__
                break
            if message is not None:
                recorder.add(message)
    return summary
