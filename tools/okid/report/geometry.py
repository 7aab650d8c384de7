# SPDX-License-Identifier: MIT
"""The shapes of a result on the geometry of a CONFIG.toml."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from okid.data.geometry import axis_and_sign, geometry_of
from okid.data.toml_file import read_toml
from okid.result.shape_places import places_of_shapes

Real = NDArray[np.float64]
Complex = NDArray[np.complex128]


class Geometry(NamedTuple):
    """nodes (x, y, z), lines (node, node) counted from 1, dofs (node, direction) of each output, None = nowhere."""

    nodes: list[tuple[float, float, float]]
    lines: list[tuple[int, int]]
    dofs: list[tuple[int, str] | None]

    def unknown(self, entries: Complex) -> set[int]:
        """Nodes, from 1, at which a shape has entries but no value: it was not measured there."""
        known: dict[int, bool] = {}
        for dof, there in zip(self.dofs, np.isfinite(entries).tolist(), strict=True):
            if dof is not None:
                known[dof[0]] = known.get(dof[0], False) or there
        return {node for node, there in known.items() if not there}

    def displaced(self, entries: Real, swing: float) -> Real:
        """Nodes (n, 3) moved by the entries (places,) of a shape; entry 1 moves by `swing` of the structure's size, one
        that was not measured (NaN) not at all."""
        at = np.array(self.nodes, dtype=np.float64)
        size = float(np.linalg.norm(np.ptp(at, axis=0))) or 1.0
        for dof, entry in zip(self.dofs, entries.tolist(), strict=True):
            if dof is not None and np.isfinite(entry):
                axis, sign = axis_and_sign(dof[1])
                at[dof[0] - 1, axis] += sign * swing * size * entry
        return at


def read_geometry(
    path: str | Path, raw: Mapping[str, Any], live: Mapping[str, Mapping[str, Any]] | None = None
) -> Geometry | None:
    """[geometry] of a CONFIG.toml for the shapes of an okid.result/1, None when the file has none.

    dofs[k] is the place of degree of freedom k + 1. Which one an output is at says the `dof` of its [[channel]], else
    that of the channel in the events of a run (`live`, by name), else `output_dofs` of the result; without such numbers
    the outputs count in their order. Of a roving hammer the places are the numbers. InputError names file and key.
    """
    given = geometry_of(read_toml(path)[0], str(path))
    if given is None:
        return None
    return Geometry(given.nodes, given.lines, places_of_shapes(given, raw, live))
