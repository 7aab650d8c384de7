# SPDX-License-Identifier: MIT
"""What the two recursive kernels have in common: memory that NumPy owns, counts, units, gaps, merging, Gram matrix."""

from __future__ import annotations

import ctypes
from typing import Any, ClassVar, NamedTuple, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from okid import abi
from okid._errors import Error, InputError
from okid.abi.arguments import MOST_SAMPLES, unmasked, whole
from okid.abi.turns import Turn, both, in_turn
from okid.shown.notebook_html import own_fields

_ADD: dict[np.dtype[Any], str] = {  # what a C-contiguous array of samples goes to as it stands
    np.dtype(np.float64): "add",
    np.dtype(np.float32): "add_f32",
    np.dtype(np.int16): "add_i16",
    np.dtype(np.int32): "add_i32",
}
_Place = ctypes.c_char * 0  # the address of a writable, C-contiguous buffer, faster than ndarray.ctypes
_DETREND = {"none": abi.DETREND_NONE, "mean": abi.DETREND_MEAN}


class Stats(NamedTuple):
    """Counts since the start: see okid_accumulator_stats_t."""

    samples: int
    missing: int
    gaps: int
    saturated: int
    rows: int
    dropped: int

    def _repr_html_(self) -> str:
        return own_fields(self)


