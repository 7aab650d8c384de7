# SPDX-License-Identifier: MIT
"""Structures by the extension of the file name."""

from __future__ import annotations

from pathlib import Path

from okid._errors import InputError
from okid.data.geometry import Geometry, geometry_of
from okid.data.geometry_csv import read_geometry_csv
from okid.data.toml_file import read_toml
from okid.formats.uff_geometry import uff_geometry


def read_geometry(path: str | Path) -> Geometry:
    """The structure of a file: [geometry] and the dof of every [[channel]] of a CONFIG.toml, a .csv of rows node, line,
    surface, sensor, fixed, or the data sets 15, 2411, 82 and 2412 of a .uff or .unv. InputError when it has none."""
    kind = Path(path).suffix.lower()
    if kind == ".csv":
        return read_geometry_csv(path)
    if kind in (".uff", ".unv"):
        return uff_geometry(path)
    found = geometry_of(read_toml(path)[0], str(path))
    if found is None:
        raise InputError(f"{path}: no [geometry] section, expected one with nodes and dofs")
    return found
