# SPDX-License-Identifier: MIT
"""The build backend of the wheel: scikit-build-core, with the sources of okid and the headers of toml++ and CLI11.

In a checkout the sources stand one folder up; in a source distribution, which holds this folder only, in `library/`.
toml++ and CLI11 are no packages of their own on PyPI: they are the copies a source distribution carries, or the
machine's, or those inside the source distributions of pytomlpp and highspy.
"""

from __future__ import annotations

import contextlib
import os
import shutil
import subprocess
import sys
import tarfile
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

from scikit_build_core import build
from scikit_build_core.build import (
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
CARRIED = HERE / "library" / "headers"
PARTS = ("CMakeLists.txt", "LICENSE", "lib", "drivers", "firmware_host")


class Foreign(NamedTuple):
    """Headers that come from elsewhere: folder of them, Debian's package, and where a source distribution has them."""

    folder: str
    package: str
    pinned: str
    inside: str  # folder or header in it
    licence: str


FOREIGN = (
    Foreign(
        "toml++",
        "libtomlplusplus-dev",
        "pytomlpp==1.1.0 --hash=sha256:61a0f73e7ba2fe8bba4e99ce6d2701491885850b53aad8f3e46d03c4b31e594d",
        "third_party/tomlplusplus/include/toml++",
        "third_party/tomlplusplus/LICENSE",
    ),
    Foreign(
        "CLI",
        "libcli11-dev",
        "highspy==1.15.1 --hash=sha256:20ed2fbf1cb64bf3044ee6632364b7e2653d93e6901e2b19fd3d5df10702e8c5",
        "extern/cli11/CLI11.hpp",
        "extern/cli11/CLI11.hpp",  # its head
    ),
)


def _fetch(one: Foreign, folder: Path) -> tuple[Path, Path]:
    """Headers and licence out of a source distribution of the registry."""
    wanted = folder / "wanted.txt"
    wanted.write_text(one.pinned + "\n")
    options = ["--quiet", "--no-deps", "--no-binary=:all:", "--no-build-isolation", "--require-hashes"]
    outside = {name: value for name, value in os.environ.items() if name != "PYTHONPATH"}  # build environments lack pip
    command = [sys.executable, "-m", "pip", "download", *options, "--dest", str(folder), "-r", str(wanted)]
    done = subprocess.run(command, env=outside, capture_output=True, text=True)  # it may fail after the download
    package = one.pinned.split("==")[0]
    for archive in folder.glob(f"{package}-*.tar.gz"):
        with tarfile.open(archive) as opened:
            opened.extractall(folder)
        inside = folder / archive.name.removesuffix(".tar.gz")
        return inside / one.inside, inside / one.licence
    raise SystemExit(
        f"{one.folder}: found no headers in /usr/local/include and /usr/include, and pip fetched no {package}; "
        f"install {one.package}\n{done.stderr}"
    )


def _gather(place: Path) -> None:
    """toml++ and CLI, each with its licence, in a folder of their own: never that of other headers of the system."""
    for one in FOREIGN:
        with tempfile.TemporaryDirectory() as folder:
            for prefix in (Path("/usr/local"), Path("/usr")):
                headers, licence = prefix / "include" / one.folder, prefix / "share/doc" / one.package / "copyright"
                if headers.is_dir():
                    break
            else:
                headers, licence = _fetch(one, Path(folder))
            if headers.is_dir():
                shutil.copytree(headers, place / one.folder)
            else:
                (place / one.folder).mkdir(parents=True)
                shutil.copy2(headers, place / one.folder / f"{one.folder}.hpp")
            if licence.is_file():
                shutil.copy2(licence, place / one.folder / "LICENSE")


@contextlib.contextmanager
def _headers(settings: dict[str, Any] | None) -> Iterator[dict[str, Any]]:
    """The settings of a build, with the folder of the headers."""
    with tempfile.TemporaryDirectory() as folder:
        place = CARRIED if CARRIED.is_dir() else Path(folder)
        if place != CARRIED:
            _gather(place)
        yield {**(settings or {}), "cmake.define.OKID_HEADERS": str(place)}


@contextlib.contextmanager
def _library() -> Iterator[None]:
    """The sources of the libraries in `library/` for as long as an archive is made of this folder."""
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
        _gather(CARRIED)
        yield
    finally:
        shutil.rmtree(place, ignore_errors=True)


def build_sdist(sdist_directory: str, config_settings: dict[str, Any] | None = None) -> str:
    """PEP 517."""
    with _library():
        return str(build.build_sdist(sdist_directory, config_settings))


def build_wheel(directory: str, config_settings: dict[str, Any] | None = None, metadata: str | None = None) -> str:
    """PEP 517."""
    with _headers(config_settings) as settings:
        return str(build.build_wheel(directory, settings, metadata))


def build_editable(directory: str, config_settings: dict[str, Any] | None = None, metadata: str | None = None) -> str:
    """PEP 660."""
    with _headers(config_settings) as settings:
        return str(build.build_editable(directory, settings, metadata))
