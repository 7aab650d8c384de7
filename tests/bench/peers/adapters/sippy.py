# SPDX-License-Identifier: MIT
"""SIPPY (sippy-unipi): system_identification(y, u, "N4SID" | "MOESP" | "CVA"): A, B, C, D, K.

Settings: SS_f = SS_p = s, SS_fixed_order = true order, SS_D_required (accelerometers have a direct term).
"""

from __future__ import annotations

from typing import Any

from adapters.shapes import columns
from sippy_unipi import system_identification


def _sippy(method: str) -> Any:
    def way(problem: Any) -> Any:
        return system_identification(
            columns(problem.y), columns(problem.u), method, tsample=1.0 / problem.fs, SS_f=problem.rows,
            SS_p=problem.rows, SS_fixed_order=problem.order, SS_D_required=True,
        ).A  # fmt: skip

    return way


WAYS = {name: _sippy(name) for name in ("N4SID", "MOESP", "CVA")}
