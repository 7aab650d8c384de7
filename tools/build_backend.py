# SPDX-License-Identifier: MIT
"""The build backend of the wheel: scikit-build-core, but a source distribution takes the C library with it.

In a checkout the library stands one folder up; in a source distribution, which holds this folder only, in `library/`.
"""

from __future__ import annotations

import contextlib
import shutil
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from scikit_build_core import build
from scikit_build_core.build import (
    build_editable,
    build_wheel,
    get_requires_for_build_editable,
    get_requires_for_build_sdist,
    get_requires_for_build_wheel,
    prepare_metadata_for_build_editable,
    prepare_metadata_for_build_wheel,
)

__all__ = [
    "build_editable",
    "build_sdist",
    "build_wheel",
    "get_requires_for_build_editable",
    "get_requires_for_build_sdist",
    "get_requires_for_build_wheel",
    "prepare_metadata_for_build_editable",
    "prepare_metadata_for_build_wheel",
]

HERE = Path(__file__).resolve().parent
PARTS = ("CMakeLists.txt", "LICENSE", "lib")


@contextlib.contextmanager
def _library() -> Iterator[None]:
    """The sources of the library in `library/` for as long as an archive is made of this folder."""
    place, checkout = HERE / "library", HERE.parent
    if not (checkout / "lib" / "CMakeLists.txt").is_file():  # this is an unpacked source distribution: they are there
        yield
        return
    shutil.rmtree(place, ignore_errors=True)
    place.mkdir()
    try:
        for part in PARTS:
            if (checkout / part).is_dir():
                shutil.copytree(checkout / part, place / part)
            else:
                shutil.copy2(checkout / part, place / part)
        yield
    finally:
        shutil.rmtree(place, ignore_errors=True)


def build_sdist(sdist_directory: str, config_settings: dict[str, Any] | None = None) -> str:
    """PEP 517."""
    with _library():
        return str(build.build_sdist(sdist_directory, config_settings))
