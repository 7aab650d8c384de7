# SPDX-License-Identifier: MIT
"""Pages of docs/howto that say so, done as they stand: files written, code compiled, commands run, outputs compared."""

from __future__ import annotations

from pathlib import Path

import pytest
from page_runner import ROOT, Reader

FOLDER = ROOT / "docs" / "howto"
PAGES = {  # how many blocks of commands each has at least
    "wire-a-node.md": 3,
    "write-a-dbc.md": 5,
    "write-a-driver.md": 2,
    "serial-framing.md": 2,
    "several-buses.md": 3,
    "port-to-a-board.md": 2,
    "long-term-monitoring.md": 3,
    "hammer-test.md": 2,
    "compare-two-tests.md": 3,
    "arduino-without-force.md": 2,
    "temperature.md": 0,  # a year of records: with OKID_SLOW=1
}


@pytest.mark.parametrize("name", PAGES)
def test_the_page_from_top_to_bottom(name: str, tmp_path: Path) -> None:
    assert Reader(tmp_path).follow(FOLDER / name) >= PAGES[name]


def test_pages_that_say_they_are_run_are_run() -> None:
    saying = {path.name for path in FOLDER.glob("*.md") if "tests/docs/test_howto.py" in path.read_text()}
    assert saying == set(PAGES)
