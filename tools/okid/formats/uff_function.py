# SPDX-License-Identifier: MIT
"""Data sets 58 and 58b of a universal file: functions at a degree of freedom, such as time histories and FRFs."""

from __future__ import annotations

import json
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from okid._errors import InputError
from okid.data.input_file import parse_json
from okid.formats.uff_blocks import CLOSING, Block, opening, short_number, text_line

Real = NDArray[np.float64]
TIME, FRF = 1, 4
ROLE_CODES = {"force": 13, "acceleration": 12, "velocity": 11, "displacement": 8, "aux": 0}
_ROLES = {13: "force", 9: "force", 12: "acceleration", 11: "velocity", 8: "displacement"}
_MARK = "okid "


@dataclass
class UffFunction:
    """A function over an abscissa: kind by the format's table (1 time response, 4 FRF ..), values (N,) real or complex.

    start, step: even abscissa (s or Hz); abscissa (N,) only when it is uneven. response, reference: (node, direction)
    with 1 2 3 = x y z, 4 5 6 rotations, negative = against the axis, 0 = scalar. role: what is measured. known: what
    okid wrote besides.
    """

    name: str
    kind: int
    values: NDArray[Any]
    start: float
    step: float
    abscissa: Real | None = None
    unit: str = ""
    reference_unit: str = ""
    response: tuple[int, int] = (0, 0)
    reference: tuple[int, int] = (0, 0)
    role: str | None = None
    title: str = ""
    date: str = "NONE"
    step_digits: float = 0.0
    binary: bool = True
    known: dict[str, Any] = field(default_factory=dict)

    @property
    def x(self) -> Real:
        """The abscissa (N,), even or not; with the exact step where okid stated it."""
        if self.abscissa is not None:
            return self.abscissa
        stated = self.known.get("df_hz")
        step = 1.0 / self.rate_hz if self.kind == TIME and self.step > 0.0 else self.step
        if isinstance(stated, float) and abs(stated - step) < 1e-5 * step:
            step = stated
        return np.asarray(self.start + step * np.arange(len(self.values)), dtype=np.float64)

    @property
    def rate_hz(self) -> float:
        """Samples per second of an even time history: what okid stated, else the shortest rate that gives its step."""
        stated = self.known.get("fs_hz")
        if isinstance(stated, float) and stated > 0.0 and abs(stated * self.step - 1.0) < 1e-5:
            return stated
        return shortest_rate(self.step, self.step_digits)


def shortest_rate(step_s: float, uncertainty_s: float) -> float:
    """The rate in Hz with the fewest digits whose inverse is the step as it was printed: 1024 for 9.76563E-04."""
    for digits in range(1, 15):
        rate = float(f"{1.0 / step_s:.{digits}g}")
        if abs(1.0 / rate - step_s) <= uncertainty_s:
            return rate
    return 1.0 / step_s


def _half_unit(text: str) -> float:
    """Half a unit of the last digit that the text of a number shows."""
    mantissa, _, exponent = text.upper().replace("D", "E").partition("E")
    decimals = len(mantissa.partition(".")[2])
    return 0.5001 * 10.0 ** (int(exponent or 0) - decimals)


def _labels(block: Block, line: int) -> tuple[int, str, str]:
    kind, *_, axis, unit = block.fields(line, (10, 5, 5, 5, 21, 21))
    clean = ["" if text.upper() in ("NONE", "UNKNOWN") else text for text in (axis, unit)]
    return (int(kind) if kind.lstrip("-").isdigit() else 0), clean[0], clean[1]


def _known(lines: list[str]) -> dict[str, Any]:
    found: dict[str, Any] = {}
    for line in lines[3:5]:
        if line.startswith(_MARK + "{"):
            try:
                found.update(parse_json(line[len(_MARK) :]))
            except ValueError:
                return {}
    return found


def _values(block: Block, kind: int, points: int, even: bool) -> tuple[NDArray[Any], Real | None]:
    """Ordinates, and the abscissa when it is uneven."""
    wide = kind in (4, 6)
    parts = 2 if kind in (5, 6) else 1
    row = parts + (0 if even else 1)
    if block.binary is not None:
        order = ">" if block.head[7:13].strip() == "2" else "<"
        if block.head[13:19].strip() not in ("", "2"):
            raise block.fault("holds binary numbers in DEC VMS or IBM form, expected IEEE 754")
        numbers = np.frombuffer(block.binary, dtype=f"{order}f{8 if wide else 4}").astype(np.float64)
    else:
        ordinate = [20] * parts if wide else [13] * parts
        numbers = block.reals(11, points * row, ordinate if even else [13, *ordinate])
    table = numbers.reshape(points, row)
    abscissa = None if even else table[:, 0].copy()
    ordinates = table[:, row - parts :]
    return (ordinates[:, 0] + 1j * ordinates[:, 1] if parts == 2 else ordinates[:, 0].copy()), abscissa


