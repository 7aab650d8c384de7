# SPDX-License-Identifier: MIT
"""docs/reference/c-api.md: its program is compiled, linked with build/libokid.a, run, and gives what the page shows;
the tables are those of the headers."""

from __future__ import annotations

import ctypes
import pathlib
import re
import subprocess

from command_help import ROOT
from markdown_pages import blocks
from program import PROGRAM
from reference_tables import REFERENCE, codes, rows, sections

PAGE = REFERENCE / "c-api.md"
INCLUDE = ROOT / "lib" / "include" / "okid"
ARCHIVE = pathlib.Path(PROGRAM).parent / "libokid.a"


def backend_libraries() -> list[str]:
    """What the archive needs beside the C++ run time, by the library beside it."""
    library = ctypes.CDLL(str(ARCHIVE.with_suffix(".so")))
    library.okid_backend.restype = ctypes.c_char_p
    return ["-llapacke", "-lopenblas"] if library.okid_backend() == b"lapacke" else []


def test_the_program(tmp_path: pathlib.Path) -> None:
    found = blocks(PAGE)
    program = next(block.text for block in found if block.language == "c" and "int main" in block.text)
    shown = next(block.text for block in found if block.language == "text")
    (tmp_path / "modes.c").write_text(program)
    strict = ["-std=c99", "-pedantic", "-Wall", "-Wextra", "-Werror", f"-I{INCLUDE.parent}"]
    subprocess.run(["cc", *strict, "-c", "modes.c"], cwd=tmp_path, check=True)
    link = ["c++", "modes.o", str(ARCHIVE), *backend_libraries(), "-lm", "-o", "modes"]
    subprocess.run(link, cwd=tmp_path, check=True)
    done = subprocess.run([tmp_path / "modes"], capture_output=True, text=True, check=True)
    assert done.stdout == shown


def test_status_codes() -> None:
    header = (INCLUDE / "types.h").read_text()
    enum = re.search(r"typedef enum okid_status_t \{(.*?)\}", header, re.DOTALL)
    assert enum
    wanted = [(number, name) for name, number in re.findall(r"(OKID_\w+) = (-?\d+)", enum[1])]
    table = list(rows(sections(PAGE)["Status codes"], "code | name | meaning"))
    assert [(cells[0], codes(cells[1])[0]) for cells in table] == wanted
    assert all(cells[2] for cells in table)


def test_headers() -> None:
    section = sections(PAGE)["Which header for what"]
    heads = ("every day | for", "single steps | for")
    named = {header for head in heads for cells in rows(section, head) for header in codes(cells[0])}
    assert named == {f"okid/{path.relative_to(INCLUDE)}" for path in INCLUDE.rglob("*.h")}


def test_names_are_in_the_headers() -> None:
    """Every function, type and macro of the prose."""
    text = "".join(path.read_text() for path in INCLUDE.rglob("*.h"))
    for name in re.findall(r"`(okid_\w+|OKID_[A-Z_]*[A-Z])(?:\(\))?`", PAGE.read_text()):
        assert name in text, f"{PAGE.name} names {name}, which no header has"
