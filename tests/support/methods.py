# SPDX-License-Identifier: MIT
"""The methods of identification, and the horizons with which docs/numerics.md states their errors."""

from __future__ import annotations

from typing import Any

METHODS = ("okid-era", "okid-era-dc", "n4sid-moesp", "n4sid-cva", "n4sid-ssarx")
N4SID = METHODS[2:]
HORIZON = {"w1": (40, 80, 40), "w2": (40, 80, 30), "w3": (40, 60, 25)}  # p, rows of okid, rows of n4sid


def by_method(config: str, method: str = "okid-era", p: int | None = 40, rows: int | None = None) -> str:
    """A config of `okid simulate`, which has the default method, with a named one, which is quick."""
    keys = f'method = "{method}"\n' + (f"p = {p}\n" if p else "") + (f"rows = {rows}\n" if rows else "")
    assert "[identification]\n" in config and "method" not in config
    return config.replace("[identification]\n", "[identification]\n" + keys)


def horizon(name: str, method: str) -> dict[str, Any]:
    """p and rows of a structure of systems.py."""
    p, rows, i = HORIZON[name]
    return {"rows": i} if method in N4SID else {"p": p, "rows": rows}
