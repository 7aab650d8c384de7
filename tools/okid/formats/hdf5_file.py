# SPDX-License-Identifier: MIT
"""An HDF5 file opened for reading that stands alone: nothing in it leads to another file, and its size is bounded.

HDF5 can keep the numbers of a dataset in any file of the computer (external storage), link to objects of other files
and make datasets of pieces of them (virtual datasets). The author of such a file would choose what is read here.
"""

from __future__ import annotations

import contextlib
import math
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from okid._errors import InputError
from okid.data.memory import require_memory
from okid.formats.foreign_library import library

_MOST_OBJECTS = 200_000


def _check_dataset(name: str, data: Any) -> float:
    """Its bytes."""
    if data.external:
        where = str(data.external[0][0])[:80]
        raise InputError(f"dataset {name} keeps its numbers in another file ({where!r}): refused")
    if data.is_virtual:
        raise InputError(f"dataset {name} is made of pieces of other files (a virtual dataset): refused")
    width = max(8, data.dtype.itemsize)
    if data.chunks:  # one of them is decompressed whole
        require_memory(math.prod(data.chunks) * width, f"a chunk of dataset {name}")
    return float(math.prod(data.shape or ()) * width)


def _check(h5py: Any, file: Any) -> None:
    """Every object that hard links lead to. InputError names what leads out of the file."""
    waiting, known, whole, count = [("", file)], set(), 0.0, 0
    while waiting:
        place, group = waiting.pop()
        about = h5py.h5o.get_info(group.id)
        if (about.fileno, about.addr) in known:
            continue
        known.add((about.fileno, about.addr))
        for name in group:
            link = group.get(name, getlink=True)
            here = f"{place}/{name}"
            if isinstance(link, h5py.ExternalLink):
                raise InputError(f"{here} is a link into another file ({link.filename[:80]!r}): refused")
            if not isinstance(link, h5py.HardLink):
                continue  # into this file, where hard links lead too
            item = group[name]
            if isinstance(item, h5py.Dataset):
                whole += _check_dataset(here, item)
            elif isinstance(item, h5py.Group):
                waiting.append((here, item))
            count += 1
            if count > _MOST_OBJECTS:
                raise InputError(f"holds more than {_MOST_OBJECTS} objects")
    require_memory(whole, "its datasets")


@contextlib.contextmanager
def hdf5_file(path: str | Path, purpose: str = "HDF5") -> Iterator[tuple[Any, Any]]:
    """h5py and the open file. InputError when something in it leads out of it, or it asks for too much memory."""
    h5py = library("h5py", purpose)
    with h5py.File(path, "r") as file:
        _check(h5py, file)
        yield h5py, file
