# SPDX-License-Identifier: MIT
"""docs/testing.md says which test proves which promise of README and DESIGN: both are there as it says."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
PAGES = {"README": ROOT / "README.md", "DESIGN": ROOT / "docs" / "DESIGN.md"}
SECTION = (ROOT / "docs" / "testing.md").read_text().split("## Claims and their tests\n")[1].split("\n## ")[0]
CLAIMS = re.findall(r'^\| "(.*)" \| (\w+) \| (.*) \|$', SECTION, re.M)
TESTS = {(file, name) for *_, tests in CLAIMS for part in tests.split(";")
         for file, *names in [re.findall(r"`([^`]+)`", part)] for name in names}  # fmt: skip


def plain(text: str) -> str:
    return re.sub(r"\s+", " ", text.replace("*", ""))


def test_every_line_of_the_table_is_read() -> None:
    assert len(CLAIMS) == SECTION.count("\n| ") - 1 >= 20
    assert len(TESTS) >= len(CLAIMS)


@pytest.mark.parametrize(("words", "page", "tests"), CLAIMS)
def test_the_page_still_says_so(words: str, page: str, tests: str) -> None:
    assert plain(words) in plain(PAGES[page].read_text()), f"{page} no longer says so; {tests} proved it"


@pytest.mark.parametrize(("file", "name"), sorted(TESTS))
def test_the_named_test_is_there_and_runs(file: str, name: str) -> None:
    (path,) = (ROOT / "tests").rglob(file)
    text = path.read_text()
    if path.suffix == ".py":
        assert re.search(rf"^def {name}\(", text, re.M)
    else:
        assert re.search(rf"^(static )?void {name}\((void)?\) {{", text, re.M)
        assert f"RUN_TEST({name});" in text
