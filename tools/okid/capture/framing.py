# SPDX-License-Identifier: MIT
"""Bytes off a serial line to rows of numbers: packets of the project's own stream, or lines of text.

What makes no packet is counted once a first good one was seen: a stream may be joined in its middle.
The rules are those of drivers/src/scan_cobs.c, scan_ascii.c and decoder.c.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator
from dataclasses import dataclass

from okid.capture.cobs_packets import LONGEST_ON_THE_WIRE, decode_packet
from okid.capture.config import BusConfig

_LONGEST_LINE = 2048
_LINES_TO_AGREE = 3
_MARKS = re.compile(r"[,;\t]")
_NUMBER = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?$|[+-]?(nan|inf|infinity)$", re.IGNORECASE)


@dataclass(slots=True)
class Rows:
    """Consecutive samples; `sequence` of the first and `time_us` by the node where it tells them, `broken` when
    something was refused just before. `unread`: bytes that had come behind it."""

    rows: list[list[float]]
    sequence: int | None
    time_us: int | None
    broken: bool
    unread: int


class Framing:
    """Add bytes, get rows. `damaged` packets or lines were refused, `skipped` bytes belonged to nothing."""

    end = b"\0"
    longest = LONGEST_ON_THE_WIRE

    def __init__(self) -> None:
        self.damaged = self.skipped = 0
        self._bytes = bytearray()
        self._synced = self._broken = False

    def add(self, data: bytes) -> Iterator[Rows]:
        """Rows that these bytes complete. At most a packet stays behind."""
        self._bytes += data
        begin = 0
        while begin < len(self._bytes):
            end = self._bytes.find(self.end, begin, begin + self.longest)
            if end < 0:
                if len(self._bytes) - begin < self.longest:
                    break
                self._overlong(self.longest)
                begin += self.longest
                continue
            piece = bytes(self._bytes[begin:end])
            begin = end + 1
            found = self._scan(piece, len(self._bytes) - begin)
            if found is not None:
                found.broken, self._broken, self._synced = self._broken, False, True
                yield found
        del self._bytes[:begin]

    def _overlong(self, count: int) -> None:
        if self._synced:
            self._broken = True
            self.skipped += count

    def _refuse(self) -> None:
        if self._synced:
            self._broken = True
            self.damaged += 1

    def _scan(self, piece: bytes, unread: int) -> Rows | None:
        if not piece:
            return None
        packet = decode_packet(piece)
        if packet is None:
            self._refuse()
            return None
        return Rows(packet.rows.tolist(), packet.sequence, packet.time_us, False, unread)


class Lines(Framing):
    """Lines of text: `1.23,4.56`, `1.23 4.56`, `1.23;4.56`, `ax:1.23 ay:4.56`; `counter_field` counts samples."""

    end = b"\n"
    longest = _LONGEST_LINE

    def __init__(self, counter_field: int | None) -> None:
        super().__init__()
        self._counter_field = counter_field
        self._in_line = True  # the line at hand began before we did
        self._width = self._other = 0

    def _overlong(self, count: int) -> None:
        super()._overlong(count)
        self._in_line = True

    def _scan(self, piece: bytes, unread: int) -> Rows | None:
        torn, self._in_line = self._in_line, False
        text = piece.rstrip(b"\r ")
        if not text:
            return None
        values = parse_line(text)
        if torn or values is None or not self._fits(values):
            self._refuse()
            return None
        sequence = None if self._counter_field is None else int(values[self._counter_field])
        return Rows([values], sequence, None, False, unread)

    def _fits(self, values: list[float]) -> bool:
        """A line must have as many numbers as the ones before: a torn one passes for a line otherwise."""
        if len(values) != self._width:
            self._other += 1
            if self._other < _LINES_TO_AGREE and self._width:
                return False
            self._width = len(values)
        self._other = 0
        if self._counter_field is None:
            return True
        if self._counter_field >= len(values):
            return False
        count = values[self._counter_field]
        return 0 <= count <= 0xFFFFFFFF and count == math.floor(count)


def parse_line(line: bytes) -> list[float] | None:
    """One number a place, NaN where it is empty; None when a place is neither, or none is a number."""
    if any(byte != 9 and not 32 <= byte <= 126 for byte in line):
        return None
    out: list[float] = []
    places = _MARKS.split(line.decode("ascii"))
    for number, place in enumerate(places, 1):
        words = place.split()
        if not words and number < len(places):
            out.append(math.nan)
        label = False
        for word in words:
            text = word[max(word.rfind(":"), word.rfind("=")) + 1 :]
            label = not text
            if label:
                continue  # its number is the next word
            if len(text) > 40 or not _NUMBER.match(text):
                return None
            value = float(text)
            out.append(value if math.isfinite(value) else math.nan)
        if label:
            return None
    return out if len(out) <= 252 and any(not math.isnan(value) for value in out) else None


def framing_of(bus: BusConfig) -> Framing:
    """What reads the framing of a serial [[bus]]."""
    return Lines(bus.counter_field) if bus.framing == "ascii" else Framing()
