# SPDX-License-Identifier: MIT
"""A structure as a table of rows: node, line, surface, sensor, fixed."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from okid._errors import InputError
from okid.data.geometry import Geometry, direction_of
from okid.data.input_file import read_input

_FORMS = {
    "node": "node,NUMBER,x,y,z",
    "line": "line,NODE,NODE",
    "surface": "surface,NODE,NODE,NODE ..",
    "sensor": "sensor,CHANNEL,NODE,DIRECTION",
    "fixed": "fixed,NODE ..",
}


@dataclass
class _Rows:
    """What was read; nodes by the number of the file."""

    nodes: dict[int, tuple[float, float, float]] = field(default_factory=dict)
    lines: list[tuple[int, ...]] = field(default_factory=list)
    surfaces: list[tuple[int, ...]] = field(default_factory=list)
    sensors: dict[str, tuple[int, str]] = field(default_factory=dict)
    fixed: list[int] | None = None
    first_line: dict[int, int] = field(default_factory=dict)  # of each node that is used: where


def _number(text: str) -> float:
    value = float(text)
    if not math.isfinite(value):
        raise ValueError(text)
    return value


# Each takes the cells of a row and returns the nodes that it uses.
def _take_node(rows: _Rows, cells: list[str]) -> Sequence[int]:
    number, x, y, z = cells
    if int(number) in rows.nodes:
        raise InputError(f"node {number} stands twice")
    rows.nodes[int(number)] = (_number(x), _number(y), _number(z))
    return ()


def _take_line(rows: _Rows, cells: list[str]) -> Sequence[int]:
    a, b = cells
    rows.lines.append((int(a), int(b)))
    return rows.lines[-1]


def _take_surface(rows: _Rows, cells: list[str]) -> Sequence[int]:
    nodes = tuple(map(int, filter(None, cells)))
    if len(nodes) < 3 or len(set(nodes)) < len(nodes):
        raise ValueError
    rows.surfaces.append(nodes)
    return nodes


def _take_sensor(rows: _Rows, cells: list[str]) -> Sequence[int]:
    name, node, direction = cells
    kept = direction_of(direction)
    if kept is None or not name:
        raise ValueError
    if name in rows.sensors:
        raise InputError(f"sensor {name!r} stands twice")
    rows.sensors[name] = (int(node), kept)
    return (int(node),)


def _take_fixed(rows: _Rows, cells: list[str]) -> Sequence[int]:
    nodes = [int(one) for one in cells if one]
    rows.fixed = rows.fixed or []
    rows.fixed += nodes
    return nodes


_TAKES: dict[str, Callable[[_Rows, list[str]], Sequence[int]]] = {
    "node": _take_node,
    "line": _take_line,
    "surface": _take_surface,
    "sensor": _take_sensor,
    "fixed": _take_fixed,
}


def _rows_of(path: str | Path, text: str) -> _Rows:
    rows = _Rows()
    for number, line in enumerate(text.splitlines(), 1):
        if not line.strip() or line.lstrip().startswith("#"):
            continue
        mark = next((one for one in (";", "\t") if one in line), ",")
        cells = [cell.strip().strip('"') for cell in line.split(mark)]
        if mark == ";":  # as a table calculation writes decimals
            cells = [re.sub(r"^(-?\d+),(\d)", r"\1.\2", cell) for cell in cells]
        while len(cells) > 1 and not cells[-1]:
            cells.pop()
        kind = cells[0].lower()
        form = _FORMS.get(kind)
        if form is None:
            raise InputError(f"{path}: line {number}: found {line!r:.60}, expected one of {'; '.join(_FORMS.values())}")
        try:
            used = _TAKES[kind](rows, cells[1:])
        except InputError as fault:
            raise InputError(f"{path}: line {number}: {fault}") from None
        except ValueError:
            raise InputError(f"{path}: line {number}: found {line!r:.60}, expected {form}") from None
        for node in used:
            rows.first_line.setdefault(node, number)
    return rows


def read_geometry_csv(path: str | Path) -> Geometry:
    """Nodes (in m, numbered as the file likes), lines, surfaces, sensors by the name of their channel and fixed nodes.

    Cells are parted by comma, semicolon (decimals may then have commas) or tab; # begins a comment. InputError names
    the line that is wrong, a node that is not there, and a file without a node or a sensor.
    """
    rows = _rows_of(path, read_input(path).decode("utf-8-sig", "replace"))
    for kind, found in (("node", rows.nodes), ("sensor", rows.sensors)):
        if not found:
            raise InputError(f"{path}: no row {_FORMS[kind]}, expected one or more")
    order = {number: k for k, number in enumerate(rows.nodes, 1)}
    missing = next((node for node in rows.first_line if node not in order), None)
    if missing is not None:
        raise InputError(f"{path}: line {rows.first_line[missing]}: node {missing} has no row {_FORMS['node']}")
    return Geometry(
        nodes=list(rows.nodes.values()),
        dofs=[(order[node], direction) for node, direction in rows.sensors.values()],
        lines=[(order[a], order[b]) for a, b in rows.lines],
        channel_dofs={name: k for k, name in enumerate(rows.sensors, 1)},
        source=str(path),
        surfaces=[tuple(order[node] for node in one) for one in rows.surfaces],
        fixed=None if rows.fixed is None else [order[node] for node in rows.fixed],
        named=True,
    )
