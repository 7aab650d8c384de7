# SPDX-License-Identifier: MIT
"""Where the sensors sit: nodes, directions, lines and surfaces, as the [geometry] section of a CONFIG.toml has them."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from okid._errors import InputError

AXES = ("x", "y", "z")
FARTHEST = 1e9  # m
Place = tuple[int, str]  # node and direction: "x", "-z" ..


@dataclass(frozen=True)
class Geometry:
    """nodes: coordinates (x, y, z), node k + 1 at index k. dofs: node and direction ("x", "-z" ..) of degree of freedom
    k + 1. lines: pairs of nodes, from 1 on; surfaces: three nodes or more in their order around. fixed: nodes that stay
    at rest, None = not said (see at_rest()). channel_dofs: degree of freedom of each channel by name (negative: with
    reversed polarity), where it is known. named: only names place a channel, as in a file without degrees of freedom.
    source: its file, for messages.
    """

    nodes: list[tuple[float, float, float]]
    dofs: list[tuple[int, str]]
    lines: list[tuple[int, int]] = field(default_factory=list)
    channel_dofs: dict[str, int] = field(default_factory=dict)
    source: str = field(default="the geometry", compare=False)
    surfaces: list[tuple[int, ...]] = field(default_factory=list)
    fixed: list[int] | None = None
    named: bool = False

    def __post_init__(self) -> None:
        far = next((k for k, node in enumerate(self.nodes, 1) if not all(abs(x) <= FARTHEST for x in node)), None)
        if far is not None:
            raise InputError(
                f"{self.source}: node {far} is at {self.nodes[far - 1]}, expected coordinates of at most {FARTHEST:g} m"
            )

    def at_rest(self, places: Sequence[Place | None]) -> list[int]:
        """Nodes that never move: `fixed`; where that is not said the lowest nodes, when no sensor is at any of them
        (`places` of all sensors): what stands on the ground."""
        if self.fixed is not None:
            return self.fixed
        low, high = min(node[2] for node in self.nodes), max(node[2] for node in self.nodes)
        lowest = [k for k, node in enumerate(self.nodes, 1) if node[2] <= low + 1e-9 * (high - low)]
        return [] if {place[0] for place in places if place is not None} & set(lowest) else lowest

    def places(
        self,
        names: Sequence[str],
        numbers: Sequence[int | None] = (),
        noun: str = "sensor",
    ) -> list[Place | None]:
        """Node and direction of each sensor or place, None: not on the geometry.

        The degree of freedom is that of the [[channel]] of this name, else that in `numbers` (negative: reversed).
        Where neither knows any, the names count in their order. InputError names the first that does not fit.
        """
        if self.named:
            known = [self.channel_dofs.get(name) for name in names]
        else:
            own = [None if noun == "place" else self.channel_dofs.get(name) for name in names]
            known = [a if a is not None else b for a, b in zip(own, numbers or [None] * len(names), strict=True)]
        if all(number is None for number in known):
            if self.named:
                raise InputError(
                    f"{self.source}: it places no {noun} {names[0]!r}, nor another {noun} of the result: a universal "
                    'file places channels called by node and direction ("12z"), a CSV file those of its rows "sensor"'
                )
            if self.channel_dofs:
                raise InputError(
                    f"{self.source}: no [[channel]] has the name {names[0]!r}, nor that of another {noun} of the "
                    'result: give each its number by the key "dof"'
                )
            if len(self.dofs) != len(names):
                raise InputError(
                    f"{self.source}: [geometry] dofs has {len(self.dofs)} places and the result {len(names)} outputs: "
                    'give every output its number by the key "dof" of [[channel]]'
                )
            known = list(range(1, len(names) + 1))
        out: list[Place | None] = []
        for name, number in zip(names, known, strict=True):
            if number is not None and not 1 <= abs(number) <= len(self.dofs):
                raise InputError(
                    f"{self.source}: {noun} {name!r} is at dof {number}, but [geometry] dofs has {len(self.dofs)} "
                    "places"
                )
            place = None if number is None else self.dofs[abs(number) - 1]
            if place is not None and number is not None and number < 0:
                place = (place[0], place[1][1:] if place[1].startswith("-") else f"-{place[1]}")
            out.append(place)
        return out


def axis_and_sign(direction: str) -> tuple[int, int]:
    """ "-z" is (2, -1)."""
    return AXES.index(direction[-1]), -1 if direction.startswith("-") else 1


def direction_of(text: object) -> str | None:
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
        direction = direction_of(row[1]) if isinstance(row, list) and len(row) == 2 else None
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
    surfaces: list[tuple[int, ...]] = []
    for k, row in enumerate(_rows(section, "surfaces", source, False), 1):
        known = isinstance(row, list) and all(_is_node(node, count) for node in row)
        if not known or len(row) < 3 or len(set(row)) < len(row):
            raise InputError(
                f"{source}: [geometry] surfaces, entry {k}: found {row!r:.60}, expected three different nodes or more "
                f"from 1 to {count}, as in [1, 2, 3]"
            )
        surfaces.append(tuple(row))
    fixed = _rows(section, "fixed", source, False) if "fixed" in section else None
    wrong = [node for node in fixed or () if not _is_node(node, count)]
    if wrong:
        raise InputError(f"{source}: [geometry] fixed: found {wrong[0]!r:.60}, expected nodes from 1 to {count}")
    channels = config.get("channel")
    numbers = {
        str(one["name"]): one["dof"]
        for one in (channels if isinstance(channels, list) else [])
        if isinstance(one, dict) and "name" in one and isinstance(one.get("dof"), int) and one["dof"] != 0
    }
    return Geometry(nodes, dofs, lines, numbers, source, surfaces, fixed)


def geometry_toml(geometry: Geometry) -> str:
    """[geometry] of a CONFIG.toml that is the same structure; the dof of each channel as remarks."""
    lines = ["[geometry]"]
    for key in ("nodes", "lines", "surfaces", "fixed"):
        rows = getattr(geometry, key)
        if rows:
            lines.append(f"{key} = {json.dumps(rows)}")
    lines.append(f"dofs = {json.dumps(geometry.dofs)}")
    lines += [f"# [[channel]] {json.dumps(name)}: dof = {dof}" for name, dof in geometry.channel_dofs.items()]
    return "\n".join(lines) + "\n"
