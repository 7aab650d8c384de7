# SPDX-License-Identifier: MIT
"""The shapes of a result on a structure: of a CONFIG.toml, a table or a universal file."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from okid.data import geometry
from okid.data.structure_motion import StructureMotion
from okid.data.toml_file import read_toml
from okid.formats import geometry_file
from okid.result.shape_places import places_of_shapes

TABLES = (".csv", ".uff", ".unv")


def read_geometry(
    path: str | Path, raw: Mapping[str, Any], live: Mapping[str, Mapping[str, Any]] | None = None
) -> StructureMotion | None:
    """The structure of a file for the shapes of an okid.result/1, None when a CONFIG.toml has no [geometry].

    dofs[k] of [geometry] is the place of degree of freedom k + 1. Which one an output is at says the `dof` of its
    [[channel]], else that of the channel in the events of a run (`live`, by name), else `output_dofs` of the result;
    without such numbers the outputs count in their order. Of a roving hammer the places are the numbers. A table (.csv)
    and a universal file (.uff, .unv) place by name. InputError names file and key.
    """
    table = Path(path).suffix.lower() in TABLES
    given = geometry_file.read_geometry(path) if table else geometry.geometry_of(read_toml(path)[0], str(path))
    return None if given is None else StructureMotion(given, places_of_shapes(given, raw, live))
