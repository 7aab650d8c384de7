# SPDX-License-Identifier: MIT
"""The recursive accumulator of libokid in a block of memory that NumPy owns."""

from __future__ import annotations

import ctypes
from types import TracebackType
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from okid import _abi
from okid._errors import Error, InputError

_SAMPLE = {0: _abi.SAMPLE_DOUBLE, 16: _abi.SAMPLE_INT16, 24: _abi.SAMPLE_INT24, 32: _abi.SAMPLE_INT32}
_DETREND = {"none": _abi.DETREND_NONE, "mean": _abi.DETREND_MEAN}


class Stats(NamedTuple):
    """Counts since the start: see okid_accumulator_stats_t."""

    samples: int
    missing: int
    gaps: int
    saturated: int
    rows: int
    dropped: int


class Accumulator:
    """Sums of lagged products of the samples v = [u, y], all that identification needs of a record.

    A sample with a NaN or infinite channel counts as missing: it ends the run, the next run re-arms by itself.

    Parameters: `n_u` inputs, `n_y` outputs, `lags` p; `codes` 16, 24 or 32 takes ADC codes of so many bits (int16, or
    int32 words) and sums them exactly, 0 takes real numbers; `block` and `slots` make a sliding window of
    slots * block sample periods (`spare_slots` more where gaps close slots early); `forgetting` lambda per sample
    (needs `block`); `edges` False saves memory for one unbroken run; `bulk` lets long calls of 16-bit codes go through
    an FFT where that is faster, with the same bits; `saturated` "keep" takes codes at full scale as they are, "missing"
    makes their sample missing (both count them); `buffer` samples wait for the kernel (0 = 256).
    Raises InputError for sizes outside the documented range.
    Source: lib/include/okid/accumulator.h, paper eq. 36-38.
    """

    def __init__(
        self,
        n_u: int,
        n_y: int,
        lags: int,
        *,
        codes: int = 0,
        block: int = 0,
        slots: int = 0,
        forgetting: float = 1.0,
        edges: bool = True,
        spare_slots: int = 0,
        bulk: bool = True,
        saturated: str = "keep",
        buffer: int = 0,
    ) -> None:
        if codes not in _SAMPLE:
            raise InputError(
                f"codes is {codes!r}, expected the bits of an ADC code: 16, 24 or 32, or 0 for real numbers"
            )
        if saturated not in ("keep", "missing"):
            raise InputError(f"saturated is {saturated!r}, expected 'keep' or 'missing'")
        self._config = _abi.AccumulatorConfig(
            n_u, n_y, lags, _SAMPLE[codes], block, slots, forgetting, int(edges), spare_slots,
            int(bulk and codes == 16 and block == 0), int(saturated == "missing"), buffer,
        )  # fmt: skip
        size = int(_abi.library().okid_accumulator_memsize(ctypes.byref(self._config)))
        if size == 0:
            raise InputError(
                f"no accumulator for n_u={n_u}, n_y={n_y}, lags={lags}, block={block}, slots={slots}, "
                f"forgetting={forgetting}, edges={edges}, buffer={buffer}: see okid/accumulator.h for the ranges",
                _abi.ERR_DIM,
            )
        self._block: NDArray[np.uint8] | None = _abi.block(size)
        self._handle = self._create(self._block)

    def _create(self, memory: NDArray[np.uint8]) -> ctypes.c_void_p:
        handle = ctypes.c_void_p()
        status = _abi.library().okid_accumulator_create(
            ctypes.byref(handle), ctypes.byref(self._config), memory.ctypes.data, memory.size
        )
        _abi.check(status, "accumulator")
        return handle

    def __enter__(self) -> Accumulator:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, value: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def close(self) -> None:
        """Give the memory back; any later use raises Error."""
        self._block = None

    @property
    def handle(self) -> ctypes.c_void_p:
        """okid_accumulator_t* for calls into the C library; valid until close()."""
        self._memory()
        return self._handle

    def _memory(self) -> NDArray[np.uint8]:
        if self._block is None:
            raise Error("this accumulator is closed")
        return self._block

    @property
    def channels(self) -> int:
        """m = n_u + n_y."""
        return int(self._config.n_u + self._config.n_y)

    @property
    def n_u(self) -> int:
        """Inputs."""
        return int(self._config.n_u)

    @property
    def n_y(self) -> int:
        """Outputs."""
        return int(self._config.n_y)

    @property
    def lags(self) -> int:
        """p."""
        return int(self._config.lags)

    @property
    def codes(self) -> int:
        """Bits of the ADC codes it takes; 0 = real numbers."""
        return next(bits for bits, sample in _SAMPLE.items() if sample == self._config.sample)

    @property
    def nbytes(self) -> int:
        """Bytes of the state."""
        return 0 if self._block is None else int(self._block.size)

    def add(self, samples: ArrayLike) -> int:
        """Absorb samples (N, m), inputs first. Any real dtype; codes only as int16 (16 bits) or int32.

        Returns the status of the library: 0, or a warning > 0 (missing samples, saturated codes).
        Raises InputError for a wrong shape or type; the state is then unchanged. The array is never modified.
        """
        given = np.asarray(samples)
        if given.ndim == 1 and self.channels == 1:
            given = given[:, None]
        if given.ndim != 2 or given.shape[1] != self.channels:
            raise InputError(f"samples have shape {given.shape}, expected (N, {self.channels}): inputs, then outputs")
        if self.codes:
            wanted = np.dtype(np.int16 if self.codes == 16 else np.int32)
            if given.dtype != wanted:
                raise InputError(f"this accumulator takes {self.codes}-bit codes as {wanted}, got {given.dtype}")
            exact = np.ascontiguousarray(given)
            if self.codes == 16:
                words = exact.ctypes.data_as(_abi.int16s)
                status = _abi.library().okid_accumulator_add_i16(self.handle, words, len(exact))
            else:
                wide = exact.ctypes.data_as(_abi.int32s)
                status = _abi.library().okid_accumulator_add_i32(self.handle, wide, len(exact))
        else:
            if given.dtype.kind not in "fiub":
                raise InputError(f"samples are {given.dtype}, expected real numbers")
            if given.dtype == np.float32:
                single = np.ascontiguousarray(given)
                floats = single.ctypes.data_as(_abi.floats)
                status = _abi.library().okid_accumulator_add_f32(self.handle, floats, len(single))
            else:
                real = np.ascontiguousarray(given, dtype=np.float64)
                status = _abi.library().okid_accumulator_add(self.handle, _abi.pointer(real), len(real))
        return _abi.check(status, "add")

    def gap(self, count: int = 0) -> None:
        """Mark `count` missing samples; 0 separates two records."""
        _abi.library().okid_accumulator_gap(self.handle, count)

    def merge(self, other: Accumulator) -> None:
        """Add all of `other` as further records. InputError when the two do not fit each other."""
        _abi.check(_abi.library().okid_accumulator_merge(self.handle, other.handle), "merge")

    def centre(self) -> None:
        """Take the offsets out of a finished record before it is merged with others: each channel less its own mean.

        Takes no samples any more afterwards, only merges with accumulators that are centred too.
        Raises InputError with a window, forgetting or without edges.
        """
        _abi.check(_abi.library().okid_accumulator_centre(self.handle), "centre")

    def reset(self) -> None:
        """Forget everything but the units."""
        _abi.library().okid_accumulator_reset(self.handle)

    def set_units(self, scale: ArrayLike, offset: ArrayLike | None = None) -> None:
        """value = scale * code + offset for each of the m channels, applied when the Gram matrix is made."""
        factors = np.array(np.broadcast_to(np.asarray(scale, np.float64), (self.channels,)))
        shift = None if offset is None else np.array(np.broadcast_to(np.asarray(offset, np.float64), (self.channels,)))
        _abi.library().okid_accumulator_set_units(self.handle, _abi.pointer(factors), _abi.pointer(shift))

    @property
    def stats(self) -> Stats:
        """Counts since the start or the last reset."""
        raw = _abi.AccumulatorStats()
        _abi.library().okid_accumulator_stats(self.handle, ctypes.byref(raw))
        return Stats(*(int(getattr(raw, name)) for name in Stats._fields))

    @property
    def rows(self) -> int:
        """Regression rows now in the sums."""
        return int(_abi.library().okid_accumulator_rows(self.handle))

    def gram(self, detrend: str = "mean") -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Gram matrix (m(p+1), m(p+1)) of [v_n; v_(n-1); ..; v_(n-p)] in engineering units, and the m channel means.

        `detrend` "mean" centres every lag row by its own mean, "none" leaves it.
        Raises IdentificationError when there are no rows yet.
        """
        if detrend not in _DETREND:
            raise InputError(f"detrend is {detrend!r}, expected 'mean' or 'none'")
        size = self.channels * (self.lags + 1)
        gram = np.empty((size, size))
        mean = np.empty(self.channels)
        status = _abi.library().okid_accumulator_gram(
            self.handle, _DETREND[detrend], _abi.pointer(gram), _abi.pointer(mean)
        )
        _abi.check(status, "gram")
        return gram, mean

    def run_sums(self, detrend: str = "mean") -> tuple[NDArray[np.float64], ...]:
        """S (p+1, m, m), head (p, m), tail (p, m), sum (m) of one unbroken run: see okid_accumulator_run().

        Raises InputError when a gap has split the record, IdentificationError when there are no rows yet.
        """
        if detrend not in _DETREND:
            raise InputError(f"detrend is {detrend!r}, expected 'mean' or 'none'")
        m, p = self.channels, self.lags
        sums, head, tail, total = np.empty((p + 1, m, m)), np.empty((p, m)), np.empty((p, m)), np.empty(m)
        pointers = [_abi.pointer(array) for array in (sums, head, tail, total)]
        _abi.check(_abi.library().okid_accumulator_run(self.handle, _DETREND[detrend], *pointers, None), "run_sums")
        return sums.transpose(0, 2, 1), head, tail, total

    def to_bytes(self) -> bytes:
        """The whole state for a file or another machine: checked by a CRC, the same for every processor."""
        out = np.empty(int(_abi.library().okid_accumulator_serialised_size(self.handle)), np.uint8)
        _abi.check(_abi.library().okid_accumulator_serialise(self.handle, out.ctypes.data, out.size), "to_bytes")
        return out.tobytes()

    @staticmethod
    def from_bytes(data: bytes) -> Accumulator:
        """An accumulator that goes on where to_bytes() stood, bit for bit. InputError when the bytes are damaged."""
        config = _abi.AccumulatorConfig()
        _abi.check(_abi.library().okid_accumulator_peek(data, len(data), ctypes.byref(config)), "from_bytes")
        made = Accumulator(
            config.n_u, config.n_y, config.lags, codes=next(k for k, v in _SAMPLE.items() if v == config.sample),
            block=config.block, slots=config.slots, forgetting=config.forgetting, edges=bool(config.edges),
            spare_slots=config.spare_slots, saturated="missing" if config.saturated_missing else "keep",
        )  # fmt: skip
        made.restore(data)
        return made

    def restore(self, data: bytes) -> None:
        """Go back to a state of to_bytes() of an accumulator of the same configuration, else InputError."""
        _abi.check(_abi.library().okid_accumulator_deserialise(self.handle, data, len(data)), "restore")

    def _arguments(self) -> dict[str, Any]:
        c = self._config
        return {
            "n_u": c.n_u,
            "n_y": c.n_y,
            "lags": c.lags,
            "codes": self.codes,
            "block": c.block,
            "slots": c.slots,
            "forgetting": c.forgetting,
            "edges": bool(c.edges),
            "spare_slots": c.spare_slots,
            "bulk": bool(c.bulk),
            "saturated": "missing" if c.saturated_missing else "keep",
            "buffer": c.buffer,
        }

    def copy(self) -> Accumulator:
        """An independent accumulator with the same state."""
        twin = Accumulator(**self._arguments())
        twin.restore(self.to_bytes())
        return twin

    def __getstate__(self) -> dict[str, Any]:
        return {"arguments": self._arguments(), "state": self.to_bytes()}

    def __setstate__(self, state: dict[str, Any]) -> None:
        self.__init__(**state["arguments"])  # type: ignore[misc]
        self.restore(state["state"])
