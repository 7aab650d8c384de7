# SPDX-License-Identifier: MIT
"""Logs of CAN frames: every format that python-can reads and writes, and `candump -L` text as okid replays it."""

from __future__ import annotations

import contextlib
import re
import sqlite3
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field
from datetime import datetime
from pathlib import Path
from typing import Any

import can

from okid._errors import InputError
from okid.formats.blf_containers import check_blf
from okid.formats.bus_mdf4 import bus_number, write_bus_mdf4
from okid.formats.candump_text import log_line
from okid.formats.foreign_library import Complaints, library, listening, reading, writing
from okid.formats.log_names import FRAME_CSV_HEAD, LOG_EXTENSIONS, is_frame_csv
from okid.formats.mdf4 import quiet_asammdf
from okid.formats.mdf4_blocks import check_mdf4
from okid.formats.sqlite_log import sqlite_frames

_LINE = re.compile(
    r"\((?P<time>\d+(?:\.\d+)?)\)[ \t]+(?P<bus>[!-~]+)[ \t]+(?P<id>[0-9A-Fa-f]{3}|[0-9A-Fa-f]{8})#"
    r"(?:#(?P<flags>[0-9A-Fa-f])(?P<fd>(?:[0-9A-Fa-f]{2})*)|(?P<remote>[Rr])(?P<dlc>[0-8])?|"
    r"(?P<data>(?:[0-9A-Fa-f]{2}){0,8}))(?:_[0-9A-Fa-f])?(?:[ \t]+(?P<way>[RT]))?"
)
# What candump shows on a terminal with -t a, A, d or z, and with -x; not its ASCII column, which -a adds.
_SHOWN = re.compile(
    r"[ \t]*\((?P<time>\d{4}-\d\d-\d\d \d\d:\d\d:\d\d\.\d+|\d+\.\d+)\)[ \t]+(?P<bus>[!-~]+)[ \t]+"
    r"(?:(?P<way>[RT])X (?P<brs>[B-]) (?P<esi>[E-])[ \t]+)?"
    r"(?P<id>[0-9A-Fa-f]{3}|[0-9A-Fa-f]{8})[ \t]+\[(?P<dlc>\d{1,2})\]"
    r"(?P<data>(?:[ \t]+[0-9A-Fa-f]{2})*)(?P<remote>[ \t]+remote request)?(?:[ \t]+ERRORFRAME)?(?:[ \t]+'.*')?"
)
_FORMS = "(seconds) interface ID#data, ID##flags data or ID#R, as candump -L writes it, or what candump -t a shows"


_LAST_S = 9e9  # 2255: what the nanoseconds of a journal hold


def _cannot_hold(extension: str, frame: can.Message) -> str | None:
    """The kind of this frame if python-can's writer of the format drops or changes it."""
    if frame.is_fd and (extension in (".csv", ".db", ".trc") or (extension == ".asc" and not frame.data)):
        return "a CAN FD frame" if extension != ".asc" else "a CAN FD frame without data"
    if extension == ".trc" and (frame.is_remote_frame or frame.is_error_frame):
        return "a remote frame" if frame.is_remote_frame else "an error frame"
    return None


@dataclass
class LogSummary:
    """What convert_log() did. remarks: what the new format does not keep, in words."""

    frames: int = 0
    first_s: float | None = None
    last_s: float | None = None
    buses: dict[str, int] = field(default_factory=dict)
    errors: int = 0
    remarks: list[str] = field(default_factory=list)

    def take(self, frame: can.Message) -> None:
        """Count one frame."""
        self.frames += 1
        self.first_s = frame.timestamp if self.first_s is None else self.first_s
        self.last_s = frame.timestamp
        self.errors += bool(frame.is_error_frame)
        bus = str(frame.channel)
        self.buses[bus] = self.buses.get(bus, 0) + 1


def _extension(path: str | Path) -> str:
    ending = Path(path).suffix.lower()
    if ending not in LOG_EXTENSIONS:
        raise InputError(f"{path}: the extension is {ending!r}, expected one of {', '.join(LOG_EXTENSIONS)}")
    return ending


def _candump_frame(found: re.Match[str]) -> can.Message:
    number = int(found["id"], 16)
    error = len(found["id"]) == 8 and bool(number & 0x20000000)
    given: dict[str, Any] = {"data": bytes.fromhex(found["data"] or "")}
    if found["flags"] is not None:
        flags = int(found["flags"], 16)
        given = {"data": bytes.fromhex(found["fd"]), "is_fd": True}
        given |= {"bitrate_switch": bool(flags & 1), "error_state_indicator": bool(flags & 2)}
    elif found["remote"]:
        given = {"is_remote_frame": True, "dlc": int(found["dlc"] or 0)}
    return can.Message(
        timestamp=float(found["time"]), arbitration_id=number & 0x1FFFFFFF, is_extended_id=len(found["id"]) == 8,
        is_error_frame=error, channel=found["bus"], is_rx=found["way"] != "T", **given,
    )  # fmt: skip


