# SPDX-License-Identifier: MIT
"""Universal files as a row of data sets between lines of -1: fields by columns, numbers, binary parts.

Layout: the universal file format of SDRC I-DEAS as the University of Cincinnati publishes it (data sets 15, 55, 58,
58b, 82, 151, 164, 2411, 2412). Written here and not with pyuff, because that writes a missing sample as 0, the sample
interval with 6 digits, and reads the file again after each data set; pyuff is the judge in the tests.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from okid._errors import InputError

Real = NDArray[np.float64]
_TAG = re.compile(rb"^ {4}-1[ \t]*\r?$", re.MULTILINE)
_CLOSING = re.compile(rb"[ \t\r\n]*-1[ \t]*(?:\r?\n|\r|$)")
_BYTES = {2: 4, 4: 8, 5: 8, 6: 16}  # of one ordinate: real single, real double, complex single, complex double


@dataclass
class Block:
    """One data set: its number, its lines of text behind the number, the binary part of a 58b, its first line."""

    kind: int
    lines: list[str]
    first_line: int
    binary: bytes | None = None
    head: str = ""
    taken: int = field(default=0)

    def fault(self, text: str, line: int | None = None) -> InputError:
        """An error that names the data set and the line (counted in the block, from 0)."""
        place = f", line {self.first_line + line}" if line is not None else f" at line {self.first_line}"
        return InputError(f"data set {self.kind}{place}: {text}")

    def fields(self, line: int, widths: Sequence[int]) -> list[str]:
        """The fields of a line by their widths, without blanks."""
        if line >= len(self.lines):
            raise self.fault(f"ends after {len(self.lines)} lines, expected more")
        out, at = [], 0
        for width in widths:
            out.append(self.lines[line][at : at + width].strip())
            at += width
        return out

    def integers(self, line: int, widths: Sequence[int]) -> list[int]:
        """Whole numbers by widths; an empty field is 0."""
        return [self._whole(text, line) for text in self.fields(line, widths)]

    def _whole(self, text: str, line: int) -> int:
        try:
            return int(text) if text else 0
        except ValueError:
            raise self.fault(f"found {text!r}, expected a whole number", line) from None

    def number(self, text: str, line: int) -> float:
        """A real number in Fortran's or C's form; an empty field is 0."""
        try:
            return float(text.replace("D", "E").replace("d", "e")) if text else 0.0
        except ValueError:
            raise self.fault(f"found {text!r}, expected a number", line) from None

    def reals(self, first: int, count: int, widths: Sequence[int]) -> Real:
        """`count` numbers from line `first` on: by blanks, or by the widths of the fields when they touch."""
        text = " ".join(self.lines[first:]).replace("D", "E").replace("d", "e")
        try:
            values = np.array(text.split(), dtype=np.float64)
        except ValueError:
            values = np.empty(0)
        if len(values) != count:
            values = self._by_width(first, widths)
        if len(values) != count:
            raise self.fault(f"holds {len(values)} numbers, expected {count}")
        return values

    def _by_width(self, first: int, widths: Sequence[int]) -> Real:
        found = []
        for offset, line in enumerate(self.lines[first:]):
            found += [self.number(text, first + offset) for text in _slices(line, widths)]
        return np.array(found, dtype=np.float64)


def _slices(line: str, widths: Sequence[int]) -> Iterator[str]:
    at = 0
    while line[at:].strip():
        for width in widths:
            text = line[at : at + width].strip()
            if text:
                yield text
            at += width


def _binary_size(block: Block) -> int:
    """Bytes of the data of a 58b, from its header lines (the count in the first line is wrong in many programs)."""
    kind, points, even = block.integers(6, (10, 10, 10))
    if kind not in _BYTES or points < 0:
        raise block.fault(f"ordinate type {kind} with {points} points, expected type 2, 4, 5 or 6", 6)
    abscissa = 0 if even == 1 else (4 if kind in (2, 5) else 8)
    return points * (_BYTES[kind] + abscissa)


def _lines_from(data: bytes, at: int, count: int) -> tuple[list[str], int]:
    lines = []
    for _ in range(count):
        end = data.find(b"\n", at)
        if end < 0:
            break
        lines.append(data[at:end].rstrip(b"\r").decode("utf-8", "replace"))
        at = end + 1
    return lines, at


def _binary_block(data: bytes, at: int, head: str, line: int) -> tuple[Block, int]:
    """A 58b whose header begins at `at`; returns it and the position behind its closing -1."""
    lines, at = _lines_from(data, at, 11)
    block = Block(58, lines, line, b"", head)
    if len(lines) < 11:
        raise block.fault("ends within its header, expected 11 lines: the file is cut off")
    end = at + _binary_size(block)
    if end > len(data):
        raise block.fault(f"has {len(data) - at} bytes of samples, expected {end - at}: the file is cut off")
    closing = _CLOSING.match(data, end)
    if closing is None:
        raise block.fault("no -1 behind its samples: the line ends were changed on the way, or the header is wrong")
    block.binary = data[at:end]
    return block, closing.end()


def read_blocks(path: str | Path) -> Iterator[Block]:
    """All data sets of a file, known or not, in order. InputError when it is none or is cut off."""
    data = Path(path).read_bytes()
    at, line, found = 0, 1, 0
    while (opening := _TAG.search(data, at)) is not None:
        begin = min(opening.end() + 1, len(data))
        (head, *_), body = _lines_from(data, begin, 1) if data.find(b"\n", begin) >= 0 else ([""], len(data))
        line += data.count(b"\n", at, body)
        if not head[:6].strip().isdigit():
            raise InputError(f"line {line - 1}: found {head[:20]!r} behind -1, expected the number of a data set")
        kind = int(head[:6])
        found += 1
        if kind == 58 and head[6:7].lower() == "b":
            block, end = _binary_block(data, body, head, line)
        else:
            closing = _TAG.search(data, body)
            if closing is None:
                raise InputError(f"data set {kind} at line {line - 1} has no closing -1: the file is cut off")
            lines = data[body : closing.start()].decode("utf-8", "replace").splitlines()
            block, end = Block(kind, lines, line, None, head), closing.end()
        line += data.count(b"\n", body, end)
        at = end
        yield block
    if found == 0:
        raise InputError('holds no data set, expected a universal file: lines of "    -1" around numbered data sets')


def opening(kind: int) -> str:
    """The two lines that open a data set."""
    return f"{-1:6d}\n{kind:6d}{'':74s}\n"


CLOSING = f"{-1:6d}\n"


def text_line(text: str, what: str, most: int = 80) -> str:
    """A line of text; "NONE" stands for no text. InputError when it does not fit."""
    if len(text) > most:
        raise InputError(f"{what} {text[:40]!r}.. has {len(text)} characters, a universal file holds {most}")
    return f"{text or 'NONE':<80s}\n"


def short_number(value: float) -> str:
    """A number in 13 columns, with a blank before it and as many digits as go in (7; 6 below 1e-99)."""
    for digits in range(9, 3, -1):
        text = f"{value:.{digits}e}"
        if len(text) <= 12:
            return f"{text:>13s}"
    raise InputError(f"{value!r} does not fit into a universal file")
