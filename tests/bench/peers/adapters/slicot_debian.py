# SPDX-License-Identifier: MIT
"""SLICOT (Fortran, Debian package libslicot0) by ctypes: IB01AD, then IB01BD: A, B, C, D, K.

Settings: METH and ALG as the way says (Cholesky for speed; SLICOT goes on to QR itself where that fails), JOBD M for
MOESP, one batch, the true order, no question about it, JOBCK K. u and y are copied: IB01AD may overwrite.
"""

from __future__ import annotations

import ctypes
from typing import Any

import numpy as np

_library = ctypes.CDLL("libslicot.so.0")


def _call(routine: str, *arguments: Any) -> None:
    """Everything by address, lengths of the CHARACTER arguments behind all others."""
    passed: list[Any] = []
    texts = 0
    for a in arguments:
        if isinstance(a, str):
            passed.append(ctypes.c_char_p(a.encode()))
            texts += 1
        elif isinstance(a, np.ndarray):
            passed.append(a.ctypes.data_as(ctypes.c_void_p))
        elif isinstance(a, float):
            passed.append(ctypes.byref(ctypes.c_double(a)))
        else:
            passed.append(ctypes.byref(a if isinstance(a, ctypes.c_int) else ctypes.c_int(a)))
    getattr(_library, routine)(*passed, *[ctypes.c_size_t(1)] * texts)


def _slicot(meth: str, alg: str) -> Any:
    def way(problem: Any) -> Any:
        u, y = np.asfortranarray(problem.u.copy()), np.asfortranarray(problem.y.copy())
        (samples, m), n_y, n, s = u.shape, y.shape[1], problem.order, problem.rows
        width = 2 * (m + n_y) * s
        ldr, unknowns = max(width, 3 * m * s), m * (n + n_y)
        R, values = np.zeros((ldr, width), order="F"), np.zeros(n_y * s)
        work = np.zeros(8 * width**2 + 4 * m * s * (n + n_y) * (unknowns + 1) + 1_000_000)
        whole = np.zeros(4 * width + n * n + 4 * unknowns, np.int32)
        found, warning, info = ctypes.c_int(0), ctypes.c_int(0), ctypes.c_int(0)
        _call("ib01ad_", meth, alg, "M" if meth == "M" else "N", "O", "N", "N", s, m, n_y, samples, u, samples, y,
              samples, found, R, ldr, values, 0.0, -1.0, whole, work, work.size, warning, info)  # fmt: skip
        if info.value != 0:
            raise RuntimeError(f"IB01AD: info {info.value}")
        A, B, C, D = (np.zeros(shape, order="F") for shape in ((n, n), (n, m), (n_y, n), (n_y, m)))
        Q, Ry, S, K = (np.zeros(shape, order="F") for shape in ((n, n), (n_y, n_y), (n, n_y), (n, n_y)))
        _call("ib01bd_", meth, "A", "K", s, n, m, n_y, samples, R, ldr, A, n, C, n_y, B, n, D, n_y, Q, n, Ry, n_y, S,
              n, K, n, 0.0, whole, work, work.size, np.zeros(2 * n, np.int32), warning, info)  # fmt: skip
        if info.value != 0:
            raise RuntimeError(f"IB01BD: info {info.value}")
        return A

    return way


WAYS = {
    "MOESP, Cholesky": _slicot("M", "C"),
    "N4SID, Cholesky": _slicot("N", "C"),
    "MOESP, QR": _slicot("M", "Q"),
}
