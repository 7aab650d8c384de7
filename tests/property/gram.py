# SPDX-License-Identifier: MIT
"""The observer solved from the Gram matrix of an accumulator, by the C function itself."""

from __future__ import annotations

import ctypes

import numpy as np
from okid import Accumulator, abi


def solve_gram(
    sums: Accumulator, detrend: str, stabilise: bool, ridge: float = 0.0
) -> tuple[np.ndarray, abi.ObserverInfo]:
    """okid_observer_solve(): theta (n_y x q) and what it found."""
    library, q = abi.library(), sums.n_u + sums.lags * sums.channels
    config = abi.ObserverConfig(sums.n_u, sums.n_y, sums.lags, ridge, int(not stabilise))
    work = abi.block(int(library.okid_observer_memsize(ctypes.byref(config))))
    theta, info = np.empty((q, sums.n_y)), abi.ObserverInfo()
    gram = sums.gram(detrend)[0]
    status = library.okid_observer_solve(
        ctypes.byref(config), abi.pointer(gram), sums.rows, abi.pointer(theta), None, ctypes.byref(info),
        work.ctypes.data, work.size,
    )  # fmt: skip
    assert status == abi.OK
    return theta.T, info
