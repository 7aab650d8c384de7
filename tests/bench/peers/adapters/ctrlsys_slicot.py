# SPDX-License-Identifier: MIT
"""ctrlsys (SLICOT translated to C, a wheel): ctrlsys.ib01ad, ctrlsys.ib01bd: A, B, C, D, K.

Settings as in slicot_debian.py; "no gain" is JOBCK N (A, B, C, D alone): with K this release writes beyond its own
memory at some sizes, W2 among them.
"""

from __future__ import annotations

from typing import Any

import ctrlsys
import numpy as np


def _slicot(meth: str, alg: str, jobck: str = "K") -> Any:
    def way(problem: Any) -> Any:
        (samples, n_u), n_y = problem.u.shape, problem.y.shape[1]
        _, R, _, _, info = ctrlsys.ib01ad(
            meth, alg, "M" if meth == "M" else "N", "O", "N", "N", problem.rows, n_u, n_y,
            np.array(problem.u, order="F"), np.array(problem.y, order="F"), 0.0, -1.0,
        )  # fmt: skip
        if info != 0:
            raise RuntimeError(f"IB01AD: info {info}")
        *matrices, info = ctrlsys.ib01bd(meth, "A", jobck, problem.rows, problem.order, n_u, n_y, samples, R, 0.0)
        if info != 0:
            raise RuntimeError(f"IB01BD: info {info}")
        return matrices[0]

    return way


WAYS = {
    "MOESP, Cholesky": _slicot("M", "C"),
    "MOESP, Cholesky, no gain": _slicot("M", "C", "N"),
    "N4SID, Cholesky": _slicot("N", "C"),
    "MOESP, QR": _slicot("M", "Q"),
}
