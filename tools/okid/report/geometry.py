# SPDX-License-Identifier: MIT
"""The outputs of a result on the geometry of a CONFIG.toml."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from okid._errors import InputError
from okid.data.geometry import AXES, geometry_of
from okid.data.toml_file import read_toml

Real = NDArray[np.float64]


class Geometry(NamedTuple):
    """nodes (x, y, z), lines (node, node) counted from 1, dofs (node, direction) of each output, None = nowhere."""

    nodes: list[tuple[float, float, float]]
    lines: list[tuple[int, int]]
    dofs: list[tuple[int, str] | None]

    def displaced(self, entries: Real, swing: float) -> Real:
        """Nodes (n, 3) moved by the entries (outputs,) of a shape; entry 1 moves by `swing` of the structure's size."""
        at = np.array(self.nodes, dtype=np.float64)
        size = float(np.linalg.norm(np.ptp(at, axis=0))) or 1.0
        for dof, entry in zip(self.dofs, entries.tolist(), strict=True):
            if dof is not None:
                sign = -1.0 if dof[1].startswith("-") else 1.0
                at[dof[0] - 1, AXES.index(dof[1][-1])] += sign * swing * size * entry
        return at


def read_geometry(
    path: str | Path,
    outputs: Sequence[str],
    live: Mapping[str, Mapping[str, Any]] | None = None,
    shape_dofs: Sequence[int] | None = None,
) -> Geometry | None:
    """[geometry] of a CONFIG.toml for these outputs, None when the file has none.

    dofs[k] is the place of degree of freedom k + 1; the `dof` of an output's [[channel]] says which is its own
    (negative: reversed), else that of the channel in the events of a run (`live`, by name). Without such numbers the
    outputs count in their order. `shape_dofs`: of a roving hammer, the numbers themselves. InputError names file and
    key.
    """
    source = str(path)
    given = geometry_of(read_toml(path)[0], source)
    if given is None:
        return None
    dofs, numbers = given.dofs, given.channel_dofs
    if not numbers:
        found = {name: one.get("dof") for name, one in (live or {}).items()}
        numbers = {name: dof for name, dof in found.items() if isinstance(dof, int) and dof != 0}
    known: list[int | None] = list(shape_dofs) if shape_dofs else [numbers.get(name) for name in outputs]
    if all(number is None for number in known):
        if len(dofs) != len(outputs):
            raise InputError(
                f"{source}: [geometry] dofs has {len(dofs)} places and the result {len(outputs)} outputs: give every "
                'output its number by the key "dof" of [[channel]]'
            )
        known = list(range(1, len(outputs) + 1))
    placed: list[tuple[int, str] | None] = []
    for name, number in zip(outputs, known, strict=True):
        if number is not None and abs(number) > len(dofs):
            raise InputError(
                f"{source}: {'place' if shape_dofs else 'channel'} {name!r} is at dof {number}, but [geometry] dofs "
                f"has {len(dofs)} places"
            )
        place = None if number is None else dofs[abs(number) - 1]
        if place is not None and number is not None and number < 0:
            place = (place[0], place[1][1:] if place[1].startswith("-") else f"-{place[1]}")
        placed.append(place)
    return Geometry(given.nodes, given.lines, placed)