class Sums:
    """A kernel of the library in a block of memory; `kernel` is what its C functions begin with. Threads take turns."""

    kernel: ClassVar[str]

    def __init__(self, config: Any) -> None:
        self._config, self._turn = config, Turn()
        size = int(self._call("memsize", ctypes.byref(config)))
        if size == 0:
            given = ", ".join(f"{name}={getattr(config, name)}" for name, *_ in config._fields_)
            raise InputError(f"no {type(self).__name__} for {given}: see the headers for the ranges", abi.ERR_DIM)
        self._block: NDArray[np.uint8] | None = abi.block(size)
        self._handle = ctypes.c_void_p()
        place = (ctypes.byref(self._handle), ctypes.byref(config), self._block.ctypes.data, self._block.size)
        abi.check(self._call("create", *place), type(self).__name__)
        self._direct = {kind: abi.direct(f"{self.kernel}_{verb}") for kind, verb in _ADD.items() if self._takes(kind)}
        self._width = self.channels

    def _takes(self, kind: np.dtype[Any]) -> bool:
        """Do samples of this type go in without a change?"""
        return True

    def _call(self, verb: str, *arguments: Any) -> Any:
        return getattr(abi.library(), f"{self.kernel}_{verb}")(*arguments)

    @in_turn
    def _use(self, verb: str, *arguments: Any) -> Any:
        """A call on the object itself. Error when it is closed."""
        return self._call(verb, self.handle, *arguments)

    def _use_both(self, verb: str, other: Sums, *arguments: Any) -> Any:
        """A call on two objects."""
        with both(self._turn, other._turn):
            return self._call(verb, self.handle, other.handle, *arguments)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    @in_turn
    def close(self) -> None:
        """Give the memory back, behind a call that another thread is in; any later use raises Error."""
        self._block = None

    def _memory(self) -> NDArray[np.uint8]:
        if self._block is None:
            raise Error("this accumulator is closed")
        return self._block

    @property
    def handle(self) -> ctypes.c_void_p:
        """The object for calls into the C library; valid until close(). Calls of your own on it take no turns."""
        self._memory()
        return self._handle

    @property
    def n_u(self) -> int:
        """Inputs."""
        return int(self._config.n_u)

    @property
    def n_y(self) -> int:
        """Outputs."""
        return int(self._config.n_y)

    @property
    def channels(self) -> int:
        """m = n_u + n_y."""
        return self.n_u + self.n_y

    @property
    def lags(self) -> int:
        """p."""
        return int(self._config.lags)

    @property
    def nbytes(self) -> int:
        """Bytes of the state."""
        return 0 if self._block is None else int(self._block.size)

    def _add_direct(self, samples: ArrayLike) -> int | None:
        """The status of the library for an array that can go in as it stands (some 1.5 us a call beside the work), else
        None: it has to be looked at, or copied."""
        if type(samples) is not np.ndarray or samples.ndim != 2 or samples.shape[1] != self._width:
            return None
        call = self._direct.get(samples.dtype)
        if call is None:
            return None
        try:
            place = _Place.from_buffer(samples)  # type: ignore[arg-type]  # ndarray says so from Python 3.12 on
        except (TypeError, ValueError, BufferError):  # read-only, or not C-contiguous
            return None
        with self._turn:
            self._memory()
            status: int = call(self._handle, place, samples.shape[0])
        return status if status >= 0 else abi.check(status, "add")

    def _samples(self, samples: ArrayLike) -> NDArray[Any]:
        """The array as (N, m), else InputError."""
        given = unmasked(samples)
        if given.ndim == 1 and self.channels == 1:
            given = given[:, None]
        if given.ndim != 2 or given.shape[1] != self.channels:
            raise InputError(f"samples have shape {given.shape}, expected (N, {self.channels}): inputs, then outputs")
        return given

    def _add_real(self, given: NDArray[Any]) -> int:
        if given.dtype.kind not in "fiub":
            raise InputError(f"samples are {given.dtype}, expected real numbers")
        if given.dtype == np.float32:
            single = np.ascontiguousarray(given)
            return int(self._use("add_f32", single.ctypes.data_as(abi.floats), len(single)))
        real = np.ascontiguousarray(given, dtype=np.float64)
        return int(self._use("add", abi.pointer(real), len(real)))

    def _add_codes(self, given: NDArray[Any]) -> int:
        exact = np.ascontiguousarray(given)
        if given.dtype == np.int16:
            return int(self._use("add_i16", exact.ctypes.data_as(abi.int16s), len(exact)))
        return int(self._use("add_i32", exact.ctypes.data_as(abi.int32s), len(exact)))

    def gap(self, count: int = 0) -> None:
        """Mark `count` missing samples; 0 separates two records."""
        self._use("gap", whole("count", count, 0, MOST_SAMPLES))

    def merge(self, other: Self) -> None:
        """Add all of `other` as further records. InputError when the two do not fit each other."""
        abi.check(self._use_both("merge", other), "merge")

    def reset(self) -> None:
        """Forget everything but the units."""
        self._use("reset")

    def set_units(self, scale: ArrayLike, offset: ArrayLike | None = None) -> None:
        """value = scale * code + offset for each of the m channels, applied when a result is made."""
        factors, shift = self._each("scale", scale), None if offset is None else self._each("offset", offset)
        if np.any(factors == 0.0):
            raise InputError(f"scale is {scale!r}: a channel times 0 measures nothing")
        self._use("set_units", abi.pointer(factors), abi.pointer(shift))

    def _each(self, name: str, given: ArrayLike) -> NDArray[np.float64]:
        """One finite number for all channels, or one for each."""
        try:
            out = np.array(np.broadcast_to(np.asarray(given, np.float64), (self.channels,)))
        except (TypeError, ValueError):
            out = np.full(1, np.nan)
        if not np.all(np.isfinite(out)):
            raise InputError(f"{name} is {given!r}, expected a number, or one for each of the {self.channels} channels")
        return out

    @property
    def stats(self) -> Stats:
        """Counts since the start or the last reset."""
        raw = abi.AccumulatorStats()
        self._use("stats", ctypes.byref(raw))
        return Stats(*(int(getattr(raw, name)) for name in Stats._fields))

    @property
    def rows(self) -> int:
        """Regression rows now in the sums."""
        return int(self._use("rows"))

    def _detrend(self, name: str) -> int:
        if name not in _DETREND:
            raise InputError(f"detrend is {name!r}, expected 'mean' or 'none'")
        return _DETREND[name]

    def _matrix(self, verb: str, detrend: str) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        size = self.channels * (self.lags + 1)
        out, mean = np.empty((size, size)), np.empty(self.channels)
        mode = self._detrend(detrend)
        abi.check(self._use(verb, mode, abi.pointer(out), abi.pointer(mean)), verb)
        return out, mean

    def gram(self, detrend: str = "mean") -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Gram matrix (m(p+1), m(p+1)) of [v_n; v_(n-1); ..; v_(n-p)] in engineering units, and the m channel means.

        `detrend` "mean" centres every lag row by its own mean, "none" leaves it.
        Raises IdentificationError when there are no rows yet.
        """
        return self._matrix("gram", detrend)
