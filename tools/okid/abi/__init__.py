# SPDX-License-Identifier: MIT
"""libokid, loaded: everything of _layout with it. It is looked for in $OKID_LIBRARY, beside this file, and in
<repository>/build.
"""

from __future__ import annotations

import ctypes
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from okid._errors import Error, IdentificationError, InputError
from okid.abi.layout import *  # noqa: F403
from okid.abi.layout import ABI, ERR_DIM, ERR_FORMAT, ERR_MISMATCH, ERR_RANGE, ERR_TOO_SHORT, doubles
from okid.abi.shared_object import load
from okid.abi.signatures import SIGNATURES


@lru_cache(maxsize=1)
def library() -> Any:
    """The loaded shared object with typed functions. OSError names every place that was tried."""
    loaded, path = load("libokid.so", "OKID_LIBRARY")
    if not hasattr(loaded, f"okid_accumulator_create_{ABI}_double"):
        raise OSError(f"{path}: not libokid of interface {ABI} in double precision: run `make build` again")
    for name, (result, arguments) in SIGNATURES.items():
        linked = f"{name}_{ABI}_double"  # lib/include/okid/abi.h
        function = loaded[linked] if hasattr(loaded, linked) else loaded[name]
        setattr(loaded, name, function)
        function.restype = result
        function.argtypes = arguments
    return loaded


def direct(name: str) -> Any:
    """A function of the library (handle, samples, count) that takes any buffer as samples: the path of every block."""
    function = library()[name]
    function.restype, function.argtypes = ctypes.c_int, (ctypes.c_void_p, ctypes.c_void_p, ctypes.c_size_t)
    return function


def pointer(array: NDArray[np.float64] | None) -> Any:
    """double* of a float64 array (None stays NULL). The caller keeps the array alive."""
    return None if array is None else array.ctypes.data_as(doubles)


def matrix(pointer: Any, rows: int, columns: int) -> NDArray[np.float64]:
    """A copy (rows, columns) of a column-major matrix of the library; zeros where it gave none."""
    if rows * columns == 0 or not pointer:
        return np.zeros((rows, columns))
    return np.array(np.ctypeslib.as_array(pointer, (columns, rows)).T, dtype=np.float64, order="C")


def block(size: int) -> NDArray[np.uint8]:
    """Zeroed memory of `size` bytes that begins on a 64-byte boundary, so that a copy of it is laid out alike."""
    raw = np.zeros(size + 64, dtype=np.uint8)
    skip = -raw.ctypes.data % 64
    return raw[skip : skip + size]


def status_text(status: int) -> str:
    """One line of English for a status."""
    text: bytes = library().okid_status_text(status)
    return text.decode()


def check(status: int, what: str) -> int:
    """Raise the exception that belongs to an error status; warnings (> 0) pass."""
    if status >= 0:
        return status
    kind: type[Error] = Error
    if status in (ERR_DIM, ERR_MISMATCH, ERR_RANGE, ERR_FORMAT):
        kind = InputError
    elif status <= ERR_TOO_SHORT:
        kind = IdentificationError
    raise kind(f"{what}: {status_text(status)}", status)
