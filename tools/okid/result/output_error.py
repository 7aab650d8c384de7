# SPDX-License-Identifier: MIT
"""B and D of a subspace model from the records themselves: least squares of the simulated outputs."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from okid import abi
from okid.abi.identifier import Identified, Identifier

Real = NDArray[np.float64]


def fit_inputs(A: Real, C: Real, records: Sequence[Real], n_u: int) -> tuple[Real, Real]:
    """B (n_z, n_u) and D (n_y, n_u) for records (N, n_u + n_y), inputs first, NaN = missing.

    Raises Error when the eigenvectors of A are not independent or an unstable A runs out of range.
    """
    n_z, n_y, lib = len(A), len(C), abi.library()
    counts = np.array([len(record) for record in records], dtype=np.int32)
    samples = np.ascontiguousarray(np.vstack(records))
    columns = [np.asfortranarray(A), np.asfortranarray(C)]
    B, D = np.zeros((n_u, n_z)), np.zeros((n_u, n_y))
    block = abi.block(int(lib.okid_subspace_output_error_memsize(n_u, n_y, n_z, len(records))))
    status = lib.okid_subspace_output_error(
        n_u, n_y, n_z, *map(abi.pointer, columns), len(records), counts.ctypes.data_as(abi.int32s),
        abi.pointer(samples), abi.pointer(B), abi.pointer(D), None, block.ctypes.data, block.size,
    )  # fmt: skip
    abi.check(status, "B and D from the records")
    return B.T, D.T


def refitted(identifier: Identifier, found: Identified, records: Sequence[Real], n_u: int) -> Identified:
    """The model of the last run with the B and D that the records, detrended, ask for."""
    return identifier.set_inputs(*fit_inputs(found.A, found.C, records, n_u))
