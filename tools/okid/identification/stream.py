# SPDX-License-Identifier: MIT
"""A running stream of the host library: rows of samples in, updates and results out. Source: okid_host/stream.h."""

from __future__ import annotations

import ctypes
import json
import os
import weakref
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from okid._errors import Error, InputError
from okid.abi import host
from okid.abi.arguments import behind_head, unmasked
from okid.abi.turns import Turn, in_turn
from okid.identification.host_result import HostResult, options_text

_KINDS = {np.dtype(np.float64): 0, np.dtype(np.float32): 1, np.dtype(np.int16): 2, np.dtype(np.int32): 3}
_Place = ctypes.c_char * 0  # the address of a writable, C-contiguous buffer, faster than ndarray.ctypes


def behind_refinement(state: bytes) -> bytes:
    """A state without head and without the sums of its refinement: what okid.Accumulator.to_bytes() gives."""
    state = behind_head(state)
    return state[int.from_bytes(state[8:16], "little") :] if state.startswith(b"OKIDREF\n") else state


class Counts(ctypes.Structure):
    """okid_host_stream_counts_t."""

    _fields_ = tuple((name, ctypes.c_int64) for name in (
        "samples", "missing", "gaps", "saturated", "rows", "dropped", "restarts", "bytes", "unknowns", "settled"
    ))  # fmt: skip


class _Owner:
    """Keeps an okid_host_stream_t as long as anyone looks into it."""

    def __init__(self, handle: ctypes.c_void_p) -> None:
        self.handle, self._turn = handle, Turn()
        weakref.finalize(self, host.library().okid_host_stream_delete, handle).atexit = False


def _load_config(path: str | Path) -> ctypes.c_void_p:
    made = ctypes.c_void_p()
    host.call("config_load", os.fsencode(path), None, ctypes.byref(made))
    return made


class HostStream:
    """An okid_host_stream_t, which threads take in turns. `options`: those of okid_host_stream_create(); `config`: a
    CONFIG.toml they change."""

    def __init__(self, options: Mapping[str, Any], config: str | Path | None = None) -> None:
        handle, base = ctypes.c_void_p(), None if config is None else _load_config(config)
        try:
            host.call("stream_create", options_text(options), base, ctypes.byref(handle))
        finally:
            if base is not None:
                host.library().okid_host_config_delete(base)
        self._owner: _Owner | None = _Owner(handle)
        self._turn = self._owner._turn
        self._add = host.library().okid_host_stream_add
        self._at = handle.value
        self.options: dict[str, Any] = json.loads(host.library().okid_host_stream_json(handle))
        self.channels = len(self.options["inputs"]) + len(self.options["outputs"])

    @property
    def handle(self) -> ctypes.c_void_p:
        """For calls into the library. Error when it is closed."""
        return self._check_open().handle

    def _check_open(self) -> _Owner:
        if self._owner is None:
            raise Error("this session is closed")
        return self._owner

    @in_turn
    def close(self) -> None:
        """Give the memory back, behind a call that another thread is in, as soon as no result looks into it; any later
        use raises Error."""
        self._owner = self._at = None

    def add(self, samples: ArrayLike) -> int:
        """Rows (N, m), inputs first. The status of the library: 0, or a warning > 0."""
        if type(samples) is np.ndarray and samples.ndim == 2 and samples.shape[1] == self.channels:
            kind = _KINDS.get(samples.dtype)
            if kind is not None:
                try:  # as it stands, some 1.5 us a call beside the work
                    place = _Place.from_buffer(samples)  # type: ignore[arg-type]  # ndarray says so from 3.12 on
                except (TypeError, ValueError, BufferError):  # read-only, or not C-contiguous
                    pass
                else:
                    with self._turn:
                        self._check_open()
                        status: int = self._add(self._at, kind, place, samples.shape[0])
                    return status if status >= 0 else self._refused(status)
        return self._add_copy(unmasked(samples))

    def _add_copy(self, given: NDArray[Any]) -> int:
        if given.ndim == 1 and self.channels == 1:
            given = given[:, None]
        if given.ndim != 2 or given.shape[1] != self.channels:
            raise InputError(f"samples have shape {given.shape}, expected (N, {self.channels}): inputs, then outputs")
        if given.dtype not in _KINDS or (given.dtype.kind == "i" and not self.options["codes"]):
            if given.dtype.kind not in "fiub":
                raise InputError(f"samples are {given.dtype}, expected real numbers")
            given = given.astype(np.float64)
        rows = np.ascontiguousarray(given)
        with self._turn:
            status = int(self._add(self.handle, _KINDS[rows.dtype], rows.ctypes.data, len(rows)))
        return status if status >= 0 else self._refused(status)

    def _refused(self, status: int) -> int:
        raise host.error(-status)

    @in_turn
    def gap(self, count: int) -> None:
        """`count` samples are missing."""
        host.call("stream_gap", self.handle, count)

    @in_turn
    def reset(self) -> None:
        """Forget all samples."""
        host.library().okid_host_stream_reset(self.handle)

    @in_turn
    def counts(self) -> Counts:
        """By now."""
        out = Counts()
        host.call("stream_stats", self.handle, ctypes.byref(out))
        return out

    @in_turn
    def _result(self, verb: str) -> HostResult | None:
        made = ctypes.c_void_p()
        host.call(f"stream_{verb}", self.handle, ctypes.byref(made))
        return HostResult(made, self._owner) if made.value else None

    def update(self) -> HostResult | None:
        """The modes by now; None: there is no model yet."""
        return self._result("update")

    def identify(self) -> HostResult:
        """Everything the samples tell by now. Raises IdentificationError."""
        found = self._result("identify")
        assert found is not None
        return found

    @in_turn
    def state(self) -> bytes:
        """The sums, for restore() and merge(): what okid.Accumulator.to_bytes() gives, behind a head with rate and
        channels and the sums of a refinement."""
        at, size = ctypes.c_void_p(), ctypes.c_size_t()
        host.call("stream_state", self.handle, ctypes.byref(at), ctypes.byref(size))
        return ctypes.string_at(at, size.value)

    @in_turn
    def restore(self, state: bytes) -> None:
        """Go on where a state stood. InputError when it does not fit, or is damaged."""
        host.call("stream_restore", self.handle, state, len(state))

    @in_turn
    def merge(self, state: bytes) -> None:
        """Add the samples of a state as further records, and one block for ±."""
        host.call("stream_merge", self.handle, state, len(state))
