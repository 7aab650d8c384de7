# SPDX-License-Identifier: MIT
"""MATLAB files: version 4 and 5 through scipy, 7.3 (which is HDF5) through h5py; written as version 5."""

from __future__ import annotations

import json
import os
import struct
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.io import loadmat, savemat

from okid._errors import InputError
from okid.data.input_file import LARGEST, parse_json
from okid.data.memory import decompressed, most_bytes
from okid.data.records import Record
from okid.formats.channel_arrays import record_of_arrays, stated_rate
from okid.formats.foreign_library import reading, writing
from okid.formats.hdf5_file import hdf5_file
from okid.formats.mat_exports import exported, texts
from okid.formats.result_tree import result_dict, result_tree
from okid.result.result import Result

_SIGNATURE_73 = b"\x89HDF\r\n\x1a\n"
_MOST_BYTES = 2**31 - 1  # of one variable in version 5
_HEAD_5, _COMPRESSED = 128, 15  # bytes above the variables; kind of a compressed one
_MOST_LEVELS = 8  # of structs and cells within each other


def _cells(texts: list[str]) -> NDArray[np.object_]:
    """A cell array of texts, one column."""
    cells = np.empty((len(texts), 1), dtype=object)
    cells[:, 0] = texts
    return cells


def _of_record(record: Record) -> dict[str, Any]:
    about = record.about()
    return {
        "samples": record.samples,
        "names": _cells(about["names"]),
        "units": _cells(about["units"]),
        "title": about["title"],
        **({} if record.fs_hz is None else {"fs": record.fs_hz}),
        "okid_record": json.dumps(about),
    }


def _of_result(what: Result | Mapping[str, Any]) -> dict[str, Any]:
    tree = result_tree(result_dict(what))
    return {
        **tree["model"], **tree["modes"], **{key: tree[key] for key in ("mkr", "pdc") if tree.get(key)},
        "fs": tree["fs_hz"], "inputs": _cells(tree["inputs"]), "outputs": _cells(tree["outputs"]),
        "singular_values": tree["singular_values"], "markov": tree["markov"], "okid_result": tree["json"],
    }  # fmt: skip


def write_mat(path: str | Path, what: Record | Result | Mapping[str, Any]) -> None:
    """Write a record, or a result (Result or okid.result/1 dictionary), as a MATLAB 5 file.

    Record: samples (N, m), names and units as cell columns, fs, title. Result: A, B, C, D, K, dt, x0 as
    `okid identify --model` has them, frequency_hz, damping_ratio, shapes (outputs x modes) .., structs mkr and pdc.
    The texts okid_record and okid_result hold all the rest as JSON. InputError above 2 GiB a variable.
    """
    variables = _of_record(what) if isinstance(what, Record) else _of_result(what)
    if any(isinstance(value, np.ndarray) and value.nbytes > _MOST_BYTES for value in variables.values()):
        raise InputError(f"{path}: a variable of more than 2 GiB does not fit into a MATLAB 5 file; write .h5 instead")
    with writing(path) as part:
        savemat(part, variables, appendmat=False, do_compression=True, long_field_names=True)


def _is_73(path: str | Path) -> bool:
    with open(path, "rb") as file:
        head = file.read(520)
    return head.startswith(_SIGNATURE_73) or head[512:520] == _SIGNATURE_73


def _value_5(value: Any, level: int = 0) -> Any:
    """A variable of loadmat(); structs as dictionaries, arrays of structs as lists of them."""
    if level > _MOST_LEVELS or not isinstance(value, np.ndarray) or value.dtype.names is None:
        return value
    made = [{key: _value_5(one[key], level + 1) for key in value.dtype.names} for one in value.reshape(-1)]
    return made[0] if len(made) == 1 else made


def _check_5(path: str | Path) -> None:
    """The compressed variables of version 5 are counted before scipy decompresses them whole."""
    with open(path, "rb") as file:
        head = file.read(_HEAD_5)
        order = {b"IM": "<", b"MI": ">"}.get(head[126:128])
        whole = 0
        while order and len(tag := file.read(8)) == 8:
            kind, size = struct.unpack(f"{order}II", tag)
            if kind != _COMPRESSED:
                file.seek(size, os.SEEK_CUR)
                continue
            whole += len(decompressed(file.read(min(size, LARGEST)), most_bytes() - whole, "its compressed variables"))


