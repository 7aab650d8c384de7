# SPDX-License-Identifier: MIT
"""The build backend of the wheel: scikit-build-core, with the sources of the libraries and the headers of toml++.

In a checkout the sources stand one folder up; in a source distribution, which holds this folder only, in `library/`.
The headers of toml++ are no package of their own on PyPI: they are the copy a source distribution carries, or the
machine's, or those inside the source distribution of pytomlpp. Without any the wheel is built and reads no CONFIG.toml.
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
from typing import Any

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
CARRIED = HERE / "library" / "toml"
PARTS = ("CMakeLists.txt", "LICENSE", "lib", "drivers", "firmware_host")
PYTOMLPP = "pytomlpp==1.1.0 --hash=sha256:61a0f73e7ba2fe8bba4e99ce6d2701491885850b53aad8f3e46d03c4b31e594d\n"
PLACES = (  # of headers and licence
    (CARRIED, CARRIED / "LICENSE"),
    (Path("/usr/local/include"), Path("/usr/local/share/doc/tomlplusplus/LICENSE")),
    (Path("/usr/include"), Path("/usr/share/doc/libtomlplusplus-dev/copyright")),
)


def _fetch_toml(folder: Path) -> tuple[Path, Path] | None:
    """Headers and licence out of the source distribution of pytomlpp; None where no registry answers."""
    wanted = folder / "wanted.txt"
    wanted.write_text(PYTOMLPP)
    options = ["--quiet", "--no-deps", "--no-binary=pytomlpp", "--require-hashes", "--dest", str(folder)]
    outside = {name: value for name, value in os.environ.items() if name != "PYTHONPATH"}  # build environments lack pip
    command = [sys.executable, "-m", "pip", "download", *options, "-r", str(wanted)]
    subprocess.run(command, env=outside, capture_output=True)
    for archive in folder.glob("pytomlpp-*.tar.gz"):
        with tarfile.open(archive) as opened:
            opened.extractall(folder)
        inside = folder / archive.name.removesuffix(".tar.gz") / "third_party" / "tomlplusplus"
        return inside / "include", inside / "LICENSE"
    return None


@contextlib.contextmanager
def _toml() -> Iterator[tuple[Path, Path] | None]:
    """The folder that has toml++/toml.h and the file with its licence, or None."""
    for place, licence in PLACES:
        if (place / "toml++" / "toml.h").is_file():
            yield place, licence
            return
    with tempfile.TemporaryDirectory() as folder:
        yield _fetch_toml(Path(folder))


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
        with _toml() as found:
            if found:
                shutil.copytree(found[0] / "toml++", CARRIED / "toml++")
                with contextlib.suppress(FileNotFoundError):
                    shutil.copy2(found[1], CARRIED / "LICENSE")
        yield
    finally:
        shutil.rmtree(place, ignore_errors=True)


def build_sdist(sdist_directory: str, config_settings: dict[str, Any] | None = None) -> str:
    """PEP 517."""
    with _library():
        return str(build.build_sdist(sdist_directory, config_settings))


def _with_toml(settings: dict[str, Any] | None, headers: tuple[Path, Path] | None) -> dict[str, Any]:
    return {**(settings or {}), **({"cmake.define.OKID_TOMLPP": str(headers[0])} if headers else {})}


def build_wheel(directory: str, config_settings: dict[str, Any] | None = None, metadata: str | None = None) -> str:
    """PEP 517."""
    with _toml() as headers:
        return str(build.build_wheel(directory, _with_toml(config_settings, headers), metadata))


def build_editable(directory: str, config_settings: dict[str, Any] | None = None, metadata: str | None = None) -> str:
    """PEP 660."""
    with _toml() as headers:
        return str(build.build_editable(directory, _with_toml(config_settings, headers), metadata))