def read_function(block: Block, number: int) -> UffFunction:
    """The function in a data set 58 or 58b. InputError names the line that is wrong."""
    texts = ["" if line.strip().upper() == "NONE" else line[:80].strip() for line in block.lines[:5]]
    kind, _, _, _, entity, node, way, _, other, other_way = block.fields(5, (5, 10, 5, 10, 11, 10, 4, 11, 10, 4))
    data, points, spacing = block.integers(6, (10, 10, 10))
    if data not in (2, 4, 5, 6) or points < 0:
        raise block.fault(f"ordinate type {data} with {points} points, expected type 2, 4, 5 or 6", 6)
    minimum, increment = (block.fields(6, (10, 10, 10, 13, 13))[k] for k in (3, 4))
    ordinate, axis, unit = _labels(block, 8)
    values, abscissa = _values(block, data, points, spacing == 1)
    step = block.number(increment, 6)
    if spacing == 1 and points > 1 and not (step > 0.0):
        raise block.fault(f"abscissa increment {increment!r}, expected a number above 0", 6)
    known = _known(block.lines)
    whole = [block._whole(text, 5) for text in (kind, node, way, other, other_way)]
    entity = "" if entity.upper() == "NONE" else entity
    at = f"{entity or 'node'} {whole[1]}{_direction_text(whole[2])}" if whole[1] or entity else f"function {number}"
    return UffFunction(
        texts[0] or axis or at, whole[0], values, block.number(minimum, 6), step, abscissa, unit, _labels(block, 9)[2],
        (whole[1], whole[2]), (whole[3], whole[4]), known.get("role", _ROLES.get(ordinate)), texts[1],
        texts[2] or "NONE", _half_unit(increment) if step > 0.0 else 0.0, block.binary is not None, known,
    )  # fmt: skip


def _direction_text(way: int) -> str:
    names = ("", "x", "y", "z", "rx", "ry", "rz")
    return f" {'-' if way < 0 else ''}{names[abs(way)]}".rstrip() if abs(way) < len(names) else ""


def _axis(kind: int, label: str, unit: str) -> str:
    for text, what in ((label, "axis label"), (unit, "unit")):
        if len(text) > 20:
            raise InputError(f"{what} {text!r} has {len(text)} characters, a universal file holds 20")
    return f"{kind:10d}{0:5d}{0:5d}{0:5d} {label or 'NONE':<20s} {unit or 'NONE':<20s}\n"


def _header(one: UffFunction, ordinate: int, reference: int) -> str:
    """Lines 1 to 11."""
    complex_values = np.iscomplexobj(one.values)
    stated = {key: value for key, value in one.known.items() if key != "start_time"}
    later = {key: value for key, value in one.known.items() if key == "start_time"}
    marks = [_MARK + json.dumps(part, separators=(",", ":")) if part else "" for part in (stated, later)]
    abscissa = (17, "Time", "s") if one.kind == TIME else (18, "Frequency", "Hz")
    return "".join(
        [
            text_line(one.name, "name"), text_line(one.title[:80], "title"), text_line(one.date, "date"),
            *(text_line(mark, "ID line") for mark in marks),
            f"{one.kind:5d}{0:10d}{0:5d}{0:10d} {'NONE':10s}{one.response[0]:10d}{one.response[1]:4d}"
            f" {'NONE':10s}{one.reference[0]:10d}{one.reference[1]:4d}\n",
            f"{6 if complex_values else 4:10d}{len(one.values):10d}{1:10d}"
            f"{short_number(one.start)}{short_number(one.step)}{short_number(0.0)}\n",
            _axis(*abscissa), _axis(ordinate, "", one.unit), _axis(reference, "", one.reference_unit), _axis(0, "", ""),
        ]
    )  # fmt: skip


def function_bytes(one: UffFunction, ordinate: int, reference: int = 0, binary: bool = True) -> bytes:
    """A data set 58b (IEEE double, little-endian: exact) or 58 (12 digits) of an even function.

    ordinate, reference: the format's codes of what is measured (12 acceleration, 13 force ..). InputError when name,
    unit or label is too long.
    """
    header = _header(one, ordinate, reference)
    flat = np.ascontiguousarray(one.values, dtype="<c16" if np.iscomplexobj(one.values) else "<f8").view("<f8")
    if binary:
        head = f"{-1:6d}\n{58:6d}b{1:6d}{2:6d}{11:12d}{flat.nbytes:12d}{0:6d}{0:6d}{0:12d}{0:12d}\n"
        return (head + header).encode() + flat.tobytes() + CLOSING.encode()
    numbers = [f"{value:20.11e}" for value in flat.tolist()]
    rows = "".join("".join(numbers[k : k + 4]) + "\n" for k in range(0, len(numbers), 4))
    return (opening(58) + header + rows + CLOSING).encode()
