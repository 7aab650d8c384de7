# SPDX-License-Identifier: MIT
"""The pages of docs/recipes done as they stand, and what each promises: few commands, a picture, what can go wrong."""

from __future__ import annotations

import re
import subprocess
from pathlib import Path

import pytest
from page_runner import ROOT, Reader, blocks_of

FOLDER = ROOT / "docs" / "recipes"
PAGES = sorted(FOLDER.glob("*.md"))


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_the_page_from_top_to_bottom(page: Path, tmp_path: Path) -> None:
    assert Reader(tmp_path).follow(page) >= 2


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_one_page_six_commands_a_picture(page: Path) -> None:
    text = page.read_text()
    shell = [block for block in blocks_of(page) if block.kind == "sh"]
    for hardware in (True, False):  # with the reader's own bus or file; with the stand-in, which costs a simulate more
        lines = "".join(block.text for block in shell if ("hardware" in block.notes) == hardware)
        calls = re.findall(r"(?m)^(okid[\w-]* \w*)", lines)
        assert len(calls) <= 6, calls
    assert len(text.splitlines()) <= 120 and "![" in text and "\n## What can go wrong\n" in text


def test_parts_of_configs_stand_in_the_examples() -> None:
    for page in PAGES:
        named = [ROOT / "examples" / "recipes" / name for name in re.findall(r"\b\w+\.toml", page.read_text())]
        whole = next(path for path in named if path.exists()).read_text()
        for part in (block for block in blocks_of(page) if block.kind == "toml" and "file" not in block.notes):
            lines = {line.partition("#")[0].strip() for line in part.text.splitlines()}
            assert lines <= {line.partition("#")[0].strip() for line in whole.splitlines()}, part.place


def test_the_chooser_names_every_recipe() -> None:
    chooser = (ROOT / "docs" / "which-test.md").read_text()
    assert all(f"(recipes/{page.name})" in chooser for page in PAGES) and len(PAGES) == 5


def test_the_sketch_is_a_program(tmp_path: Path) -> None:
    """With the few names of Arduino's library that it uses."""
    stub = """#include <cstdio>
enum { A0, A1, A2, A3 };
unsigned long micros();
int analogRead(int);
struct { void begin(long); template <class T> void print(T, int = 0);
  template <class T> void println(T, int = 0); } Serial;
"""
    sketch = (ROOT / "examples" / "recipes" / "arduino.ino").read_text()
    (tmp_path / "sketch.cpp").write_text(stub + sketch)
    subprocess.run(["c++", "-fsyntax-only", "-Wall", "-Werror", str(tmp_path / "sketch.cpp")], check=True)
    shown = next(block.text for block in blocks_of(FOLDER / "arduino.md") if block.kind == "cpp")
    assert all(line in sketch for line in shown.splitlines() if "…" not in line)
