# SPDX-License-Identifier: MIT
"""okid's kernels alone, called from Python: Accumulator.add(record), Identifier.run(sums): A, B, C, D, K and modes.

What okid.identify does besides (B and D of the record, fits, standard deviations) is left out: the work that most peers
do. Settings as in okid_identify.py.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import okid


def _kernel(method: str) -> Any:
    def way(problem: Any) -> Any:
        n_u, n_y = problem.u.shape[1], problem.y.shape[1]
        block_rows = (2 if method.startswith("okid") else 1) * problem.rows
        identifier = okid.Identifier(
            n_u, n_y, fs=problem.fs, p=problem.rows, rows=block_rows, order=problem.order, method=method,
            detrend="none",
        )  # fmt: skip
        with okid.Accumulator(n_u, n_y, identifier.lags) as sums:
            sums.add(np.hstack([problem.u, problem.y]))
            return identifier.run(sums).model().A

    return way


WAYS = {name: _kernel(name) for name in ("okid-era", "n4sid-moesp", "n4sid-cva", "n4sid-ssarx")}
