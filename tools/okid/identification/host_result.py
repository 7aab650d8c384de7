# SPDX-License-Identifier: MIT
"""Records in, a result of the host library out: its text, its arrays, its decomposition. Source: okid_host/record.h."""

from __future__ import annotations

import ctypes
import json
import math
import struct
from collections.abc import Callable, Mapping, Sequence
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from okid import abi
from okid._errors import Error, InputError
from okid.abi import host
from okid.abi.turns import Turn, in_turn
from okid.identification.identifier import Identifier

Real = NDArray[np.float64]


def _plain(value: Any) -> Any:
    """As JSON has it; what JSON cannot hold stays as text, so that the library says what is wrong with it."""
    if isinstance(value, np.ndarray | np.generic):
        value = value.tolist()
    if isinstance(value, float) and not math.isfinite(value):
        return str(value)
    if isinstance(value, Mapping):
        return {str(key): _plain(one) for key, one in value.items()}
    if isinstance(value, list | tuple | range):
        return [_plain(one) for one in value]
    return value if value is None or isinstance(value, bool | int | float | str) else repr(value)


_encode = json.JSONEncoder(allow_nan=False, check_circular=False).encode


def options_text(options: Mapping[str, Any]) -> bytes:
    """For the library; None is as if not given."""
    given = {key: value for key, value in options.items() if value is not None}
    try:
        text = _encode(given)
    except (TypeError, ValueError):
        text = json.dumps(_plain(given))
    if "\\ud" in text:
        try:
            json.dumps(json.loads(text), ensure_ascii=False).encode()
        except UnicodeEncodeError:
            raise InputError("an option or a name has half of a letter (a lone surrogate)") from None
    return text.encode()


class HostResult:
    """An okid_host_result_t, deleted with this object; `owner`: whose memory its decomposition is."""

    def __init__(self, handle: ctypes.c_void_p, owner: Any = None) -> None:
        self._turn: Turn = Turn() if owner is None else owner._turn  # its decomposition is the stream's own
        self.handle, self._owner, self._delete = handle, owner, host.library().okid_host_result_delete

    def __del__(self) -> None:
        self._delete(self.handle)

    @in_turn
    def _text(self, what: str) -> str:
        text: bytes | None = getattr(host.library(), f"okid_host_result_{what}")(self.handle)
        if text is None:
            raise Error(host.library().okid_host_error().decode("utf-8", "replace"))
        return text.decode("utf-8", "replace")

    def json(self) -> str:
        """okid.result/1, as `okid identify --json` writes it."""
        return self._text("json")

    def about(self, whole: bool = True) -> dict[str, Any]:
        """The same, parsed, without singular_values, model and markov; not `whole`: nor fit and warnings, which may
        have to be computed first."""
        out: dict[str, Any] = json.loads(self._text("summary" if whole else "brief"))
        return out

    def table(self) -> str:
        """What `okid identify` prints, options named as arguments."""
        return self._text("table")

    @in_turn
    def array(self, name: str) -> Real | None:
        """A copy of an array by its place in okid.result/1 ("model.A", "markov.Y" ..); None: there is none."""
        view = host.Array()
        if not host.library().okid_host_result_array(self.handle, name.encode(), ctypes.byref(view)):
            return None
        shape, strides = (tuple(numbers[: view.rank]) for numbers in (view.size, view.stride))
        if 0 in shape:
            return np.zeros(shape)
        count = 1 + sum((n - 1) * step for n, step in zip(shape, strides, strict=True))
        memory = (ctypes.c_char * (8 * count)).from_address(view.data)
        return np.array(np.ndarray(shape, np.float64, memory, 0, [8 * step for step in strides]), order="C")

    @in_turn
    def identifier(self) -> Identifier | None:
        """The decomposition, for models of other orders; it keeps this object alive. None: there is none."""
        raw = host.Decomposition()
        if not host.library().okid_host_result_decomposition(self.handle, ctypes.byref(raw)):
            return None
        config, model = abi.IdentifyConfig.from_address(raw.config), abi.Identified.from_address(raw.model)
        return Identifier.of_handle(raw.identifier, config, model, self)


TYPES = ("f8", "f4", "i2", "i4")  # numbers the library takes as they are, in the order of okid_host_columns_t


_TYPE_OF = {name: number for number, name in enumerate(TYPES)}
_columns_t = struct.Struct("PiNnn")  # okid_host_columns_t
assert _columns_t.size == ctypes.sizeof(host.Columns)


def _columns(arrays: Sequence[NDArray[Any]]) -> bytes:
    packed = b""
    for a in arrays:
        row, channel = a.strides
        packed += _columns_t.pack(a.ctypes.data, _TYPE_OF[a.dtype.str[1:]], a.shape[1], row, channel)
    return packed


@lru_cache(maxsize=8)
def _names(what: str, count: int) -> Any:
    return (ctypes.c_char_p * count)(*(f"{what} {k} (counted from 0)".encode() for k in range(count)))


def _records(inputs: Sequence[NDArray[Any]], outputs: Sequence[NDArray[Any]], what: str) -> tuple[Any, ...]:
    counts = struct.pack(f"{len(outputs)}N", *map(len, outputs))
    return len(outputs), _columns(inputs), _columns(outputs), counts, _names(what, len(outputs))


_stage_t = ctypes.CFUNCTYPE(None, ctypes.c_void_p, ctypes.c_char_p)  # okid_host_stage_t


def _calls(on_stage: Callable[[str], None]) -> Any:
    return _stage_t(lambda _context, text: on_stage(text.decode("utf-8", "replace")))


def identify(
    options: Mapping[str, Any], inputs: Sequence[NDArray[Any]], outputs: Sequence[NDArray[Any]],
    on_stage: Callable[[str], None] | None = None,
) -> HostResult:  # fmt: skip
    """`options` by the arguments of okid.identify(); of each record (N, n_u) and (N, n_y), one of TYPES. `on_stage` is
    called with what begins."""
    handle, arguments = ctypes.c_void_p(), _records(inputs, outputs, "record")
    report = None if on_stage is None else _calls(on_stage)
    host.call("identify_columns", options_text(options), *arguments, report, None, ctypes.byref(handle))
    return HostResult(handle)


def identify_set_ups(
    options: Mapping[str, Any], inputs: Sequence[NDArray[Any]], outputs: Sequence[NDArray[Any]]
) -> HostResult:
    """The same of set-ups, each with columns of its own; `outputs` of the options: the names of each in turn."""
    handle = ctypes.c_void_p()
    arguments = _records(inputs, outputs, "set-up")
    host.call("identify_set_ups", options_text(options), *arguments, ctypes.byref(handle))
    return HostResult(handle)
