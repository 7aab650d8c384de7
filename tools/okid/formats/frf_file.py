# SPDX-License-Identifier: MIT
"""Files of frequency responses (docs/howto/frequency-responses.md): universal files and CSV, which the host library
reads, and HDF5."""

from __future__ import annotations

import ctypes
import json
import os
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from okid._errors import InputError
from okid.abi import host
from okid.data.whole_file import whole_file
from okid.formats.foreign_library import library, reading, writing
from okid.formats.hdf5_file import hdf5_file
from okid.formats.uff_function import FRF, ROLE_CODES, UffFunction, function_bytes
from okid.frf import Frf

_TABLES = (".csv", ".uff", ".unv")
_HDF5 = (".h5", ".hdf5")
_WAYS = {"x": 1, "y": 2, "z": 3, "rx": 4, "ry": 5, "rz": 6}
_UNITS = {"acceleration": "m/s^2", "velocity": "m/s", "displacement": "m"}


def _ending(path: str | Path) -> str:
    ending = Path(path).suffix.lower()
    if ending not in _TABLES + _HDF5:
        raise InputError(f"{path}: the extension is {ending!r}, expected one of {', '.join(_TABLES + _HDF5)}")
    return ending


def _read_tables(paths: Sequence[str | Path]) -> Frf:
    """By the host library; several files are joined there."""
    made, texts = ctypes.c_void_p(), (ctypes.c_char_p * len(paths))(*map(os.fsencode, paths))
    host.call("responses_read", texts, len(paths), ctypes.byref(made))
    try:
        about: dict[str, Any] = json.loads(host.library().okid_host_responses_json(made))
        f, h = ctypes.c_void_p(), ctypes.c_void_p()
        lines = host.library().okid_host_responses_data(made, ctypes.byref(f), ctypes.byref(h))
        n_u, n_y = len(about["inputs"]), len(about["outputs"])
        frequency = np.array((ctypes.c_double * lines).from_address(f.value or 0))
        flat = np.array((ctypes.c_double * (2 * lines * n_u * n_y)).from_address(h.value or 0)).view(np.complex128)
        response = np.ascontiguousarray(flat.reshape(lines, n_u, n_y).transpose(0, 2, 1))
        whole = Frf.of(frequency, response, about["inputs"], about["outputs"], about["set_ups"])
        return whole._replace(quantity=about["quantity"], other_units=tuple(about["other_units"]))
    finally:
        host.library().okid_host_responses_delete(made)


def _read_hdf5(path: str | Path) -> Frf:
    with reading(path, "an HDF5 file"), hdf5_file(path) as (_, file):
        missing = [name for name in ("frequency_hz", "response") if name not in file]
        if missing:
            raise InputError(f"no dataset {missing[0]!r}, expected frequency_hz (lines,) and response (lines, outputs, "
                             "inputs), complex")  # fmt: skip
        response = np.asarray(file["response"][()], dtype=np.complex128)
        inputs, outputs = (
            [one.decode() if isinstance(one, bytes) else str(one) for one in file.attrs.get(key, ())]
            for key in ("inputs", "outputs")
        )
        return Frf.of(np.asarray(file["frequency_hz"][()], dtype=np.float64), response, inputs, outputs)


def read_frf(path: str | Path, *more: str | Path) -> Frf:
    """Frequency responses of .uff, .unv, .csv or .h5; several .uff or .csv files are set-ups of one structure, joined.

    UFF: every data set 58 or 58b of a frequency response; channels are named by node and direction ("12z"). CSV: a
    column frequency_hz, then "OUT/IN:re" and "OUT/IN:im" (or ":db" or ":mag" and ":deg"; ":coh"). Lines without
    coherence are NaN. HDF5: frequency_hz (F,), response (F, n_y, n_u) complex,
    attributes inputs and outputs. InputError names the file and what is wrong with it.
    """
    kinds = {_ending(one) in _HDF5 for one in (path, *more)}
    if kinds == {False}:
        return _read_tables([path, *more])
    if more:
        raise InputError(f"{path}: set-ups are joined from .uff and .csv files, expected no HDF5 among several")
    return _read_hdf5(path)


def _place(name: str, k: int) -> tuple[int, int]:
    """Node and direction of "12z" and "-3x"; of other names the number of the channel and none."""
    for way in sorted(_WAYS, key=len, reverse=True):
        number = name.lstrip("-").removesuffix(way)
        if name.endswith(way) and number.isdigit():
            return int(number), -_WAYS[way] if name.startswith("-") else _WAYS[way]
    return k, 0


def write_frf(path: str | Path, frf: Frf, *, binary: bool = True, sensing: str = "acceleration") -> None:
    """Write frequency responses as .uff, .unv, .csv or .h5, as read_frf() reads them.

    sensing: what the outputs are (UFF); binary: 58b, else 58 with 12 digits.
    """
    ending = _ending(path)
    inputs, outputs = frf.names()
    if ending in _HDF5:
        h5py = library("h5py", "HDF5")
        with writing(path) as part, h5py.File(part, "w") as file:
            file["frequency_hz"], file["response"] = frf.frequency_hz, frf.response
            file.attrs["inputs"], file.attrs["outputs"] = inputs, outputs
        return
    pairs = [(o, i) for i in range(len(inputs)) for o in range(len(outputs))]
    if ending == ".csv":
        head = ["frequency_hz"] + [f"{outputs[o]}/{inputs[i]}:{part}" for o, i in pairs for part in ("re", "im")]
        columns = [frf.frequency_hz] + [getattr(frf.response[:, o, i], p) for o, i in pairs for p in ("real", "imag")]
        rows = "".join(",".join(map(repr, row)) + "\n" for row in np.column_stack(columns).tolist())
        with whole_file(path) as part:
            part.write_text(",".join(f'"{name}"' for name in head) + "\n" + rows, encoding="utf-8")
        return
    if sensing not in _UNITS:
        raise InputError(f"sensing is {sensing!r}, expected {', '.join(_UNITS)}")
    step = float(frf.frequency_hz[1] - frf.frequency_hz[0])
    with whole_file(path) as part, part.open("wb") as out:
        for o, i in pairs:
            one = UffFunction(
                f"{outputs[o]} / {inputs[i]}", FRF, frf.response[:, o, i], float(frf.frequency_hz[0]), step, None,
                _UNITS[sensing], "N", _place(outputs[o], o + 1), _place(inputs[i], i + 1), known={"df_hz": step},
            )  # fmt: skip
            out.write(function_bytes(one, ROLE_CODES[sensing], 13, binary))
