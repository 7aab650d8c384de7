# SPDX-License-Identifier: MIT
"""The square-root accumulator of libokid: the triangular factor of the regression rows instead of their Gram matrix."""

from __future__ import annotations

import ctypes
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from okid import _abi
from okid._errors import InputError
from okid.accumulator import Stats

_DETREND = {"none": _abi.DETREND_NONE, "mean": _abi.DETREND_MEAN}


class Observer(NamedTuple):
    """Observer Markov parameters from a factor, and what the solve found: see okid_observer_info_t.

    `theta` (n_y, q) = [D, Ybar_1 .. Ybar_p] with Ybar_h = [Ybar^I_h, -Ybar^II_h]; `innovation` (n_y, n_y).
    """

    theta: NDArray[np.float64]
    innovation: NDArray[np.float64]
    ridge: float
    radius: float
    radius_plain: float
    condition: float
    input_excitation: float


class SquareRoot:
    """Block QR of the regression rows [u_n, v_(n-1), .., v_(n-p), y_n]: the condition of the data is not squared.

    Slower than an Accumulator by q/m, for records of very light damping without noise and as the second opinion.
    Takes real numbers and ADC codes alike; a sample with a NaN or infinite channel counts as missing.

    Parameters: `n_u` inputs, `n_y` outputs, `lags` p; `batch` rows absorbed at once (0 = the default); `block`,
    `slots`, `spare_slots` and `forgetting` as for an Accumulator. Raises InputError for sizes out of range.
    Source: lib/include/okid/square_root.h, paper eq. 36-39.
    """

    def __init__(
        self,
        n_u: int,
        n_y: int,
        lags: int,
        *,
        batch: int = 0,
        block: int = 0,
        slots: int = 0,
        spare_slots: int = 0,
        forgetting: float = 1.0,
    ) -> None:
        self._config = _abi.SquareRootConfig(n_u, n_y, lags, batch, block, slots, spare_slots, forgetting)
        size = int(_abi.library().okid_square_root_memsize(ctypes.byref(self._config)))
        if size == 0:
            raise InputError(
                f"no square-root accumulator for n_u={n_u}, n_y={n_y}, lags={lags}, batch={batch}, block={block}, "
                f"slots={slots}, forgetting={forgetting}: see okid/square_root.h for the ranges",
                _abi.ERR_DIM,
            )
        self._block = _abi.block(size)
        self._handle = ctypes.c_void_p()
        status = _abi.library().okid_square_root_create(
            ctypes.byref(self._handle), ctypes.byref(self._config), self._block.ctypes.data, size
        )
        _abi.check(status, "square-root accumulator")

    @property
    def handle(self) -> ctypes.c_void_p:
        """okid_square_root_t* for calls into the C library."""
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
        return int(self._block.size)

    def add(self, samples: ArrayLike) -> int:
        """Absorb samples (N, m), inputs first; int16 and int32 arrays are ADC codes, anything else real numbers.

        Returns the status of the library: 0, or a warning > 0 (missing samples, saturated codes).
        Raises InputError for a wrong shape or type; the state is then unchanged. The array is never modified.
        """
        given = np.asarray(samples)
        if given.ndim == 1 and self.channels == 1:
            given = given[:, None]
        if given.ndim != 2 or given.shape[1] != self.channels:
            raise InputError(f"samples have shape {given.shape}, expected (N, {self.channels}): inputs, then outputs")
        if given.dtype.kind not in "fiub":
            raise InputError(f"samples are {given.dtype}, expected real numbers")
        library = _abi.library()
        if given.dtype == np.int16:
            words = np.ascontiguousarray(given)
            status = library.okid_square_root_add_i16(self._handle, words.ctypes.data_as(_abi.int16s), len(words))
        elif given.dtype == np.int32:
            wide = np.ascontiguousarray(given)
            status = library.okid_square_root_add_i32(self._handle, wide.ctypes.data_as(_abi.int32s), len(wide))
        elif given.dtype == np.float32:
            single = np.ascontiguousarray(given)
            status = library.okid_square_root_add_f32(self._handle, single.ctypes.data_as(_abi.floats), len(single))
        else:
            real = np.ascontiguousarray(given, dtype=np.float64)
            status = library.okid_square_root_add(self._handle, _abi.pointer(real), len(real))
        return _abi.check(status, "add")

    def gap(self, count: int = 0) -> None:
        """Mark `count` missing samples; 0 separates two records."""
        _abi.library().okid_square_root_gap(self._handle, count)

    def merge(self, other: SquareRoot) -> None:
        """Stack the factor of `other` as further records. InputError when the two do not fit each other."""
        _abi.check(_abi.library().okid_square_root_merge(self._handle, other._handle), "merge")

    def reset(self) -> None:
        """Forget everything but the units."""
        _abi.library().okid_square_root_reset(self._handle)

    def set_units(self, scale: ArrayLike, offset: ArrayLike | None = None) -> None:
        """value = scale * sample + offset for each of the m channels, applied when a result is made."""
        factors = np.array(np.broadcast_to(np.asarray(scale, np.float64), (self.channels,)))
        shift = None if offset is None else np.array(np.broadcast_to(np.asarray(offset, np.float64), (self.channels,)))
        _abi.library().okid_square_root_set_units(self._handle, _abi.pointer(factors), _abi.pointer(shift))

    @property
    def stats(self) -> Stats:
        """Counts since the start or the last reset."""
        raw = _abi.AccumulatorStats()
        _abi.library().okid_square_root_stats(self._handle, ctypes.byref(raw))
        return Stats(*(int(getattr(raw, name)) for name in Stats._fields))

    @property
    def rows(self) -> int:
        """Regression rows now in the factor."""
        return int(_abi.library().okid_square_root_rows(self._handle))

    def _result(self, function: Any, what: str, detrend: str) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        if detrend not in _DETREND:
            raise InputError(f"detrend is {detrend!r}, expected 'mean' or 'none'")
        size = self.channels * (self.lags + 1)
        out, mean = np.empty((size, size)), np.empty(self.channels)
        _abi.check(function(self._handle, _DETREND[detrend], _abi.pointer(out), _abi.pointer(mean)), what)
        return out, mean

    def gram(self, detrend: str = "mean") -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Gram matrix (m(p+1), m(p+1)) of [v_n; v_(n-1); ..; v_(n-p)] in engineering units, and the m channel means.

        `detrend` "mean" centres every lag row by its own mean, "none" leaves it.
        Raises IdentificationError when there are no rows yet.
        """
        return self._result(_abi.library().okid_square_root_gram, "gram", detrend)

    def factor(self, detrend: str = "mean") -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Upper triangular R (m(p+1), m(p+1)), diagonal >= 0, of rows [u_n, v_(n-1) .. v_(n-p), y_n], and the m means.

        Raises IdentificationError when there are no rows yet.
        """
        lower, mean = self._result(_abi.library().okid_square_root_factor, "factor", detrend)
        return lower.T, mean

    def observer(self, detrend: str = "mean", *, ridge_min: float = 0.0, stabilise: bool = True) -> Observer:
        """Observer Markov parameters from the factor; `stabilise` False leaves an unstable ARX model as it is.

        Raises IdentificationError when the data do not determine them (too short, constant channel, repeated inputs).
        """
        library = _abi.library()
        config = _abi.ObserverConfig(self.n_u, self.n_y, self.lags, ridge_min, int(not stabilise))
        work = _abi.block(int(library.okid_observer_factor_memsize(ctypes.byref(config))))
        factor = np.ascontiguousarray(self.factor(detrend)[0].T)
        theta = np.empty((self.n_u + self.lags * self.channels, self.n_y))
        innovation, info = np.empty((self.n_y, self.n_y)), _abi.ObserverInfo()
        status = library.okid_observer_solve_factor(
            ctypes.byref(config), _abi.pointer(factor), self.rows, _abi.pointer(theta), _abi.pointer(innovation),
            ctypes.byref(info), work.ctypes.data, work.size,
        )  # fmt: skip
        _abi.check(status, "observer")
        return Observer(theta.T, innovation, *(float(getattr(info, name)) for name in Observer._fields[2:]))

    def snapshot(self) -> bytes:
        """The whole state as bytes: what memcpy would copy."""
        return self._block.tobytes()

    def restore(self, snapshot: bytes) -> None:
        """Go back to a snapshot() of the same configuration. InputError when the size differs."""
        if len(snapshot) != self._block.size:
            raise InputError(f"the snapshot has {len(snapshot)} bytes, this accumulator {self._block.size}")
        self._block[:] = np.frombuffer(snapshot, dtype=np.uint8)
