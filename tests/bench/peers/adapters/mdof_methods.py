# SPDX-License-Identifier: MIT
"""mdof: mdof.sysid(inputs, outputs, method="srim" | "okid-era" | "okid-era-dc"): A, B, C, D.

Settings: true order; srim horizon = s; okid-era m = 2 s + 2 (observer order and number of Markov parameters), horizon
= nc = s; the same and m = 2 s + 4 for okid-era-dc. threads = 1.
"""

from __future__ import annotations

from typing import Any

import mdof
from adapters.shapes import columns


def _mdof(method: str, more: int = 0) -> Any:
    def way(problem: Any) -> Any:
        own = {"horizon": problem.rows}
        if method != "srim":
            own |= {"nc": problem.rows, "m": 2 * problem.rows + more}
        found = mdof.sysid(columns(problem.u), columns(problem.y), method=method, order=problem.order, threads=1, **own)
        return found[0]

    return way


WAYS = {"srim": _mdof("srim"), "okid-era": _mdof("okid-era", 2), "okid-era-dc": _mdof("okid-era-dc", 4)}
