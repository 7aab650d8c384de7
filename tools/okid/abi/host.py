# SPDX-License-Identifier: MIT
"""libokid_host, loaded: everything between the kernels and a user, the same code as the program's. It is looked for in
$OKID_HOST_LIBRARY, beside this package, and in <repository>/build. Source: firmware_host/include/okid_host.h.
"""

from __future__ import annotations

import ctypes
import json
import os
from functools import lru_cache
from pathlib import Path
from typing import Any

from okid._errors import Error, IdentificationError, InputError

_text, _handle, _status, _size = ctypes.c_char_p, ctypes.c_void_p, ctypes.c_int32, ctypes.c_size_t
SIGNATURES: dict[str, tuple[Any, list[Any]]] = {
    "okid_host_abi": (_status, []),
    "okid_host_error": (_text, []),
    "okid_host_config_load": (_status, [_text, _text, ctypes.POINTER(_handle)]),
    "okid_host_config_json": (_text, [_handle]),
    "okid_host_config_delete": (None, [_handle]),
    "okid_host_capture_defaults": (None, [_handle]),
    "okid_host_capture_create": (_status, [_handle, _handle, ctypes.POINTER(_handle)]),
    "okid_host_capture_delete": (None, [_handle]),
    "okid_host_capture_frames": (_status, [_handle, _handle, _size]),
    "okid_host_capture_bytes": (_status, [_handle, _size, ctypes.c_char_p, _size, ctypes.c_int64]),
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
}
ABI = 1
_ERRORS: dict[int, type[Error]] = {2: InputError, 3: IdentificationError}


def candidates() -> list[Path]:
    """Where the shared object may be, in the order of trust."""
    given = os.environ.get("OKID_HOST_LIBRARY")
    if given:
        return [Path(given)]
    here = Path(__file__).resolve().parents[1]
    return [here / "libokid_host.so", here.parents[1] / "build" / "libokid_host.so"]


@lru_cache(maxsize=1)
def library() -> Any:
    """The loaded shared object with typed functions. OSError names every place that was tried."""
    tried = candidates()
    path = next((one for one in tried if one.is_file()), None)
    if path is None:
        places = ", ".join(map(str, tried))
        raise OSError(f"libokid_host.so not found in {places}: run `make build`, or set OKID_HOST_LIBRARY to the file")
    loaded = ctypes.CDLL(str(path))
    for name, (result, arguments) in SIGNATURES.items():
        function = getattr(loaded, name)
        function.restype, function.argtypes = result, arguments
    if loaded.okid_host_abi() != ABI:
        raise OSError(f"{path}: its interface is number {loaded.okid_host_abi()}, this package needs {ABI}")
    return loaded


def call(name: str, *arguments: Any) -> int:
    """`okid_host_NAME(...)`. Raises InputError (exit code 2), IdentificationError (3) or Error with its sentence."""
    status: int = getattr(library(), f"okid_host_{name}")(*arguments)
    if status == 0:
        return 0
    text: bytes = library().okid_host_error()
    raise _ERRORS.get(status, Error)(text.decode("utf-8", "replace"), status)


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
