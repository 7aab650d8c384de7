# SPDX-License-Identifier: MIT
"""Record a CAN bus with python-can into a `candump -L` log that canplayer, SavvyCAN and `okid replay` read.

The log is only ever appended to, in whole lines and at short intervals: after a crash or a kill everything up to the
last interval is there. Nothing is decoded on the way to disk; a DBC only adds a table beside the log.
"""

from __future__ import annotations

import argparse
import csv
import os
import signal
import sys
import threading
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from types import FrameType
from typing import Any

import can

from okid._errors import InputError

EXIT_DONE, EXIT_USAGE, EXIT_DEVICE = 0, 2, 4
_POLL_S = 0.1


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


def identifier_text(message: can.Message) -> str:
    """The id as candump writes it: 3 hex digits, 8 for 29-bit ids and for error frames (which carry 0x20000000)."""
    if message.is_error_frame:
        return f"{message.arbitration_id | 0x20000000:08X}"
    return f"{message.arbitration_id:08X}" if message.is_extended_id else f"{message.arbitration_id:03X}"


def log_line(message: can.Message, channel: str) -> str:
    """One line of a `candump -L` log, with its line end."""
    data = bytes(message.data).hex().upper()
    if message.is_fd:
        flags = (1 if message.bitrate_switch else 0) | (2 if message.error_state_indicator else 0)
        body = f"##{flags:X}{data}"
    elif message.is_remote_frame:
        body = f"#R{message.dlc:X}" if message.dlc else "#R"
    else:
        body = f"#{data}"
    return f"({message.timestamp:.6f}) {channel} {identifier_text(message)}{body}\n"


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


def _take(message: can.Message, channel: str, log: LineFile, table: _Table | None, summary: Summary) -> None:
    log.add(log_line(message, channel))
    summary.frames += 1
    summary.first = message.timestamp if summary.first is None else summary.first
    summary.last = message.timestamp
    name = identifier_text(message)
    summary.identifiers[name] = summary.identifiers.get(name, 0) + 1
    if message.is_error_frame:
        summary.errors += 1
    elif table is not None and not message.is_remote_frame and not table.add(message):
        summary.undecoded += 1


def record_bus(
    bus: can.BusABC,
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
    """Append every frame of an open python-can bus to a `candump -L` log.

    Ends after `duration` s, after `frames` frames, when `stop()` says so, or when the bus fails (Summary.fault then
    says why; what came before is kept). `database` (cantools) with `csv_path` also writes decoded signals, one row a
    frame. The bus stays open: it is the caller's. Raises OSError when a file cannot be written.
    """
    if (database is None) != (csv_path is None):
        raise InputError("decoding needs both a DBC and a file for the table")
    summary = Summary(Path(path))
    log = LineFile(Path(path))
    table = None
    try:
        table = None if csv_path is None else _Table(database, Path(csv_path))
        begun = flushed = clock()
        while not (stop is not None and stop()):
            now = clock()
            if (duration is not None and now - begun >= duration) or (frames is not None and summary.frames >= frames):
                break
            if now - flushed >= flush_s:
                log.flush()
                if table is not None:
                    table.flush()
                flushed = now
            left = _POLL_S if duration is None else min(_POLL_S, max(0.0, duration - (now - begun)))
            try:
                message = bus.recv(timeout=left)
            except (can.CanError, OSError) as fault:
                summary.fault = str(fault) or type(fault).__name__
                break
            if message is not None:
                _take(message, channel, log, table, summary)
    finally:
        log.close()
        if table is not None:
            table.close()
    return summary


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="okid-capture",
        description="Record a bus to a log that `okid replay` and canplayer read.",
        epilog="example: okid-capture can --interface socketcan --channel can0 --out run.log --duration 20",
    )
    kinds = parser.add_subparsers(dest="kind", required=True, metavar="can")
    bus = kinds.add_parser(
        "can",
        help="a CAN bus through python-can",
        description="Record a CAN bus with python-can to a `candump -L` log; ends on Ctrl-C, --duration or --frames.",
        epilog="example: okid-capture can --interface slcan --channel /dev/ttyACM0 --bitrate 500000 --out run.log "
        "--dbc frame.dbc --csv run.csv",
    )
    bus.add_argument("--interface", required=True, metavar="NAME", help="of python-can: socketcan, slcan, virtual ..")
    bus.add_argument("--channel", required=True, metavar="NAME", help="can0, vcan0, /dev/ttyACM0 ..")
    bus.add_argument("--out", required=True, metavar="FILE.log", help="log file; an existing one is appended to")
    bus.add_argument("--bitrate", type=int, metavar="BIT/S", help="where the adapter sets it")
    bus.add_argument("--fd", action="store_true", help="receive CAN FD frames too")
    bus.add_argument("--duration", type=float, metavar="S", help="end after so many seconds")
    bus.add_argument("--frames", type=int, metavar="N", help="end after so many frames")
    bus.add_argument("--dbc", metavar="FILE", help="decode with this DBC (cantools) ..")
    bus.add_argument("--csv", metavar="FILE", help=".. into this table, one row a frame")
    return parser


