# SPDX-License-Identifier: MIT
"""The blocks of an MDF 4 file, walked before asammdf reads them: it follows links for ever where they form a ring, and
decompresses what a block holds, not what it states."""

from __future__ import annotations

import mmap
import struct
from collections.abc import Iterator
from pathlib import Path

from okid._errors import InputError
from okid.data.memory import decompressed, require_memory

_HEAD = struct.Struct("<4s4xQQ")  # id, length, number of links
_PACKED = struct.Struct("<2sBxIQQ")  # of a ##DZ: type of the block inside, zip type, parameter, size, packed size
_FIRST = 64  # where the ##HD is
_LINKS = {b"##CN": 8, b"##CH": 2, b"##EV": 1, b"##CA": 1, b"##CG": 6}  # those behind lead back to groups and channels
_INVERSE = 3  # of a conversion: another one that leads back


def _block(data: mmap.mmap, at: int) -> tuple[bytes, int, int]:
    """Its id, length and number of links."""
    if at + _HEAD.size > len(data):
        raise InputError(f"a link leads to byte {at} of {len(data)}")
    kind, length, links = _HEAD.unpack_from(data, at)
    if kind[:2] != b"##" or length < _HEAD.size + 8 * links or at + length > len(data):
        raise InputError(f"there is no whole block at byte {at}, where a link leads")
    return kind, length, links


def _next(data: mmap.mmap, at: int) -> list[int]:
    """The blocks that a block leads to, forward."""
    kind, length, links = _block(data, at)
    if kind == b"##DZ":
        _check_packed(data, at, length)
    count = min(links, _LINKS.get(kind, links))
    found = struct.unpack_from(f"<{count}Q", data, at + _HEAD.size)
    return [link for k, link in enumerate(found) if link and not (kind == b"##CC" and k == _INVERSE)]


def _check_packed(data: mmap.mmap, at: int, length: int) -> None:
    _, _, _, size, packed = _PACKED.unpack_from(data, at + _HEAD.size)
    begin = at + _HEAD.size + _PACKED.size
    if begin + packed > at + length:
        raise InputError(f"the compressed block at byte {at} is cut off")
    require_memory(size, f"the compressed block at byte {at}")
    decompressed(data[begin : begin + packed], size, f"the compressed block at byte {at} states {size} bytes and")


def _walk(data: mmap.mmap) -> None:
    """Depth first; a block that leads back to one on the way to it is a ring."""
    done: set[int] = set()
    way: list[tuple[int, Iterator[int]]] = [(_FIRST, iter(_next(data, _FIRST)))]
    on_way = {_FIRST}
    while way:
        at, following = way[-1]
        link = next(following, None)
        if link is None:
            way.pop()
            on_way.discard(at)
            done.add(at)
        elif link in on_way:
            raise InputError(f"the blocks form a ring: that at byte {at} leads back to byte {link}")
        elif link not in done:
            on_way.add(link)
            way.append((link, iter(_next(data, link))))


def check_mdf4(path: str | Path) -> None:
    """InputError when the file is no MDF 4, its links form a ring or lead nowhere, or a block is a bomb."""
    with open(path, "rb") as file:
        head = file.read(_FIRST)
        if len(head) < _FIRST or head[:8] not in (b"MDF     ", b"UnFinMF ") or head[8:9] != b"4":
            raise InputError(f"it begins with {head[:12]!r}, expected MDF and version 4")
        with mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) as data:
            _walk(data)
