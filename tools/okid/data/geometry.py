# SPDX-License-Identifier: MIT
"""Where the sensors sit: nodes, directions and lines of the [geometry] section of a CONFIG.toml."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from okid._errors import InputError
from okid.data.toml_file import read_toml

AXES = ("x", "y", "z")


@dataclass(frozen=True)
class Geometry:
    """nodes: coordinates (x, y, z), node k + 1 at index k. dofs: node and direction ("x", "-z" ..) of degree of freedom
    k + 1. lines: pairs of nodes, from 1 on. channel_dofs: degree of freedom of each channel by name (negative: with
    reversed polarity), where it is known.
    """

    nodes: list[tuple[float, float, float]]
    dofs: list[tuple[int, str]]
    lines: list[tuple[int, int]] = field(default_factory=list)
    channel_dofs: dict[str, int] = field(default_factory=dict)

    def place(self, name: str, fallback: int) -> tuple[int, int, int]:
        """Node, axis 0..2 and sign of the channel; `fallback` is its degree of freedom when the config does not say."""
        dof = self.channel_dofs.get(name, fallback)
        if not 1 <= abs(dof) <= len(self.dofs):
            raise InputError(f"[geometry] dofs has {len(self.dofs)} entries, channel {name!r} needs number {abs(dof)}")
        node, direction = self.dofs[abs(dof) - 1]
        sign = -1 if direction.startswith("-") else 1
        return node, AXES.index(direction[-1]), sign if dof > 0 else -sign


def _direction(text: object) -> str | None:
    """As it is kept, without a plus sign; None = no direction."""
    plain = text.removeprefix("+") if isinstance(text, str) else ""
    return plain if plain.removeprefix("-") in AXES else None


def _rows(section: Mapping[str, Any], key: str, source: str, needed: bool) -> list[Any]:
    rows = section.get(key, [])
    if not isinstance(rows, list) or (needed and not rows):
        raise InputError(f"{source}: [geometry] {key} is {rows!r:.60}, expected a list that is not empty")
    return rows


def _is_number(value: object) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)


def _is_node(value: object, count: int) -> bool:
    return isinstance(value, int) and not isinstance(value, bool) and 1 <= value <= count


def geometry_of(config: Mapping[str, Any], source: str) -> Geometry | None:
    """The [geometry] of a parsed CONFIG.toml, None when it has none. InputError names key and entry."""
    section = config.get("geometry")
    if section is None:
        return None
    if not isinstance(section, dict):
        raise InputError(f"{source}: geometry is {section!r:.60}, expected a section [geometry]")
    nodes: list[tuple[float, float, float]] = []
    for k, row in enumerate(_rows(section, "nodes", source, True), 1):
        if not (isinstance(row, list) and len(row) == 3 and all(map(_is_number, row))):
            raise InputError(f"{source}: [geometry] nodes, entry {k}: found {row!r:.60}, expected [x, y, z] in m")
        nodes.append((float(row[0]), float(row[1]), float(row[2])))
    count = len(nodes)
    dofs: list[tuple[int, str]] = []
    for k, row in enumerate(_rows(section, "dofs", source, True), 1):
        direction = _direction(row[1]) if isinstance(row, list) and len(row) == 2 else None
        if direction is None or not _is_node(row[0], count):
            raise InputError(
                f"{source}: [geometry] dofs, entry {k}: found {row!r:.60}, expected a node from 1 to {count} and one "
                'of x y z -x -y -z, as in [1, "z"]'
            )
        dofs.append((row[0], direction))
    lines: list[tuple[int, int]] = []
    for k, row in enumerate(_rows(section, "lines", source, False), 1):
        if not (isinstance(row, list) and len(row) == 2 and all(_is_node(node, count) for node in row)):
            raise InputError(
                f"{source}: [geometry] lines, entry {k}: found {row!r:.60}, expected two nodes from 1 to {count}, as "
                "in [1, 2]"
            )
        lines.append((row[0], row[1]))
    channels = config.get("channel")
    numbers = {
        str(one["name"]): one["dof"]
        for one in (channels if isinstance(channels, list) else [])
        if isinstance(one, dict) and "name" in one and isinstance(one.get("dof"), int) and one["dof"] != 0
    }
    return Geometry(nodes, dofs, lines, numbers)


def read_geometry(path: str | Path) -> Geometry:
    """The [geometry] section and the dof of every [[channel]] of a CONFIG.toml. InputError when there is none."""
    found = geometry_of(read_toml(path)[0], str(path))
    if found is None:
        raise InputError(f"{path}: no [geometry] section, expected one with nodes and dofs")
    return found
