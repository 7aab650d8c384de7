# SPDX-License-Identifier: MIT
"""libokid_host, loaded: everything between the kernels and a user, the same code as the program's. It is looked for in
$OKID_HOST_LIBRARY, beside this package, and in <repository>/build. Source: firmware_host/include/okid_host.h.
"""

from __future__ import annotations

import ctypes
import json
import os
import weakref
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from okid._errors import Error, IdentificationError, InputError
from okid.abi.shared_object import load
from okid.abi.turns import Inside

_text, _handle, _status, _size = ctypes.c_char_p, ctypes.c_void_p, ctypes.c_int32, ctypes.c_size_t
_out, _sizes = ctypes.POINTER(ctypes.c_void_p), ctypes.POINTER(ctypes.c_size_t)


class Array(ctypes.Structure):
    """okid_host_array_t."""

    _fields_ = (("data", _handle), ("rank", _status), ("size", _size * 3), ("stride", _size * 3))


class Decomposition(ctypes.Structure):
    """okid_host_decomposition_t."""

    _fields_ = (("identifier", _handle), ("config", _handle), ("model", _handle))


class Columns(ctypes.Structure):
    """okid_host_columns_t."""

    _fields_ = (
        ("data", _handle), ("type", _status), ("channels", _size), ("row_stride", ctypes.c_ssize_t),
        ("channel_stride", ctypes.c_ssize_t),
    )  # fmt: skip


SIGNATURES: dict[str, tuple[Any, list[Any]]] = {
    "okid_host_abi": (_status, []),
    "okid_host_error": (_text, []),
    "okid_host_error_status": (_status, []),
    "okid_host_identify": (_status, [_text, _status, _out, _sizes, ctypes.POINTER(_text), _handle, _handle, _out]),
    "okid_host_identify_columns": (_status, [_text, _status, *[_handle] * 7]),
    "okid_host_identify_set_ups": (_status, [_text, _status, *[_handle] * 4, _out]),
    "okid_host_identify_responses": (_status, [_text, _size, _handle, _handle, _out]),
    "okid_host_responses_read": (_status, [ctypes.POINTER(_text), _status, _out]),
    "okid_host_responses_json": (_text, [_handle]),
    "okid_host_responses_data": (_size, [_handle, _out, _out]),
    "okid_host_responses_delete": (None, [_handle]),
    "okid_host_virtual_create": (_status, [_text, _out]),
    "okid_host_virtual_copy": (_status, [_handle, _out]),
    "okid_host_virtual_learn": (_status, [_handle, _size, _handle]),
    "okid_host_virtual_run": (_status, [_handle, _size, *[_handle] * 5]),
    "okid_host_virtual_reset": (None, [_handle]),
    "okid_host_virtual_json": (_text, [_handle]),
    "okid_host_virtual_delete": (None, [_handle]),
    "okid_host_result_json": (_text, [_handle]),
    "okid_host_result_summary": (_text, [_handle]),
    "okid_host_result_brief": (_text, [_handle]),
    "okid_host_result_table": (_text, [_handle]),
    "okid_host_result_array": (_status, [_handle, _text, ctypes.POINTER(Array)]),
    "okid_host_result_decomposition": (_status, [_handle, ctypes.POINTER(Decomposition)]),
    "okid_host_result_delete": (None, [_handle]),
    "okid_host_compare": (_status, [*[_text] * 4, _out]),
    "okid_host_comparison_json": (_text, [_handle]),
    "okid_host_comparison_table": (_text, [_handle]),
    "okid_host_comparison_delete": (None, [_handle]),
    "okid_host_merge": (_status, [ctypes.POINTER(_text), ctypes.POINTER(_text), _status, _text, _out]),
    "okid_host_table": (_text, [_text, _text]),
    "okid_host_csv_read": (_status, [_text, _out]),
    "okid_host_csv_json": (_text, [_handle]),
    "okid_host_csv_samples": (ctypes.POINTER(ctypes.c_double), [_handle, _sizes, _sizes]),
    "okid_host_csv_delete": (None, [_handle]),
    "okid_host_unit_of_name": (_size, [_text, _handle, _size]),
    "okid_host_side_of_column": (_text, [_text]),
    "okid_host_unit": (_status, [_text, ctypes.POINTER(ctypes.c_double), ctypes.POINTER(_text)]),
    "okid_host_config_load": (_status, [_text, _text, ctypes.POINTER(_handle)]),
    "okid_host_config_json": (_text, [_handle]),
    "okid_host_config_delete": (None, [_handle]),
    "okid_host_capture_defaults": (None, [_handle]),
    "okid_host_capture_create": (_status, [_handle, _handle, ctypes.POINTER(_handle)]),
    "okid_host_capture_delete": (None, [_handle]),
    "okid_host_capture_frames": (_status, [_handle, _handle, _size]),
    "okid_host_capture_bytes": (_status, [_handle, _size, _handle, _size, ctypes.c_int64]),
    "okid_host_capture_link": (_status, [_handle, _size, _status]),
    "okid_host_capture_lost": (_status, [_handle, _size, ctypes.c_uint64, ctypes.c_uint64]),
    "okid_host_capture_edge": (_status, [_handle, ctypes.c_int64]),
    "okid_host_capture_serve": (_status, [_handle]),
    "okid_host_capture_open": (_status, [_handle, _text]),
    "okid_host_capture_play": (_status, [_handle, _size, ctypes.POINTER(_size)]),
    "okid_host_capture_done": (_status, [_handle]),
    "okid_host_capture_rows": (_status, [_handle, _status, _handle]),
    "okid_host_capture_events": (_text, [_handle]),
    "okid_host_capture_stats": (_text, [_handle]),
    "okid_host_capture_finish": (_status, [_handle]),
    "okid_host_packet_encode": (
        _size,
        [_status, _size, _size, ctypes.c_uint32, ctypes.c_uint32, _handle, _handle, _size],
    ),
    "okid_host_stream_create": (_status, [_text, _handle, _out]),
    "okid_host_stream_json": (_text, [_handle]),
    "okid_host_stream_add": (_status, [_handle, _status, _handle, ctypes.c_size_t]),
    "okid_host_stream_gap": (_status, [_handle, ctypes.c_int64]),
    "okid_host_stream_reset": (None, [_handle]),
    "okid_host_stream_stats": (_status, [_handle, _handle]),
    "okid_host_stream_update": (_status, [_handle, _out]),
    "okid_host_stream_identify": (_status, [_handle, _out]),
    "okid_host_stream_state": (_status, [_handle, _out, _sizes]),
    "okid_host_stream_restore": (_status, [_handle, _handle, _size]),
    "okid_host_stream_merge": (_status, [_handle, _handle, _size]),
    "okid_host_stream_delete": (None, [_handle]),
}
ABI = 1
_ERRORS: dict[int, type[Error]] = {2: InputError, 3: IdentificationError}


