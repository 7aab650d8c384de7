# SPDX-License-Identifier: MIT
"""okid_core.c/.h of tools/amalgamate.py: compile alone without a warning, and sum to the library's states.

Bit for bit: the library sums codes by its kernel in double, okid_core.c in integers. tests/embedded/test_core.py does
the same on three emulated processors.
"""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import core_feed
import pytest

STRICT = ["-pedantic", "-Wall", "-Wextra", "-Werror"]


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    it = tmp_path_factory.mktemp("amalgamated")
    core_feed.generate(it)
    return it


def test_sums_are_those_of_the_library_to_the_last_bit(folder: Path) -> None:
    host = [core_feed.HERE / "board_host.c", "-lm"]
    core_feed.compile(["gcc", "-std=c11", "-Os", *STRICT], folder, folder / "feed", *host)
    shown = subprocess.run([folder / "feed"], capture_output=True, text=True, check=True).stdout
    assert core_feed.read(shown)[0] == core_feed.expected()


def test_core_is_cpp_too_and_both_headers_are(folder: Path) -> None:
    (folder / "both.cpp").write_text('#include "okid_modes.h"\n#include "okid_core.h"\n')
    for strict, source in ((["-Wall", "-Werror"], "okid_core.c"), (STRICT, "both.cpp")):
        subprocess.run(["g++", "-x", "c++", "-fsyntax-only", *strict, source], cwd=folder, check=True)


def test_a_source_missing_in_the_list_is_named(tmp_path: Path) -> None:
    code = "import amalgamate, pathlib, sys; amalgamate.listed(pathlib.Path(sys.argv[1]), 'OKID_CORE_C')"
    (tmp_path / "CMakeLists.txt").write_text("set(OTHER src/okid.c)\n")
    run = subprocess.run([sys.executable, "-c", code, tmp_path / "CMakeLists.txt"], capture_output=True, text=True,
                         env={"PYTHONPATH": str(core_feed.ROOT / "tools")})  # fmt: skip
    assert run.returncode == 1
    assert run.stderr.endswith("CMakeLists.txt: no set(OKID_CORE_C ...), expected the list of sources\n")
