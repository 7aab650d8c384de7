# SPDX-License-Identifier: MIT
"""MCAP through the library `mcap`: samples and events as JSON messages that Foxglove and PlotJuggler plot.

A sample of the grid is a message of the topic /signals, with its number and a value a channel (null = missing); an
event is a message of /modes, /alarm .. as in the events file. The record's description is the metadata "okid.record/1".
A name that ends in .ros2.mcap gets messages of std_msgs in CDR instead, as ROS 2 records them.
"""

from __future__ import annotations

import json
import os
import re
import struct
from collections.abc import Iterable, Iterator, Sequence
from datetime import UTC, datetime
from pathlib import Path
from typing import IO, Any

import numpy as np

from okid._errors import InputError
from okid.data.input_file import parse_json
from okid.data.memory import require_memory, require_samples
from okid.data.records import Record
from okid.formats.foreign_library import library, reading, writing

SIGNALS = "/signals"
_ABOUT = "okid.record/1"
_ROW, _NUMBER = 200, 40  # bytes that a message and a number of it take while a file is read
_TIME = {
    "type": "object",
    "title": "time",
    "properties": {"sec": {"type": "integer"}, "nsec": {"type": "integer"}},
}


class McapFile:
    """Signals and events into an open binary file; close() writes the index, without which readers scan the file."""

    profile = ""

    def __init__(self, file: IO[bytes], start_ns: int, chunk_bytes: int = 1 << 20) -> None:
        self._writer = library("mcap.writer", "MCAP").Writer(file, chunk_size=chunk_bytes)
        self._writer.start(profile=self.profile, library="okid")
        self._start_ns = start_ns
        self._topics: dict[str, int] = {}
        self._names: list[str] = []
        self._fs_hz = 0.0

    def close(self) -> None:
        """Nothing can be written any more."""
        self._writer.finish()

    def describe(self, about: dict[str, Any]) -> None:
        """Names, units, rate .. of the signals, as Record.about() gives them: before the first sample."""
        self._names, self._fs_hz = list(about["names"]), float(about["fs_hz"])
        self._writer.add_metadata(_ABOUT, {"json": json.dumps(about)})
        values = {
            name: {"type": ["number", "null"], "description": unit}
            for name, unit in zip(self._names, about["units"], strict=True)
        }
        self._topic(SIGNALS, "okid.Signals", {"timestamp": _TIME, "sample": {"type": "integer"}, **values})

    def samples(self, first: int, rows: Iterable[Sequence[float | None]]) -> None:
        """Rows of the grid from sample number `first` on, one value a channel, None or NaN = missing."""
        for number, row in enumerate(rows, first):
            ns = self._ns(number / self._fs_hz)
            stamp = {"sec": ns // 1_000_000_000, "nsec": ns % 1_000_000_000}
            values = [None if value is None or value != value else value for value in row]
            self._put(
                self._topics[SIGNALS],
                ns,
                {"timestamp": stamp, "sample": number, **dict(zip(self._names, values, strict=True))},
            )

    def event(self, event: dict[str, Any]) -> None:
        """An event of okid run under its own topic, at its stream time."""
        kind = str(event["type"])
        channel = self._topics.get(f"/{kind}") or self._topic(f"/{kind}", f"okid.{kind}", {"t": {"type": "number"}})
        self._put(channel, self._ns(float(event.get("t") or 0.0)), event)

    def _ns(self, seconds: float) -> int:
        return self._start_ns + round(seconds * 1e9)

    def _topic(self, topic: str, name: str, properties: dict[str, Any]) -> int:
        text = json.dumps({"type": "object", "title": name, "properties": properties})
        schema = self._writer.register_schema(name, "jsonschema", text.encode())
        channel: int = self._writer.register_channel(topic, "json", schema)
        self._topics[topic] = channel
        return channel

    def _put(self, channel: int, ns: int, message: dict[str, Any]) -> None:
        self._writer.add_message(channel, log_time=ns, publish_time=ns, data=json.dumps(message).encode())


class Ros2McapFile(McapFile):
    """The same for ROS 2: /okid/signals/NAME and /okid/mode1/frequency_hz .. as std_msgs/msg/Float64 (NaN = missing),
    every event as the JSON text of a std_msgs/msg/String in /okid/events."""

    profile = "ros2"

    def describe(self, about: dict[str, Any]) -> None:
        self._fs_hz = float(about["fs_hz"])
        self._writer.add_metadata(_ABOUT, {"json": json.dumps(about)})
        for name in about["names"]:
            plain = re.sub(r"[^A-Za-z0-9_]", "_", name)
            plain = f"_{plain}" if plain[:1].isdigit() else plain
            while plain in self._names:
                plain += "_"
            self._names.append(plain)

    def samples(self, first: int, rows: Iterable[Sequence[float | None]]) -> None:
        for number, row in enumerate(rows, first):
            for name, value in zip(self._names, row, strict=True):
                self._number(f"/okid/signals/{name}", self._ns(number / self._fs_hz), value)

    def event(self, event: dict[str, Any]) -> None:
        ns = self._ns(float(event.get("t") or 0.0))
        text = json.dumps(event).encode() + b"\0"
        self._message("/okid/events", "String", ns, struct.pack("<I", len(text)) + text)
        for mode in event["modes"] if event["type"] == "modes" else []:
            for key in ("frequency_hz", "damping_ratio", "frequency_std_hz", "damping_ratio_std"):
                if mode.get("track") is not None and mode.get(key) is not None:
                    self._number(f"/okid/mode{mode['track']}/{key}", ns, mode[key])

    def _number(self, topic: str, ns: int, value: float | None) -> None:
        self._message(topic, "Float64", ns, struct.pack("<d", float("nan") if value is None else value))

    def _message(self, topic: str, kind: str, ns: int, body: bytes) -> None:
        if topic not in self._topics:
            field = f"{kind.lower()} data\n".encode()
            schema = self._writer.register_schema(f"std_msgs/msg/{kind}", "ros2msg", field)
            self._topics[topic] = self._writer.register_channel(topic, "cdr", schema)
        data = b"\0\1\0\0" + body  # CDR, little-endian
        self._writer.add_message(self._topics[topic], log_time=ns, publish_time=ns, data=data)


def mcap_file(path: str | Path, out: IO[bytes], start_ns: int, chunk_bytes: int = 1 << 20) -> McapFile:
    """Of the kind that the name asks for."""
    kind = Ros2McapFile if str(path).lower().endswith(".ros2.mcap") else McapFile
    return kind(out, start_ns, chunk_bytes)


def write_mcap(path: str | Path, record: Record) -> None:
    """Write a record as MCAP: one JSON message a sample, numbers with the digits that give the same bits; with a name
    that ends in .ros2.mcap one message of std_msgs/msg/Float64 a sample and channel.

    A record without a start time begins at 1970-01-01. InputError when the rate is not known, a channel is named
    timestamp or sample, mcap is missing or the file cannot be written.
    """
    if record.fs_hz is None:
        raise InputError(f"{path}: MCAP needs a sample rate and the record has none: give fs_hz (okid-convert --fs)")
    about = record.about()
    taken = {"timestamp", "sample"} & set(about["names"])
    if taken:
        raise InputError(
            f"{path}: a channel is named {taken.pop()!r}, as MCAP messages name their time: choose --channels"
        )
    library("mcap.writer", "MCAP")
    with writing(path) as part, part.open("wb") as out:
        file = mcap_file(path, out, 0 if record.start_time is None else nanoseconds(record.start_time))
        file.describe(about)
        file.samples(0, map(np.ndarray.tolist, record.samples))
        file.close()


def nanoseconds(when: datetime) -> int:
    """Since 1970; exact, as a float of seconds is not."""
    since = when - datetime(1970, 1, 1, tzinfo=UTC)
    return (since.days * 86400 + since.seconds) * 1_000_000_000 + since.microseconds * 1000


def _records(stream: Any, kinds: Any, source: IO[bytes], size: int) -> Iterator[Any]:
    """The records of a file of `size` bytes; a chunk is decompressed by count, not by what it states."""
    for one in stream.StreamReader(source, emit_chunks=True, record_size_limit=size).records:
        if not isinstance(one, kinds.Chunk):
            yield one
            continue
        require_memory(one.uncompressed_size, "a chunk")
        if one.compression:
            one.data, one.compression = _chunk_data(one), ""
        yield from stream.breakup_chunk(one)


def _chunk_data(chunk: Any) -> bytes:
    if chunk.compression == "zstd":
        machine = library("zstandard", "MCAP").ZstdDecompressor().stream_reader(chunk.data)
        data = bytes(machine.read(chunk.uncompressed_size + 1))
    elif chunk.compression == "lz4":
        frame = library("lz4.frame", "MCAP").LZ4FrameDecompressor()
        data = bytes(frame.decompress(chunk.data, max_length=chunk.uncompressed_size + 1))
    else:
        raise InputError(f"a chunk is compressed by {str(chunk.compression)[:20]!r}, expected zstd or lz4")
    if len(data) != chunk.uncompressed_size:
        raise InputError(f"a chunk states {chunk.uncompressed_size} bytes and holds another number of them")
    return data


def read_mcap(path: str | Path) -> Record:
    """Read the topic /signals of an MCAP file that okid wrote; samples that are not there are NaN.

    InputError when there is none, mcap is missing or the file is damaged.
    """
    stream, kinds = library("mcap.stream_reader", "MCAP"), library("mcap.records", "MCAP")
    about: dict[str, Any] | None = None
    rows: dict[int, list[float | None]] = {}
    wanted: int | None = None
    with reading(path, "an MCAP file"), open(path, "rb") as source:
        for one in _records(stream, kinds, source, Path(path).stat().st_size):
            if isinstance(one, kinds.Metadata) and one.name == _ABOUT:
                about = parse_json(one.metadata["json"])
            elif isinstance(one, kinds.Channel) and one.topic == SIGNALS:
                wanted = one.id
            elif about is not None and isinstance(one, kinds.Message) and one.channel_id == wanted:
                values = parse_json(one.data.decode("utf-8"))
                rows[int(values["sample"])] = [values[name] for name in about["names"]]
                require_memory(_ROW + len(rows) * (_ROW + _NUMBER * len(about["names"])), f"{len(rows)} messages")
        if about is None or not rows:
            raise InputError(f"has no topic {SIGNALS} with samples as okid writes it")
        require_samples(max(rows) + 1 - min(rows), len(about["names"]))
        samples = np.full((max(rows) + 1 - min(rows), len(about["names"])), np.nan)
        for number, row in rows.items():
            samples[number - min(rows)] = [np.nan if value is None else value for value in row]
        return Record.described(samples, about)


def write_events_mcap(path: str | Path, lines: Iterable[bytes | str]) -> int:
    """Write the events of okid run or replay (`--events FILE`) as MCAP, a topic each. @return how many."""
    library("mcap.writer", "MCAP")
    with writing(path) as part, part.open("wb") as out:
        return _write_lines(path, out, lines, 1 << 20)


def write_live_mcap(path: str | Path, lines: Iterable[bytes | str]) -> int:
    """Write the lines of `[publish] socket` as they come, signals too: the file grows meanwhile, and what was written
    can be read whenever the process ends; its index is written when the lines end. @return how many lines."""
    library("mcap.writer", "MCAP")
    if Path(path).is_symlink():  # replaced, not followed, as whole files are
        Path(path).unlink()
    with open(path, "wb", opener=lambda name, flags: os.open(name, flags | os.O_NOFOLLOW, 0o666)) as out:
        return _write_lines(path, out, lines, 1 << 16)


def _write_lines(path: str | Path, out: IO[bytes], lines: Iterable[bytes | str], chunk_bytes: int) -> int:
    file: McapFile | None = None
    described = False
    count = 0
    for count, line in enumerate(lines, 1):
        event = _event(line, path, count)
        if file is None:
            if event["type"] != "start":
                raise InputError(f"{path}: the first event is {event['type']!r}, expected 'start'")
            start = event
            file = mcap_file(path, out, nanoseconds(datetime.fromisoformat(event["wall_time"])), chunk_bytes)
        if event["type"] != "samples":
            file.event(event)
            continue
        if not described:
            file.describe(_about(start))
            described = True
        file.samples(int(event["first"]), zip(*event["values"], strict=True))
        out.flush()
    if file is None:
        raise InputError(f"{path}: there is no event to write")
    file.close()
    return count


def _about(start: dict[str, Any]) -> dict[str, Any]:
    """The description of the signals that follow a `start` event, as Record.about() gives it."""
    channels = start["channels"]
    names = [one["name"] for one in channels]
    return Record(
        names,
        np.empty((0, len(names))),
        float(start["rate_hz"]),
        [one["unit"] for one in channels],
        title=start.get("notes", {}).get("title", ""),
        start_time=datetime.fromisoformat(start["wall_time"]),
        roles=[one["role"] for one in channels],
        dofs=[one["dof"] or 0 for one in channels],
    ).about()


def _event(line: bytes | str, path: str | Path, number: int) -> dict[str, Any]:
    try:
        event = parse_json(line if isinstance(line, str) else line.decode("utf-8"))
        if isinstance(event, dict) and isinstance(event.get("type"), str):
            return event
    except ValueError:
        pass
    raise InputError(f"{path}: line {number} of the events is no JSON object with a type")
