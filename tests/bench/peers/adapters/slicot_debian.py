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


def _arguments(*arguments: Any) -> list[Any]:
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
    return [*passed, *[ctypes.c_size_t(1)] * texts]


def prepared(meth: str, alg: str, given_u: Any, given_y: Any, n: int, s: int) -> Any:
    """A function that identifies these arrays at order n and s block rows and returns A; memory is taken before."""
    u, y = np.array(given_u, order="F"), np.array(given_y, order="F")
    (samples, m), n_y = u.shape, y.shape[1]
    width = 2 * (m + n_y) * s
    ldr, unknowns = max(width, 3 * m * s), m * (n + n_y)
    R, values = np.zeros((ldr, width), order="F"), np.zeros(n_y * s)
    work = np.zeros(8 * width**2 + 4 * m * s * (n + n_y) * (unknowns + 1) + 1_000_000)
    whole = np.zeros(4 * width + n * n + 4 * unknowns, np.int32)
    found, warning, info = ctypes.c_int(0), ctypes.c_int(0), ctypes.c_int(0)
    A, B, C, D = (np.zeros(shape, order="F") for shape in ((n, n), (n, m), (n_y, n), (n_y, m)))
    Q, Ry, S, K = (np.zeros(shape, order="F") for shape in ((n, n), (n_y, n_y), (n, n_y), (n, n_y)))
    logical, room = np.zeros(2 * n, np.int32), (whole, work, work.size)
    first = _arguments(meth, alg, "M" if meth == "M" else "N", "O", "N", "N", s, m, n_y, samples, u, samples, y,
                       samples, found, R, ldr, values, 0.0, -1.0, *room, warning, info)  # fmt: skip
    second = _arguments(meth, "A", "K", s, n, m, n_y, samples, R, ldr, A, n, C, n_y, B, n, D, n_y, Q, n, Ry, n_y, S,
                        n, K, n, 0.0, *room, logical, warning, info)  # fmt: skip

    def run() -> Any:
        for routine, arguments in (("ib01ad_", first), ("ib01bd_", second)):
            getattr(_library, routine)(*arguments)
            if info.value != 0:
                raise RuntimeError(f"{routine[:-1].upper()}: info {info.value}")
        return A

    return run


def _slicot(meth: str, alg: str) -> Any:
    return lambda problem: prepared(meth, alg, problem.u, problem.y, problem.order, problem.rows)()


WAYS = {
    "MOESP, Cholesky": _slicot("M", "C"),
    "N4SID, Cholesky": _slicot("N", "C"),
    "MOESP, QR": _slicot("M", "Q"),
}
