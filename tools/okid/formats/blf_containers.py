# SPDX-License-Identifier: MIT
"""The containers of a Vector BLF log, counted before python-can reads them: it decompresses each one whole."""

from __future__ import annotations

import struct
from pathlib import Path

from okid._errors import InputError
from okid.data.input_file import LARGEST
from okid.data.memory import decompressed, most_bytes

_FILE = struct.Struct("<4sL8xQ")  # signature, size of the head, of the file
_OBJECT = struct.Struct("<4sHHLL")  # signature, size of the head, version, size, type
_CONTAINER, _ZLIB = 10, 2
_METHOD = struct.Struct("<H6xL4x")
_LARGEST_CONTAINER = 64 << 20  # bytes; Vector and python-can write 128 KiB


def check_blf(path: str | Path) -> None:
    """InputError when an object is smaller than its head or larger than the file, or what is compressed is a bomb."""
    size, whole = Path(path).stat().st_size, 0
    with open(path, "rb") as file:
        head = file.read(_FILE.size)
        if len(head) < _FILE.size or head[:4] != b"LOGG":
            raise InputError(f"it begins with {head[:4]!r}, expected LOGG")
        _, first, stated = _FILE.unpack(head)
        if stated > size:
            raise InputError(f"has {size} bytes, its header says {stated}: the file is cut off")
        file.seek(first)
        while len(head := file.read(_OBJECT.size)) == _OBJECT.size:
            signature, _, _, length, kind = _OBJECT.unpack(head)
            if signature != b"LOBJ" or not _OBJECT.size <= length <= size:
                raise InputError(f"there is no whole object at byte {file.tell() - _OBJECT.size}")
            data = file.read(min(length - _OBJECT.size, LARGEST))
            file.seek(length % 4, 1)
            if kind != _CONTAINER or len(data) < _METHOD.size:
                continue
            if _METHOD.unpack_from(data)[0] == _ZLIB:
                most = min(_LARGEST_CONTAINER, most_bytes() - whole)
                whole += len(decompressed(data[_METHOD.size :], most, "its containers"))
