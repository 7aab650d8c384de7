# SPDX-License-Identifier: MIT
"""A reader and a writer of journals made from docs/reference/journal-format.md alone, not from our code."""

from __future__ import annotations

import struct
import zlib
from dataclasses import dataclass
from pathlib import Path

MAGIC = b"\x8fOKJ\r\n\x1a\n"
TEXT, FRAMES, END = 1, 2, 3
HEADER = struct.Struct("<8sBBHIQIIqqQII")
assert HEADER.size == 64


@dataclass(frozen=True)
class Frame:
    bus: int
    flags: int
    loss: int
    id: int
    time_ns: int
    hw_time_ns: int
    data: bytes


@dataclass(frozen=True)
class Chunk:
    kind: int
    flags: int
    run: int
    sequence: int
    count: int
    real_ns: int
    monotonic_ns: int
    lost: int
    payload: bytes
    at: int

    def frames(self) -> list[Frame]:
        out, at = [], 0
        while self.kind == FRAMES and at < len(self.payload):
            bus, flags, loss, length, ident, time_ns = struct.unpack_from("<BBBBIq", self.payload, at)
            at += 16
            hw_time_ns = 0
            if flags & 0x80:
                (hw_time_ns,) = struct.unpack_from("<q", self.payload, at)
                at += 8
            size = 0 if flags & 2 else length
            out.append(Frame(bus, flags & 0x3F, loss, ident, time_ns, hw_time_ns, self.payload[at : at + size]))
            at += size
        assert len(out) == self.count
        return out

    def text(self) -> tuple[str, int, bytes]:
        """Name, length of the whole text, this piece."""
        size, total, _ = struct.unpack_from("<IQQ", self.payload)
        return self.payload[20 : 20 + size].decode(), total, self.payload[20 + size :]


def read(path: Path) -> tuple[list[Chunk], int]:
    """Chunks from the beginning on, as long as they are whole, and the bytes behind the last one."""
    data = path.read_bytes()
    out: list[Chunk] = []
    at = 0
    while at + HEADER.size <= len(data):
        magic, version, kind, flags, size, run, sequence, count, real, mono, lost, crc, own = HEADER.unpack_from(
            data, at
        )
        if magic != MAGIC or version != 1 or zlib.crc32(data[at : at + 60]) != own:
            break
        payload = data[at + 64 : at + 64 + size]
        if len(payload) < size or zlib.crc32(payload) != crc:
            break
        out.append(Chunk(kind, flags, run, sequence, count, real, mono, lost, payload, at))
        at += 64 + size
    return out, len(data) - at


def frames(path: Path) -> list[Frame]:
    return [frame for chunk in read(path)[0] for frame in chunk.frames()]


def texts(path: Path) -> dict[str, bytes]:
    out: dict[str, bytes] = {}
    for chunk in read(path)[0]:
        if chunk.kind == TEXT:
            name, _, piece = chunk.text()
            out[name] = out.get(name, b"") + piece
    return out


def seal(
    kind: int, payload: bytes, *, run: int = 1, sequence: int = 0, count: int = 0, size: int | None = None
) -> bytes:
    """A chunk with right sums, whatever it holds."""
    length = len(payload) if size is None else size
    head = HEADER.pack(MAGIC, 1, kind, 0, length, run, sequence, count, 0, 0, 0, zlib.crc32(payload), 0)[:60]
    return head + struct.pack("<I", zlib.crc32(head)) + payload
