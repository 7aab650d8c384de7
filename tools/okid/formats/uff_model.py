# SPDX-License-Identifier: MIT
"""Data sets of a universal file that describe the structure: nodes, lines, mode shapes, header, units."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from datetime import datetime

import numpy as np
from numpy.typing import NDArray

from okid.data.geometry import Geometry
from okid.formats.uff_blocks import CLOSING, Block, opening, short_number, text_line

Real = NDArray[np.float64]
_BEAMS = {11, 21, 22, 23, 24}  # elements with a line of their own orientation
_UNITS_SI = {8: "m", 11: "m/s", 12: "m/s^2", 13: "N", 9: "N"}
_UNITS_MM = {8: "mm", 11: "mm/s", 12: "mm/s^2", 13: "mN", 9: "mN"}


@dataclass
class UffMode:
    """A mode of a data set 55: frequency in Hz, damping ratio, shape (nodes, 3 or 6) complex at nodes (nodes,)."""

    number: int
    frequency_hz: float
    damping_ratio: float
    nodes: list[int]
    shape: NDArray[np.complex128]
    title: str = ""
    modal_mass: float = 0.0  # kg of this shape; 0: not known
    judgement: str = ""  # of okid: "confident ..." or "doubtful: why", on the third ID line

    @property
    def confident(self) -> bool | None:
        """As okid judged it; None: the file does not say."""
        word = self.judgement.partition(" ")[0].rstrip(":")
        return {"confident": True, "doubtful": False}.get(word)


def read_mode(block: Block) -> UffMode | None:
    """The mode in a data set 55: normal modes, complex eigenvalues; None for any other analysis."""
    _, analysis, _, _, data, width = block.integers(5, (10,) * 6)
    if analysis not in (2, 3, 7):
        return None
    if data not in (2, 5) or width < 1:
        raise block.fault(f"data type {data} with {width} values a node, expected type 2 or 5", 5)
    number = block.integers(6, (10,) * 4)[3]
    values = [block.number(text, 7) for text in block.fields(7, (13,) * 4)]
    if analysis == 2:
        frequency, mass, damping = values[:3]
    else:
        size, mass = float(np.hypot(values[0], values[1])), 0.0
        frequency, damping = size / (2.0 * np.pi), -values[0] / size if size > 0.0 else 0.0
    nodes, shape = _shape(block, width, data == 5)
    title = block.lines[0][:80].strip()
    remark = block.lines[2][:80].strip()
    judged = remark if remark.startswith(("confident", "doubtful")) else ""
    return UffMode(number, frequency, damping, nodes, shape, "" if title.upper() == "NONE" else title, mass, judged)


def _shape(block: Block, width: int, complex_values: bool) -> tuple[list[int], NDArray[np.complex128]]:
    """Nodes and rows of values: each node takes a line of its number and lines of six numbers."""
    count = width * (2 if complex_values else 1)
    lines = -(-count // 6)
    nodes: list[int] = []
    rows = []
    for first in range(8, len(block.lines), 1 + lines):
        if not block.lines[first].strip():
            break
        nodes.append(block.integers(first, (10,))[0])
        row: list[float] = []
        for line in range(first + 1, first + 1 + lines):
            row += [block.number(text, line) for text in block.fields(line, (13,) * min(6, count - len(row)))]
        rows.append(row)
    table = np.array(rows, dtype=np.float64).reshape(len(nodes), count)
    shape = table[:, 0::2] + 1j * table[:, 1::2] if complex_values else table.astype(np.complex128)
    return nodes, shape


def read_nodes(block: Block) -> dict[int, tuple[float, float, float]]:
    """Nodes by number of a data set 15 (one line each) or 2411 (two lines each)."""
    found = {}
    if block.kind == 15:
        for line in range(len(block.lines)):
            if block.lines[line].strip():
                number, _, _, _, x, y, z = block.fields(line, (10, 10, 10, 10, 13, 13, 13))
                found[block._whole(number, line)] = _triple(block, line, (x, y, z))
        return found
    for line in range(0, len(block.lines) - 1, 2):
        found[block.integers(line, (10,))[0]] = _triple(block, line + 1, block.fields(line + 1, (25, 25, 25)))
    return found


def _triple(block: Block, line: int, texts: Sequence[str]) -> tuple[float, float, float]:
    x, y, z = (block.number(text, line) for text in texts)
    return x, y, z


def read_lines(block: Block) -> list[tuple[int, int]]:
    """Pairs of nodes that the trace line of a data set 82 joins; 0 lifts the pen."""
    nodes = [block._whole(text, line) for line in range(2, len(block.lines)) for text in block.lines[line].split()]
    return [(a, b) for a, b in zip(nodes, nodes[1:], strict=False) if a and b]


def read_elements(block: Block) -> list[tuple[int, tuple[int, ...]]]:
    """Kind and nodes of each element of a data set 2412: two lines each and one more for beams, eight nodes a line."""
    out, line = [], 0
    while line < len(block.lines):
        if not block.lines[line].strip():
            line += 1
            continue
        _, kind, _, _, _, count = block.integers(line, (10,) * 6)
        if count < 1:
            raise block.fault(f"an element of {count} nodes, expected 1 or more", line)
        line += 2 if kind in _BEAMS else 1
        nodes: list[int] = []
        while len(nodes) < count:
            nodes += block.integers(line, (10,) * min(8, count - len(nodes)))
            line += 1
        out.append((kind, tuple(nodes)))
    return out


def read_header(block: Block) -> dict[str, str]:
    """model, description and program of a data set 151."""
    texts = [(line[:80].strip()) for line in block.lines[:6]] + [""] * 6
    return {"model": texts[0], "description": texts[1], "program": texts[5]}


def read_units(block: Block) -> dict[int, str]:
    """Units of the format's data types by the unit code of a data set 164: SI and mm; nothing for other systems."""
    code = block.integers(0, (10,))[0]
    return dict(_UNITS_SI) if code == 1 else dict(_UNITS_MM) if code == 5 else {}


