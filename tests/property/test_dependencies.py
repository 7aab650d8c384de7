# SPDX-License-Identifier: MIT
"""docs/reference/dependencies.md names every package of the lists, with version, licence and purpose, and no other."""

from __future__ import annotations

import pathlib
import re
import runpy
from typing import Any

import pytest

ROOT = pathlib.Path(__file__).parents[2]
SBOM: dict[str, Any] = runpy.run_path(str(ROOT / "tools/sbom.py"))
TABLE = (ROOT / "docs/reference/dependencies.md").read_text(encoding="utf-8")
ROWS = {
    cells[0]: cells
    for line in TABLE.splitlines()
    if line.startswith("| ") and not line.startswith("| name |")
    for cells in [[cell.strip().replace("\\|", "|") for cell in re.split(r"(?<!\\)\|", line)[1:-1]]]
}
DEBIAN = {names for names, _, _ in SBOM["debian_lists"]()}
PYTHON = {SBOM["name_of"](requirement) for requirement, _ in SBOM["python_lists"]()}


def test_the_lists_are_read() -> None:
    assert {"cmake", "libeigen3-dev", "iproute2", "chromium|chromium-browser"} <= DEBIAN
    assert {"numpy", "h5py", "control", "pytest", "mypy", "scikit-build-core", "dask"} <= PYTHON


@pytest.mark.parametrize("name", sorted(DEBIAN | PYTHON))
def test_a_package_has_its_row(name: str) -> None:
    assert name in ROWS, f"{name} is new: write the table again with tools/sbom.py"
    assert len(ROWS[name]) == 5 and all(ROWS[name]), ROWS[name]


def test_nothing_else_stands_there() -> None:
    run_time = {name for name, cells in ROWS.items() if cells[4] == "linked"}
    fetched = {"Unity", "libgpiod 2"}
    assert set(ROWS) == DEBIAN | PYTHON | run_time | fetched
    assert {"libc6", "libstdc++6"} <= run_time


def test_what_is_linked_is_no_test_tool() -> None:
    for name in ("libopenblas-dev", "libfmt-dev", "libgpiod-dev"):
        assert ROWS[name][4].startswith("linked ("), ROWS[name]
    assert ROWS["libeigen3-dev"][4] == "headers, compiled in"
    assert ROWS["can-utils"][4] == "`make test`"


def test_no_place_of_the_machine_and_no_address() -> None:
    assert not re.search(r"https?:|/home/|/root|/tmp|/work", TABLE)


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("Format: x\n\nFiles: *\nLicense: MIT\n\nFiles: a/*\nLicense: GPL-2\n", "MIT"),
        ("Format: x\n\nFiles: *\nLicense:\n  Expat\n", "Expat"),
        ("Format: x\n\nFiles: a\nLicense: GPL-2\n\nFiles: b\nLicense: BSD\n", "BSD, GPL-2"),
        ("see /usr/share/common-licenses/LGPL-2.1.\nand /usr/share/common-licenses/GPL-2,\n", "GPL-2, LGPL-2.1"),
    ],
)
def test_licence_of_a_copyright_file(tmp_path: pathlib.Path, text: str, expected: str) -> None:
    (tmp_path / "p").mkdir()
    (tmp_path / "p/copyright").write_text(text)
    assert SBOM["debian_licence"]("p", tmp_path) == expected


def test_a_copyright_file_without_a_licence_is_said(tmp_path: pathlib.Path) -> None:
    (tmp_path / "p").mkdir()
    (tmp_path / "p/copyright").write_text("all rights are somewhere\n")
    with pytest.raises(SBOM["Missing"], match="names no licence"):
        SBOM["debian_licence"]("p", tmp_path)
