# SPDX-License-Identifier: MIT
"""strid: CombinedDeterministicStochasticSID(u, y, fs).perform(order, block_rows, estimate_B_and_D=True): A, B, C, D.

Settings: block_rows = s, true order.
"""

from __future__ import annotations

from typing import Any

import strid
from adapters.shapes import columns


def _strid(problem: Any) -> Any:
    method = strid.CombinedDeterministicStochasticSID(columns(problem.u), columns(problem.y), problem.fs)
    return method.perform(problem.order, problem.rows, estimate_B_and_D=True)[0]


WAYS = {"CSI": _strid}
