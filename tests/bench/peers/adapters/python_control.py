# SPDX-License-Identifier: MIT
"""python-control: markov(Y, U, m), then eigensys_realization(H, r): A, B, C, D.

It has no observer: the Markov parameters are fitted as they are, so m has to span the ringing of the slowest mode (to
1 %, which only a bench knows beforehand). Settings: truncate (the first m equations see an unknown past), s block
rows and columns of the Hankel matrix, true order.
"""

from __future__ import annotations

from typing import Any

import control
from adapters.shapes import columns


def _control(problem: Any) -> Any:
    h = control.markov(columns(problem.y), columns(problem.u), problem.ringing, truncate=True)
    found = control.eigensys_realization(h, problem.order, m=problem.rows, n=problem.rows, dt=1.0 / problem.fs)
    return found[0].A


WAYS = {"markov + ERA": _control}
