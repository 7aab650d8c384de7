# SPDX-License-Identifier: MIT
"""tests/long names tests that exist: one of another name would run in the quick tier again, unseen."""

from __future__ import annotations

import ast
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
LINES = [
    line for line in (ROOT / "tests" / "long").read_text(encoding="utf-8").splitlines() if not line.startswith("#")
]


def test_every_line_is_a_test() -> None:
    assert sorted(set(LINES)) == LINES and len(LINES) > 100
    for line in LINES:
        name, _, function = line.partition("::")
        tree = ast.parse((ROOT / name).read_text(encoding="utf-8"))
        assert not function or function in [
            one.name for one in ast.walk(tree) if isinstance(one, ast.FunctionDef)
        ], line