def _open_bus(args: argparse.Namespace) -> can.BusABC:
    options: dict[str, Any] = {"fd": True} if args.fd else {}
    if args.bitrate is not None:
        options["bitrate"] = args.bitrate
    return can.Bus(interface=args.interface, channel=args.channel, **options)


def _usage_fault(args: argparse.Namespace) -> str | None:
    if args.interface not in can.VALID_INTERFACES:
        return f"no python-can interface {args.interface!r}; there are {', '.join(sorted(can.VALID_INTERFACES))}"
    if args.duration is not None and not 0.0 < args.duration < float("inf"):
        return f"--duration is {args.duration}, expected seconds > 0"
    if args.frames is not None and args.frames < 1:
        return f"--frames is {args.frames}, expected a whole number >= 1"
    if (args.dbc is None) != (args.csv is None):
        return "--dbc and --csv belong together"
    return None


def _load_dbc(path: str) -> Any:
    import cantools

    try:
        return cantools.database.load_file(path)
    except OSError as fault:
        raise InputError(f"{path}: {fault.strerror or fault}") from None
    except Exception as fault:  # cantools has many parse errors without a common base
        raise InputError(f"{path}: not a readable DBC: {fault}") from None


def _run(args: argparse.Namespace, stop: threading.Event) -> int:
    fault = _usage_fault(args)
    if fault is not None:
        print(f"okid-capture: {fault}", file=sys.stderr)
        return EXIT_USAGE
    try:
        database = None if args.dbc is None else _load_dbc(args.dbc)
    except InputError as wrong:
        print(f"okid-capture: {wrong}", file=sys.stderr)
        return EXIT_USAGE
    try:
        bus = _open_bus(args)
    except (can.CanError, OSError, ImportError, ValueError, TypeError) as refused:
        print(f"okid-capture: cannot open {args.interface} {args.channel}: {refused}", file=sys.stderr)
        return EXIT_DEVICE
    try:
        summary = record_bus(
            bus, args.out, channel=args.channel.rsplit("/", 1)[-1], duration=args.duration, frames=args.frames,
            database=database, csv_path=args.csv, stop=stop.is_set,
        )  # fmt: skip
    except OSError as full:
        print(f"okid-capture: {full.filename or args.out}: {full.strerror or full}", file=sys.stderr)
        return EXIT_USAGE
    finally:
        bus.shutdown()
    print(summary.text())
    if summary.fault is not None:
        print(f"okid-capture: {args.channel}: {summary.fault}; what came before is in {args.out}", file=sys.stderr)
        return EXIT_DEVICE
    return EXIT_DONE


def main(arguments: Sequence[str] | None = None) -> int:
    """Entry point of okid-capture; returns the exit code."""
    args = _parser().parse_args(arguments)
    stop = threading.Event()

    def ask_to_stop(_number: int, _frame: FrameType | None) -> None:
        stop.set()

    before = {number: signal.signal(number, ask_to_stop) for number in (signal.SIGINT, signal.SIGTERM)}
    try:
        return _run(args, stop)
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


if __name__ == "__main__":
    sys.exit(main())