def header_text(title: str, version: str, when: datetime) -> str:
    """Data set 151."""
    stamp = f"{when:%d-%b-%y} "[:10] + f"{when:%H:%M:%S}  "
    return (
        opening(151) + text_line(title[:80], "title") + text_line("", "description") + text_line("okid", "program")
        + f"{stamp}{0:10d}{0:10d}{0:10d}\n{stamp}\n" + text_line(f"okid {version}", "program") + f"{stamp}\n" + CLOSING
    )  # fmt: skip


def units_text() -> str:
    """Data set 164: SI, newton and metre, temperature in °C with its offset to K."""
    numbers = [f"{value:25.16e}".replace("e", "D") for value in (1.0, 1.0, 1.0, 273.15)]
    return opening(164) + f"{1:10d}{'SI: Meter (newton)':20s}{2:10d}\n{''.join(numbers[:3])}\n{numbers[3]}\n" + CLOSING


def nodes_text(nodes: Sequence[tuple[float, float, float]]) -> str:
    """Data set 15, nodes numbered from 1 on."""
    rows = [
        f"{k:10d}{0:10d}{0:10d}{8:10d}" + "".join(short_number(value) for value in node) + "\n"
        for k, node in enumerate(nodes, 1)
    ]
    return opening(15) + "".join(rows) + CLOSING


def lines_text(lines: Sequence[tuple[int, int]]) -> str:
    """Data sets 82: pairs of nodes with the pen lifted between, at most 80 pairs (239 entries) each."""
    out = []
    for number, first in enumerate(range(0, len(lines), 80), 1):
        path: list[int] = []
        for a, b in lines[first : first + 80]:
            path += ([] if not path else [0]) + [a, b]
        rows = "".join("".join(f"{n:10d}" for n in path[k : k + 8]) + "\n" for k in range(0, len(path), 8))
        out.append(opening(82) + f"{number:10d}{len(path):10d}{8:10d}\n" + text_line("lines", "name") + rows + CLOSING)
    return "".join(out)


def surfaces_text(surfaces: Sequence[Sequence[int]]) -> str:
    """A data set 2412 of linear shells; a surface of more than four nodes is parted into triangles. None: no text."""
    flat: list[Sequence[int]] = []
    for one in surfaces:
        flat += [one] if len(one) <= 4 else [(one[0], a, b) for a, b in zip(one[1:], one[2:], strict=False)]
    rows = [
        f"{k:10d}{91 if len(one) == 3 else 94:10d}{1:10d}{1:10d}{8:10d}{len(one):10d}\n"
        + "".join(f"{node:10d}" for node in one)
        + "\n"
        for k, one in enumerate(flat, 1)
    ]
    return opening(2412) + "".join(rows) + CLOSING if rows else ""


def structure_text(geometry: Geometry) -> str:
    """Data sets 15, 82 and 2412."""
    return nodes_text(geometry.nodes) + lines_text(geometry.lines) + surfaces_text(geometry.surfaces)


def mode_text(mode: UffMode, kind: int, remark: str) -> str:
    """Data set 55, normal mode with complex values; kind: code of what the shape is (8 displacement, 12 ..)."""
    head = opening(55) + text_line(mode.title[:80], "title") + text_line(remark[:80], "remark")
    head += text_line(mode.judgement[:80], "ID line") + "".join(text_line("", "ID line") for _ in range(2))
    head += "".join(f"{n:10d}" for n in (1, 2, 2, kind, 5, 3)) + "\n"
    head += "".join(f"{n:10d}" for n in (2, 4, 1, mode.number)) + "\n"
    head += (
        "".join(short_number(value) for value in (mode.frequency_hz, mode.modal_mass, mode.damping_ratio, 0.0)) + "\n"
    )
    rows = []
    for node, row in zip(mode.nodes, mode.shape, strict=True):
        numbers = "".join(short_number(part) for value in row for part in (value.real, value.imag))
        rows.append(f"{node:10d}\n{numbers}\n")
    return head + "".join(rows) + CLOSING
