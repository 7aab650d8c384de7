# SPDX-License-Identifier: MIT
"""The structure that a universal file describes: its nodes, trace lines and elements."""

from __future__ import annotations

import math
from pathlib import Path

from okid._errors import InputError
from okid.data.geometry import AXES, Geometry
from okid.formats.uff import UffFile, read_uff

_LINES = {11, 21, 22, 23, 24, 136, 137}  # rod, beams, springs between two nodes
_SHELLS = {*range(41, 47), *range(51, 57), *range(61, 67), *range(71, 77), *range(81, 87), *range(91, 97)}
_FACES = {  # of solids with corners alone
    111: ((0, 1, 2), (0, 1, 3), (1, 2, 3), (0, 2, 3)),
    112: ((0, 1, 2), (3, 4, 5), (0, 1, 4, 3), (1, 2, 5, 4), (0, 2, 5, 3)),
    115: ((0, 1, 2, 3), (4, 5, 6, 7), (0, 1, 5, 4), (1, 2, 6, 5), (2, 3, 7, 6), (0, 3, 7, 4)),
}
_POINTS = {121, 122, 151, 152, 161}  # at one place: nothing to draw


def _drawn(file: UffFile) -> tuple[list[tuple[int, ...]], list[tuple[int, ...]]]:
    """Lines and surfaces of the elements, by the node numbers of the file. InputError names an unknown kind."""
    lines: list[tuple[int, ...]] = []
    surfaces: list[tuple[int, ...]] = []
    for kind, nodes in file.elements:
        if kind in _LINES:
            lines += zip(nodes, nodes[1:], strict=False)
        elif kind in _SHELLS and len(nodes) >= 3:
            surfaces.append(nodes)
        elif kind in _FACES and len(nodes) == 1 + max(max(face) for face in _FACES[kind]):
            surfaces += [tuple(nodes[k] for k in face) for face in _FACES[kind]]
        elif kind not in _POINTS:
            raise InputError(
                f"data set 2412: an element of kind {kind} with {len(nodes)} nodes is not drawn, expected rods and "
                "beams (11 to 24), shells (41 to 96) or solids with corners alone (111, 112, 115)"
            )
    return lines, surfaces


def uff_geometry(path: str | Path) -> Geometry:
    """Nodes (data set 15 or 2411), lines (82) and elements (2412) of a universal file, nodes by their place in it.

    A channel is placed by its name: node and direction, "12z" or "-3x", as okid names those of universal files.
    InputError when there are no nodes, or when something is joined to a node that is not there.
    """
    file = read_uff(path)
    if not file.nodes:
        raise InputError(f"{path}: no nodes (data set 15 or 2411), expected a universal file with a structure")
    wild = next((number for number, node in file.nodes.items() if not all(map(math.isfinite, node))), None)
    if wild is not None:
        raise InputError(f"{path}: node {wild} is at {file.nodes[wild]}, expected finite coordinates")
    order = {number: k for k, number in enumerate(file.nodes, 1)}
    dofs = [(order[number], axis) for number in file.nodes for axis in AXES]
    names = {f"{number}{axis}": 3 * k + a + 1 for k, number in enumerate(file.nodes) for a, axis in enumerate(AXES)}
    try:
        lines, surfaces = _drawn(file)
    except InputError as fault:
        raise InputError(f"{path}: {fault}") from None
    joined = [*file.lines, *lines]
    missing = next((node for one in (*joined, *surfaces) for node in one if node not in order), None)
    if missing is not None:
        raise InputError(f"{path}: a line or an element is joined to node {missing}, which is not in the file")
    return Geometry(
        nodes=list(file.nodes.values()),
        dofs=dofs,
        lines=[(order[one[0]], order[one[1]]) for one in joined],
        channel_dofs={**names, **{f"-{name}": -dof for name, dof in names.items()}},
        source=str(path),
        surfaces=[tuple(order[node] for node in one) for one in surfaces],
        named=True,
    )
