# SPDX-License-Identifier: MIT
"""One bound for the memory that a file may ask for, checked before any of it is taken: `max_memory_mb`.

8192 MB, or what the environment variable OKID_MAX_MEMORY_MB says, for the program (files/memory_bound.hpp) and for
Python alike. It does not depend on what is free. Reading and identifying a record takes about four times its
samples, so these may have a quarter of it.
"""

from __future__ import annotations

import math
import os
import zlib
from typing import Any

from okid._errors import InputError

VARIABLE, DEFAULT_MB, SHARE = "OKID_MAX_MEMORY_MB", 8192.0, 4
_STEP = 1 << 20  # bytes that are decompressed at once


def max_memory_mb() -> float:
    """The bound. InputError when the environment says something else than a number above 0."""
    text = os.environ.get(VARIABLE, "")
    try:
        value = float(text) if text else DEFAULT_MB
    except ValueError:
        value = math.nan
    if not (0 < value <= 1e6):
        raise InputError(f"{VARIABLE} is {text!r}, expected a number of MB above 0 to 1000000")
    return value


def most_bytes() -> int:
    """Bytes that the samples of a record, or what a file is decompressed to, may take."""
    return int(max_memory_mb() * 1e6 / SHARE)


def require_memory(wanted: float, what: str) -> None:
    """InputError when `wanted` bytes are more than most_bytes(); `what` they are for: "1000 samples of 1 channels"."""
    if not wanted <= most_bytes():
        raise InputError(
            f"{what} take {wanted / 1e6:.0f} MB, at most {most_bytes() / 1e6:.0f} MB are read (a quarter of "
            f"max_memory_mb = {max_memory_mb():g}; {VARIABLE} sets it)"
        )


def require_samples(rows: float, columns: float) -> None:
    """require_memory() of samples as real numbers."""
    require_memory(8.0 * rows * columns, f"{rows:.0f} samples of {columns:.0f} channels")


def decompressed(data: bytes, most: int | None = None, what: str = "compressed data") -> bytes:
    """zlib.decompress() that counts as it goes. InputError beyond `most` bytes (default most_bytes()); zlib.error."""
    limit = most_bytes() if most is None else most
    machine = zlib.decompressobj()
    out = bytearray(machine.decompress(data, _STEP))
    while machine.unconsumed_tail and len(out) <= limit:
        out += machine.decompress(machine.unconsumed_tail, _STEP)
    if len(out) > limit:
        raise InputError(f"{what} grow beyond {limit / 1e6:.1f} MB: is it a bomb?")
    out += machine.flush(_STEP)
    if not machine.eof:
        raise zlib.error("incomplete or truncated stream")
    return bytes(out)


def load_npy(file: Any, size: int) -> Any:
    """np.load() of an open array of `size` bytes: its shape is compared with them before memory is taken."""
    import numpy as np

    version = np.lib.format.read_magic(file)
    if version not in ((1, 0), (2, 0)):
        raise InputError(f"is a .npy file of version {version[0]}.{version[1]}, expected 1 or 2")
    read = np.lib.format.read_array_header_1_0 if version == (1, 0) else np.lib.format.read_array_header_2_0
    shape, _, kind = read(file)
    if kind.hasobject or math.prod(shape) * kind.itemsize != size - file.tell():
        raise InputError(f"holds {size - file.tell()} bytes of numbers, its head says {shape} of {kind}")
    require_memory(8.0 * math.prod(shape), f"an array {shape}")
    file.seek(0)
    return np.load(file, allow_pickle=False)
