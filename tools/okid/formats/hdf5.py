# SPDX-License-Identifier: MIT
"""HDF5: records and results in the layout of docs/reference/formats.md, and equal-length datasets of other programs."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from okid._errors import InputError
from okid.data.input_file import parse_json
from okid.data.records import Record
from okid.formats.channel_arrays import record_of_arrays, stated_rate
from okid.formats.foreign_library import library, reading, writing
from okid.formats.hdf5_file import hdf5_file
from okid.formats.result_tree import result_dict, result_tree
from okid.result.result import Result

_CHUNK = 8192


def _digest(samples: NDArray[np.float64]) -> str:
    return hashlib.sha256(np.ascontiguousarray(samples, dtype="<f8").data).hexdigest()


def _put_record(file: Any, record: Record) -> None:
    about = record.about()
    file.attrs["schema"] = about["schema"]
    file.attrs["title"] = about["title"]
    for key in ("fs_hz", "start_time"):
        if about[key] is not None:
            file.attrs[key] = about[key]
    chunks = (min(_CHUNK, max(1, len(record.samples))), 1)
    samples = file.create_dataset("samples", data=record.samples, chunks=chunks, compression="gzip", shuffle=True)
    samples.attrs["sha256"] = _digest(record.samples)
    text = library("h5py", "HDF5").string_dtype()
    samples.attrs.create("names", about["names"], dtype=text)
    samples.attrs.create("units", about["units"], dtype=text)
    samples.attrs.create("roles", [role or "" for role in about["roles"]], dtype=text)
    samples.attrs.create("dofs", [dof or 0 for dof in about["dofs"]], dtype="<i4")
    notes = file.create_group("notes")
    for key, value in about["notes"].items():
        notes.attrs[key] = value


def _put_tree(group: Any, tree: Mapping[str, Any]) -> None:
    for key, value in tree.items():
        if isinstance(value, Mapping):
            _put_tree(group.create_group(key), value)
        elif isinstance(value, list):
            group.create_dataset(key, data=value, dtype=library("h5py", "HDF5").string_dtype())
        else:
            group.create_dataset(key, data=value)


def write_hdf5(path: str | Path, what: Record | Result | Mapping[str, Any]) -> None:
    """Write a record, or a result (Result or okid.result/1 dictionary), in the layout of docs/reference/formats.md.

    About 1 s for 10^6 samples of 4 channels (gzip). InputError when h5py is missing or the file cannot be written.
    """
    h5py = library("h5py", "HDF5")
    tree = None if isinstance(what, Record) else result_tree(result_dict(what))
    with writing(path) as part, h5py.File(part, "w") as file:
        if isinstance(what, Record):
            _put_record(file, what)
        elif tree is not None:
            file.attrs["schema"] = "okid.result/1"
            file.attrs["fs_hz"] = tree.pop("fs_hz")
            _put_tree(file, tree)


def _rows(data: Any) -> NDArray[np.float64]:
    """A dataset in pieces: h5py lets no other thread run while it reads one."""
    if len(data.shape) != 2:
        return np.asarray(data[()], dtype=np.float64)
    out, step = np.empty(data.shape), 16 * _CHUNK
    for first in range(0, len(out), step):
        out[first : first + step] = data[first : first + step]
    return out


def _own(file: Any) -> Record:
    data = file["samples"]
    samples = _rows(data)
    attrs = data.attrs
    if "sha256" in attrs and attrs["sha256"] != _digest(samples):
        raise InputError("dataset samples is not what was written: its sha256 differs, the file is damaged or changed")
    about = {
        "schema": file.attrs["schema"],
        "title": file.attrs.get("title", ""),
        "fs_hz": file.attrs.get("fs_hz"),
        "start_time": file.attrs.get("start_time"),
        "names": [str(name) for name in attrs["names"]],
        "units": [str(unit) for unit in attrs["units"]],
        "roles": [str(role) or None for role in attrs["roles"]],
        "dofs": [int(dof) or None for dof in attrs["dofs"]],
        "notes": dict(file["notes"].attrs) if "notes" in file else {},
    }
    return Record.described(samples, about)


def _text(value: Any) -> str:
    if isinstance(value, np.ndarray) and value.size == 1:
        value = value.reshape(-1)[0]
    return value.decode("utf-8", "replace") if isinstance(value, bytes) else str(value)


class _Foreign:
    """The datasets of a file of another program, with their units, and whatever says a rate."""

    def __init__(self, h5py: Any) -> None:
        self._dataset = h5py.Dataset
        self.arrays: dict[str, NDArray[Any]] = {}
        self.units: dict[str, str] = {}
        self.rates: dict[str, float] = {}

    def note_rates(self, place: str, attrs: Any) -> None:
        for key, value in attrs.items():
            rate = stated_rate(key, value)
            if rate is not None:
                self.rates[f"{place}.{key}" if place else key] = rate

    def take(self, name: str, item: Any) -> None:
        """One object of the file, as visititems() hands it over."""
        self.note_rates(name, item.attrs)
        if not isinstance(item, self._dataset) or item.dtype.kind not in "fiubc" or item.shape is None:
            return
        array = np.asarray(item[()])
        rate = stated_rate(name.rpartition("/")[2], array) if array.size == 1 else None
        if rate is not None:
            self.rates[name] = rate
            return
        self.arrays[name] = array
        unit = next((item.attrs[key] for key in ("unit", "units", "Unit", "Units") if key in item.attrs), "")
        self.units[name] = _text(unit)


def read_hdf5(path: str | Path, group: int | str | None = None) -> Record:
    """Read a record from HDF5: the layout of docs/reference/formats.md, else every dataset of one length below `group`.

    Foreign files: vectors are channels, matrices samples x channels; attributes or scalars such as fs, sample_rate
    (Hz) or dt (s), else a dataset t, time .. (s), give the rate; attributes unit(s) the units. InputError when h5py
    is missing, the file is damaged, or lengths or rates differ.
    """
    with reading(path, "an HDF5 file"), hdf5_file(path) as (h5py, file):
        schema = file.attrs.get("schema")
        if schema == "okid.record/1" and group is None:
            return _own(file)
        if schema == "okid.result/1" and group is None:
            raise InputError("holds an identified model, expected measured samples")
        if group is not None and str(group) not in file:
            raise InputError(f"no group {group!r}; it has {', '.join(sorted(file))}")
        foreign, root = _Foreign(h5py), file if group is None else file[str(group)]
        foreign.note_rates("", file.attrs)
        if isinstance(root, h5py.Dataset):
            foreign.take(root.name.rpartition("/")[2], root)
        else:
            foreign.note_rates("", root.attrs)
            root.visititems(foreign.take)
        return record_of_arrays(foreign.arrays, foreign.rates, units=foreign.units)


def read_hdf5_result(path: str | Path) -> dict[str, Any]:
    """The okid.result/1 dictionary that write_hdf5() stored. InputError when the file holds none."""
    with reading(path, "an HDF5 file"), hdf5_file(path) as (_, file):
        if file.attrs.get("schema") != "okid.result/1" or "json" not in file:
            raise InputError("holds no okid.result/1")
        return result_dict(parse_json(_text(file["json"][()])))