def _variables_5(path: str | Path) -> dict[str, Any]:
    _check_5(path)
    return {key: _value_5(value) for key, value in loadmat(path, appendmat=False).items() if not key.startswith("__")}


def _value_73(file: Any, item: Any, level: int = 0) -> Any:
    """One variable of a 7.3 file as _value_5() would give it: transposed, texts and cells of texts decoded.

    Fields of an array of structs are cells, one a struct.
    """
    if level > _MOST_LEVELS:
        raise InputError(f"structs and cells are nested more than {_MOST_LEVELS} deep")
    if hasattr(item, "keys"):
        return {key: _value_73(file, item[key], level + 1) for key in item}
    kind = item.attrs.get("MATLAB_class", b"")
    kind = kind.decode("ascii", "replace") if isinstance(kind, bytes) else str(kind)
    if "MATLAB_empty" in item.attrs:
        return np.empty((0, 0), dtype="U1" if kind == "char" else float)
    array = np.asarray(item[()])
    if kind == "char":
        return np.array(["".join(map(chr, row)) for row in np.atleast_2d(array.T).tolist()])
    if kind == "cell" or array.dtype.kind == "O":
        cells = np.empty(array.size, dtype=object)
        for k, one in enumerate(array.reshape(-1)):
            cells[k] = _value_73(file, file[one], level + 1)
        return cells
    if array.dtype.names == ("real", "imag"):
        array = array["real"] + 1j * array["imag"]
    return array.T


def _variables_73(path: str | Path) -> dict[str, Any]:
    with hdf5_file(path, "MATLAB 7.3") as (_, file):
        return {key: _value_73(file, file[key]) for key in file if not key.startswith("#")}


def _wanted(variables: dict[str, Any], group: int | str | None) -> dict[str, Any]:
    """The variables that `group` names; scalars stay, for they may say the rate."""
    if group is None:
        return variables
    names = [name.strip() for name in str(group).split(",")]
    missing = [name for name in names if name not in variables]
    if missing:
        raise InputError(f"no variable {missing[0]!r}; it has {', '.join(variables)}")
    return {key: value for key, value in variables.items() if key in names or np.asarray(value).size == 1}


def read_mat(path: str | Path, group: int | str | None = None) -> Record:
    """Read a MATLAB file, version 4 to 7.3: what write_mat() wrote, or arrays of another program.

    Foreign files: vectors are channels, matrices samples x channels ("y" becomes y1, y2 ..); fs, sample_rate .. (Hz),
    dt, Ts .. (s) or an even vector t, time (s) give the rate; cell arrays names and units are used when they fit.
    Exports of Testlab (structs with x_values and y_values) and Dewesoft (Data1_NAME, Data1_time_NAME, Sample_rate) by
    what they state themselves. group: variable names with commas, when not all have the same number of samples, or the
    number of a raster of an export. InputError of one line otherwise.
    """
    with reading(path, "a MATLAB file"):
        variables = _variables_73(path) if _is_73(path) else _variables_5(path)
        own = texts(variables["okid_record"]) if "okid_record" in variables else None
        if own and group is None:
            return Record.described(variables["samples"], parse_json("".join(own)))
        if "okid_result" in variables and group is None:
            raise InputError("holds an identified model, expected measured samples")
        foreign = exported(variables, group)
        if foreign is not None:
            return foreign
        taken = _wanted(variables, group)
        arrays = {
            key: value for key, value in taken.items() if isinstance(value, np.ndarray) and value.dtype.kind in "fiubc"
        }
        rates = {key: rate for key, value in arrays.items() if (rate := stated_rate(key, value)) is not None}
        listed = {key: texts(np.asarray(variables[key])) or [] for key in ("names", "units") if key in variables}
        return record_of_arrays(
            {key: value for key, value in arrays.items() if key not in rates}, rates,
            names=listed.get("names", []), name_units=listed.get("units", []),
        )  # fmt: skip


def read_mat_result(path: str | Path) -> dict[str, Any]:
    """The okid.result/1 dictionary that write_mat() stored. InputError when the file holds none."""
    with reading(path, "a MATLAB file"):
        variables = _variables_73(path) if _is_73(path) else _variables_5(path)
        found = texts(variables["okid_result"]) if "okid_result" in variables else None
        if not found:
            raise InputError("holds no okid.result/1")
        return result_dict(parse_json("".join(found)))