def _shown_frame(found: re.Match[str], time_s: float) -> can.Message:
    number, data = int(found["id"], 16), bytes.fromhex(found["data"] or "")
    error = len(found["id"]) == 8 and bool(number & 0x20000000)
    given: dict[str, Any] = {"is_remote_frame": True, "dlc": int(found["dlc"])} if found["remote"] else {"data": data}
    if len(found["dlc"]) == 2:  # so candump shows CAN FD
        given |= {"is_fd": True, "bitrate_switch": found["brs"] == "B", "error_state_indicator": found["esi"] == "E"}
    if not found["remote"] and len(data) != int(found["dlc"]):
        raise InputError(f"{found[0][:60]!r} shows {len(data)} bytes and states {int(found['dlc'])}")
    return can.Message(
        timestamp=time_s, arbitration_id=number & 0x1FFFFFFF, is_extended_id=len(found["id"]) == 8,
        is_error_frame=error, channel=found["bus"], is_rx=found["way"] != "T", **given,
    )  # fmt: skip


def _shows_steps(path: str | Path) -> bool:
    """Whether the times are those since the frame before (candump -t d): they fall, others only grow."""
    before = 0.0
    with open(path, encoding="utf-8", newline="") as file:
        for line in file:
            found = _SHOWN.fullmatch(line.rstrip("\r\n "))
            if found is None or "-" in found["time"]:
                return False
            if float(found["time"]) < before:
                return True
            before = float(found["time"])
    return False


def _candump(path: str | Path, remarks: list[str]) -> Iterator[can.Message]:
    """python-can's own reader takes error frames of candump for data frames and drops the length of remote ones."""
    steps, before = None, 0.0
    with open(path, encoding="utf-8", newline="") as file:
        for number, line in enumerate(file, 1):
            text = line.rstrip("\r\n ")
            if (found := _LINE.fullmatch(text)) is not None:
                yield _candump_frame(found)
            elif (found := _SHOWN.fullmatch(text)) is not None:
                if steps is None and (steps := _shows_steps(path)):
                    remarks.append("times are steps from frame to frame (candump -t d): added up from 0")
                if "-" in found["time"]:  # candump -t A: of the local clock
                    before = datetime.fromisoformat(found["time"]).astimezone().timestamp()
                else:
                    before = float(found["time"]) + (before if steps else 0.0)
                yield _shown_frame(found, before)
            elif text:
                raise InputError(f"{path}:{number}: found {text[:60]!r}, expected {_FORMS}")


def _bus_name(extension: str, channel: Any) -> str:
    """The interface of a frame: python-can gives names, numbers from 0 (from 1 in .trc), or nothing."""
    if isinstance(channel, str) and channel and not channel.isdigit():
        return re.sub(r"[^!-~]", "_", channel)[:15]
    number = int(channel) if channel is not None and str(channel).isdigit() else 0
    return f"can{max(number - 1, 0) if extension == '.trc' else number}"


def _whole(frame: can.Message, number: int) -> can.Message:
    """The frame if it is one: a time, an identifier of its kind, as many bytes as it says."""
    if not (isinstance(frame.timestamp, int | float) and 0 <= frame.timestamp < _LAST_S):
        raise InputError(f"frame {number} has the time {frame.timestamp!r}, expected seconds from 0 to {_LAST_S:g}")
    most = 0x1FFFFFFF if frame.is_extended_id else 0x7FF
    if not 0 <= frame.arbitration_id <= most:
        raise InputError(f"frame {number} has the identifier {frame.arbitration_id:X}, expected 0 to {most:X}")
    if not 0 <= frame.dlc <= 64 or len(frame.data or b"") > 64:
        raise InputError(f"frame {number} has {frame.dlc} bytes, expected at most 64")
    if not frame.is_remote_frame and not frame.is_error_frame:
        if len(frame.data) < frame.dlc:
            raise InputError(
                f"frame {number} holds {len(frame.data)} of {frame.dlc} bytes: the file is cut off or damaged"
            )
        frame.is_fd = frame.is_fd or len(frame.data) > 8  # .csv and .db do not mark them
    return frame


def _left_out(complaints: Complaints) -> list[str]:
    """What python-can has to say about lines that it skips."""
    lines = "line was" if complaints.count == 1 else "lines were"
    return [f"{complaints.count} {lines} not understood and left out ({complaints.first})"] if complaints.count else []


