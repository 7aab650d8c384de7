# SPDX-License-Identifier: MIT
"""How a structure moves when only some of its nodes carry sensors.

The rule, for each of the three axes by itself: a node with a sensor along the axis moves as measured, a fixed node
stays at rest, and every other node moves as the mean of those that lines and edges of surfaces join it to, a near one
counting more (weight 1 / length, PLATE times that along the edge of a surface: plates are stiff). A node that nothing
joins to a sensor of that axis stays at rest.
tools/okid/web/structure.js does the same for the moving pictures.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from scipy.sparse.linalg import spsolve

from okid.data.geometry import Geometry, Place, axis_and_sign

Real = NDArray[np.float64]
Complex = NDArray[np.complex128]


PLATE = 10.0


def _ordered(a: int, b: int) -> tuple[int, int]:
    return min(a, b) - 1, max(a, b) - 1


def _surface_edges(geometry: Geometry) -> set[tuple[int, int]]:
    return {_ordered(a, b) for one in geometry.surfaces for a, b in zip(one, (*one[1:], one[0]), strict=True)}


def edges_of(geometry: Geometry) -> list[tuple[int, int]]:
    """Pairs of nodes (from 0, the smaller first) that a line or the edge of a surface joins, each once."""
    return sorted(_surface_edges(geometry) | {_ordered(a, b) for a, b in geometry.lines if a != b})


@dataclass
class StructureMotion:
    """A geometry, and the place of each entry of a shape on it (None = nowhere)."""

    geometry: Geometry
    places: Sequence[Place | None]
    _laplacian: sparse.csr_matrix = field(init=False, repr=False)
    _part: NDArray[np.int32] = field(init=False, repr=False)  # of each node: which nodes are joined to it

    def __post_init__(self) -> None:
        nodes = np.array(self.geometry.nodes, dtype=np.float64)
        edges, plates = edges_of(self.geometry), _surface_edges(self.geometry)
        count, pairs = len(nodes), np.array(edges, dtype=np.intp).reshape(-1, 2)
        length = np.linalg.norm(nodes[pairs[:, 0]] - nodes[pairs[:, 1]], axis=1)
        weight = np.where([one in plates for one in edges], PLATE, 1.0) / np.maximum(length, 1e-6 * self.size)
        joined = sparse.coo_matrix((weight, (pairs[:, 0], pairs[:, 1])), shape=(count, count))
        joined = (joined + joined.T).tocsr()
        _, self._part = sparse.csgraph.connected_components(joined, directed=False)
        self._laplacian = (sparse.diags(np.asarray(joined.sum(axis=1)).ravel()) - joined).tocsr()

    @property
    def at_rest(self) -> list[int]:
        """Nodes, from 1, that never move."""
        return self.geometry.at_rest(self.places)

    @property
    def size(self) -> float:
        """Diagonal of the box around all nodes in m; 1 for a single place."""
        return float(np.linalg.norm(np.ptp(np.array(self.geometry.nodes, dtype=np.float64), axis=0))) or 1.0

    def measured(self, entries: Complex) -> NDArray[np.bool_]:
        """(nodes,): does the node carry a sensor that this shape (places,) has a value of?"""
        out = np.zeros(len(self.geometry.nodes), dtype=np.bool_)
        for place, entry in zip(self.places, entries, strict=True):
            if place is not None and np.isfinite(entry):
                out[place[0] - 1] = True
        return out

    def moved(self, entries: Complex) -> Complex:
        """Displacement (nodes, 3) of every node for the entries (places,) of a shape, in the unit of the shape; NaN:
        not measured. Two sensors on one node and axis count with their mean. Cost: one sparse solution an axis."""
        count = len(self.geometry.nodes)
        total, times = np.zeros((count, 3), dtype=np.complex128), np.zeros((count, 3))
        for place, entry in zip(self.places, entries, strict=True):
            if place is not None and np.isfinite(entry):
                axis, sign = axis_and_sign(place[1])
                total[place[0] - 1, axis] += sign * entry
                times[place[0] - 1, axis] += 1.0
        still = np.zeros(count, dtype=np.bool_)
        still[[node - 1 for node in self.at_rest]] = True
        out = np.where(times > 0.0, total / np.maximum(times, 1.0), 0.0)
        for axis in range(3):
            self._extend(out[:, axis], times[:, axis] > 0.0, still)
        return out

    def _extend(self, values: Complex, known: NDArray[np.bool_], still: NDArray[np.bool_]) -> None:
        """Give the nodes of one axis that are neither known nor still the mean of their neighbours, in place."""
        held = known | still
        free = ~held & np.isin(self._part, self._part[known])
        if not np.any(free):
            return
        lines = self._laplacian[free]
        right = -(lines[:, held] @ values[held])
        matrix = lines[:, free].tocsc()
        both = np.column_stack([right.real, right.imag])
        found = np.asarray(spsolve(matrix, both)).reshape(-1, 2)
        values[free] = found[:, 0] + 1j * found[:, 1]
