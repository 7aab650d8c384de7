# SPDX-License-Identifier: MIT
"""Where a shared object of okid is: the one place both libraries are looked for."""

from __future__ import annotations

import ctypes
import os
from pathlib import Path
from typing import Any


def candidates(file: str, variable: str) -> list[Path]:
    """Where `file` may be, in the order of trust: what the environment `variable` says, the package, the build."""
    given = os.environ.get(variable)
    if given:
        return [Path(given)]
    package = Path(__file__).resolve().parents[1]
    return [package / file, package.parents[1] / "build" / file]


def load(file: str, variable: str) -> tuple[Any, Path]:
    """The loaded object and its path. OSError names every place that was tried."""
    tried = candidates(file, variable)
    for path in tried:
        if path.is_file():
            return ctypes.CDLL(str(path)), path
    places = ", ".join(map(str, tried))
    raise OSError(f"{file} not found in {places}: run `make build`, or set {variable} to the file")
