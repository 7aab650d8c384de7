# SPDX-License-Identifier: MIT
"""Where the entries of the shapes of an okid.result/1 are, and its forces: numbers of degrees of freedom, or nodes."""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import Any

from okid.data.geometry import Geometry, Place

_NODE = re.compile(r"(-?)(\d+)([xyz])")  # as channels of a universal file are called
_STRUCK = re.compile(r"(.*)@(\d+)")  # as the inputs of a roving hammer are called


def struck_at(name: str) -> tuple[str, int] | None:
    """The force and the place of an input of a roving hammer: "force@3"."""
    found = _STRUCK.fullmatch(name)
    return None if found is None else (found[1], int(found[2]))


def _live_dof(live: Mapping[str, Mapping[str, Any]], name: str) -> int | None:
    dof = live.get(name, {}).get("dof")
    return dof if isinstance(dof, int) and dof != 0 else None


def known_numbers(raw: Mapping[str, Any], key: str, of: str) -> list[int | None]:
    """`input_dofs` or `output_dofs` of the result, one for each of `of`; None = not said."""
    given, count = raw.get(key), len(raw[of])
    if not isinstance(given, list) or len(given) != count:
        return [None] * count
    return [dof if isinstance(dof, int) and dof != 0 else None for dof in given]


def entry_numbers(raw: Mapping[str, Any], live: Mapping[str, Mapping[str, Any]] | None = None) -> list[int | None]:
    """The number of each entry of a shape (negative: reversed), None = not said. `live`: channels of a run."""
    if raw.get("shape_dofs"):
        return list(raw["shape_dofs"])
    own = known_numbers(raw, "output_dofs", "outputs")
    return [_live_dof(live or {}, name) or dof for name, dof in zip(raw["outputs"], own, strict=True)]


def force_numbers(raw: Mapping[str, Any]) -> list[int | None]:
    """The degree of freedom of each input, None = not said."""
    known = known_numbers(raw, "input_dofs", "inputs")
    struck = [struck_at(name) for name in raw["inputs"]] if raw.get("shape_dofs") else [None] * len(known)
    return [one if at is None else at[1] for one, at in zip(known, struck, strict=True)]


def places_of_shapes(
    geometry: Geometry, raw: Mapping[str, Any], live: Mapping[str, Mapping[str, Any]] | None = None
) -> list[Place | None]:
    """Node and direction of each entry of a shape; as Geometry.places()."""
    names = [str(one) for one in raw.get("shape_dofs") or raw["outputs"]]
    noun = "place" if raw.get("shape_dofs") else "sensor"
    return geometry.places(names, entry_numbers(raw, live), noun)


def named_node(name: str) -> Place | None:
    """Node and direction of a channel of a universal file: "12z", "-3x"."""
    found = _NODE.fullmatch(name)
    return None if found is None else (int(found[2]), found[1] + found[3])