@lru_cache(maxsize=1)
def library() -> Any:
    """The loaded shared object with typed functions. OSError names every place that was tried."""
    loaded, path = load("libokid_host.so", "OKID_HOST_LIBRARY")
    for name, (result, arguments) in SIGNATURES.items():
        function = getattr(loaded, name)
        function.restype, function.argtypes = result, arguments
    if loaded.okid_host_abi() != ABI:
        raise OSError(f"{path}: its interface is number {loaded.okid_host_abi()}, this package needs {ABI}")
    return loaded


def error(code: int) -> Error:
    """What the last failed call said, as InputError (exit code 2), IdentificationError (3) or Error."""
    text: bytes = library().okid_host_error()
    return _ERRORS.get(code, Error)(text.decode("utf-8", "replace"), library().okid_host_error_status())


def call(name: str, *arguments: Any) -> int:
    """`okid_host_NAME(...)`. Raises error()."""
    with Inside():
        code: int = getattr(library(), f"okid_host_{name}")(*arguments)
    if code != 0:
        raise error(code)
    return code


def config(path: str | Path, text: str | None = None) -> dict[str, Any]:
    """A CONFIG.toml checked whole, as `okid check --json` shows it; `text`: what stands in it, else it is read.
    Raises InputError that names file, line and key."""
    made = ctypes.c_void_p()
    call("config_load", os.fsencode(path), None if text is None else text.encode(), ctypes.byref(made))
    try:
        out: dict[str, Any] = json.loads(library().okid_host_config_json(made))
        return out
    finally:
        library().okid_host_config_delete(made)


def csv(path: str | Path) -> tuple[dict[str, Any], NDArray[np.float64]]:
    """names, units, fs_hz, comments, rate_remark of a CSV record, and its samples (N, m). Raises InputError."""
    made, rows, columns = ctypes.c_void_p(), ctypes.c_size_t(), ctypes.c_size_t()
    call("csv_read", os.fsencode(path), ctypes.byref(made))
    data = library().okid_host_csv_samples(made, ctypes.byref(rows), ctypes.byref(columns))
    memory = ctypes.cast(data, ctypes.POINTER(ctypes.c_double * (rows.value * columns.value))).contents
    # The array stands in the memory of the record.
    weakref.finalize(memory, library().okid_host_csv_delete, made).atexit = False
    about: dict[str, Any] = json.loads(library().okid_host_csv_json(made))
    return about, np.ctypeslib.as_array(memory).reshape(rows.value, columns.value)


def table(result: bytes, name: bytes) -> str:
    """The modal table of an okid.result/1. Raises InputError that names the key."""
    text: bytes | None = library().okid_host_table(result, name)
    if text is None:
        raise error(2)
    return text.decode("utf-8", "replace")


def unit_of_name(name: str) -> str:
    """ "g" of "a [g]", "a (g)" and "a_g", else ""."""
    encoded = name.encode()
    text = ctypes.create_string_buffer(len(encoded) + 1)
    library().okid_host_unit_of_name(encoded, text, len(text))
    return text.value.decode()


def side_of_column(name: str) -> str:
    """ "inputs", "outputs" or "": what `okid identify` proposes for a column of that name."""
    found: bytes = library().okid_host_side_of_column(name.encode("utf-8", "replace"))
    return found.decode()


def unit(name: str) -> tuple[float, str] | None:
    """What makes a unit SI: "mm" is (0.001, "m"). None: it is not known."""
    factor, si = ctypes.c_double(), ctypes.c_char_p()
    if not library().okid_host_unit(name.encode(), ctypes.byref(factor), ctypes.byref(si)):
        return None
    return factor.value, (si.value or b"").decode()