def read_log(path: str | Path, remarks: list[str] | None = None) -> Iterator[can.Message]:
    """The frames of a log in the file's order: .log (candump -L), .asc, .blf, .trc, .db, .mf4, .csv of python-can.

    Times in s since 1970 where the format has them; `channel` is always an interface name ("can0" where the file has
    a number or nothing). remarks: gets what python-can could not read and left out. InputError of one line names the
    file and the line or frame that is wrong, or says that there is no frame at all.
    """
    extension = _extension(path)
    if extension == ".mf4":
        library("asammdf", "MDF")
    with reading(path, f"a {extension} log of CAN frames"), quiet_asammdf(), listening("can") as complaints:
        if extension == ".csv" and not is_frame_csv(path):
            raise InputError(f"is no table of frames of python-can, expected the header {FRAME_CSV_HEAD}")
        count = 0
        found = remarks if remarks is not None else []
        for frame in _candump(path, found) if extension == ".log" else _library_frames(path, extension):
            count += 1
            frame.channel = _bus_name(extension, frame.channel)
            yield _whole(frame, count)
        if remarks is not None:
            remarks += _left_out(complaints)
        if count == 0:
            raise InputError(f"holds no CAN frame, expected a {extension} log")


def _library_frames(path: str | Path, extension: str) -> Iterator[can.Message]:
    options: dict[str, Any] = {"relative_timestamp": False} if extension == ".asc" else {}
    if extension == ".db":
        yield from sqlite_frames(path)
        return
    if extension == ".blf":
        check_blf(path)
    if extension == ".mf4":
        check_mdf4(path)
    with can.LogReader(path, **options) as reader:
        yield from reader


def _put_candump(part: Path, frames: Iterable[can.Message]) -> None:
    with part.open("w", encoding="utf-8", newline="\n") as out:
        for frame in frames:
            out.write(log_line(frame, str(frame.channel or "can0")))


def _put_db(part: Path, frames: Iterable[can.Message]) -> None:
    """The table of python-can's SqliteWriter, which itself loses what waits in its queue when it is stopped."""
    columns = "ts REAL, arbitration_id INTEGER, extended INTEGER, remote INTEGER, error INTEGER, dlc INTEGER, data BLOB"
    with contextlib.closing(sqlite3.connect(part)) as base, base:
        base.execute(f"CREATE TABLE messages ({columns})")
        base.executemany(
            "INSERT INTO messages VALUES (?, ?, ?, ?, ?, ?, ?)",
            (
                (f.timestamp, f.arbitration_id, f.is_extended_id, f.is_remote_frame, f.is_error_frame, f.dlc, f.data)
                for f in frames
            ),
        )


def _held(extension: str, frames: Iterable[can.Message]) -> Iterator[can.Message]:
    """The frames, as long as the format can hold them."""
    for number, frame in enumerate(frames, 1):
        kind = _cannot_hold(extension, frame)
        if kind is not None:
            raise InputError(
                f"frame {number} at {frame.timestamp:.6f} s is {kind}, which {extension} does not hold as python-can "
                "writes it: choose .log, .blf or .mf4"
            )
        yield frame


def _put(part: Path, extension: str, frames: Iterable[can.Message]) -> None:
    if extension == ".log":
        return _put_candump(part, frames)
    if extension == ".db":
        return _put_db(part, frames)
    if extension == ".mf4":
        return write_bus_mdf4(part, frames)
    with can.Logger(str(part)) as writer:
        for frame in frames:
            writer.on_message_received(frame)
    return None


def write_log(path: str | Path, frames: Iterable[can.Message]) -> None:
    """Write frames as .log (candump -L), .asc, .blf, .trc, .db, .mf4 or .csv, whole or not at all.

    InputError when a frame is of a kind that the format drops (CAN FD in .csv, .db, .trc; remote and error frames in
    .trc), or the file cannot be written. About 20 us a frame; .mf4 holds all frames in memory, 130 bytes each.
    """
    extension = _extension(path)
    with writing(path) as part:
        _put(part, extension, _held(extension, frames))


def _changes(extension: str, summary: LogSummary) -> list[str]:
    """What the new file does not say any more."""
    out = []
    if extension in (".csv", ".db"):
        out = ["the interface names are not kept"] if set(summary.buses) != {"can0"} else []
    elif extension != ".log" and any(not re.fullmatch(r"can\d+", bus) for bus in summary.buses):
        name = next(bus for bus in summary.buses if not re.fullmatch(r"can\d+", bus))
        out = [f"of the interface names only the numbers are kept: {name} reads back as can{bus_number(name)}"]
    if extension == ".asc" and summary.errors:
        out.append(f"identifier and data of {summary.errors} error frames are not kept")
    return out


def convert_log(source: str | Path, target: str | Path, progress: Callable[[int], None] | None = None) -> LogSummary:
    """Convert a log of CAN frames by the extensions of both names; frames stay in their order, none is dropped.

    progress: called every 10,000 frames. InputError as read_log() and write_log().
    """
    summary = LogSummary()

    def counted() -> Iterator[can.Message]:
        for frame in read_log(source, summary.remarks):
            summary.take(frame)
            if progress is not None and summary.frames % 10000 == 0:
                progress(summary.frames)
            yield frame

    write_log(target, counted())
    summary.remarks += _changes(_extension(target), summary)
    return summary
