# SPDX-License-Identifier: MIT
"""docs/numerics.md leaves out no equation of the paper and no trap; each trap has a test that carries its number."""

from __future__ import annotations

import re

from page_runner import ROOT

EQUATIONS, TRAPS = 131, 22
PAGE = (ROOT / "docs" / "numerics.md").read_text()
TABLE = PAGE[PAGE.index("## The paper, equation by equation") : PAGE.index("## The central idea")]
ROWS = [[cell.strip() for cell in line.strip("|").split("|")] for line in TABLE.splitlines() if line.startswith("| ")][
    1:
]


def test_every_equation_stands_in_the_table_in_order() -> None:
    seen: set[int] = set()
    first_before = 0
    for row in ROWS:
        if span := re.fullmatch(r"(\d+)(?:–(\d+))?", row[0]):
            first, last = int(span[1]), int(span[2] or span[1])
            assert first_before <= first <= last, row[0]
            seen |= set(range(first, last + 1))
            first_before = first
    assert seen == set(range(1, EQUATIONS + 1)), sorted(set(range(1, EQUATIONS + 1)) ^ seen)


def test_every_row_is_whole_and_every_trap_is_named() -> None:
    assert all(len(row) == 5 for row in ROWS), [row for row in ROWS if len(row) != 5]
    named = {int(row[4]) for row in ROWS if row[4]}
    assert named == set(range(1, TRAPS + 1))
    assert all(
        row[3] for row in ROWS if row[4] and row[0] not in ("–", "table 1", "54", "116", "68–74", "80–83", "123")
    )


def test_every_trap_has_a_test() -> None:
    files = [*(ROOT / "tests" / "unit" / "lib").glob("test_*.c"), *(ROOT / "tests" / "property").glob("test_*.py")]
    numbers = {int(n) for path in files for n in re.findall(r"trap_0?(\d+)_", path.read_text())}
    assert numbers == set(range(1, TRAPS + 1)), sorted(set(range(1, TRAPS + 1)) ^ numbers)
