# SPDX-License-Identifier: MIT
"""llsi: sysid(SysIdData, outputs, inputs, order, method="po-moesp"): A, B, C, D.

Its block rows are set by the order and the number of channels and cannot be chosen. Settings: true order.
"""

from __future__ import annotations

from typing import Any

from llsi import SysIdData, sysid


def _llsi(problem: Any) -> Any:
    ins = {f"u{k}": problem.u[:, k] for k in range(problem.u.shape[1])}
    outs = {f"y{k}": problem.y[:, k] for k in range(problem.y.shape[1])}
    data = SysIdData(Ts=1.0 / problem.fs, **ins, **outs)
    return sysid(data, list(outs), list(ins), problem.order, method="po-moesp").A


WAYS = {"PO-MOESP": _llsi}
