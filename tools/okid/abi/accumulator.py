# SPDX-License-Identifier: MIT
"""The recursive accumulator of libokid in a block of memory that NumPy owns."""

from __future__ import annotations

import ctypes
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from okid import abi
from okid._errors import InputError
from okid.abi.arguments import behind_head, state_bytes, whole
from okid.abi.sums import Sums
from okid.abi.turns import in_turn

_SAMPLE = {0: abi.SAMPLE_DOUBLE, 16: abi.SAMPLE_INT16, 24: abi.SAMPLE_INT24, 32: abi.SAMPLE_INT32}


class Accumulator(Sums):
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

    Two halves of a record of ADC codes add to the sums of both, bit for bit, wherever they were made:

    >>> import numpy as np, okid
    >>> codes = np.random.default_rng(1).integers(-1000, 1000, (5000, 4), dtype=np.int16)
    >>> first, second = (okid.Accumulator(1, 3, 10, codes=16) for _ in range(2))
    >>> first.add(codes[:2000]), second.add(codes[2000:])
    (0, 0)
    >>> first.merge(second)
    >>> first.rows, first.gram()[0].shape
    (4980, (44, 44))
    """

    kernel = "okid_accumulator"

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
        for name, value in (("n_u", n_u), ("n_y", n_y), ("lags", lags)):
            whole(name, value, 0, 65536)
        config = abi.AccumulatorConfig(
            n_u, n_y, lags, _SAMPLE[codes], block, slots, forgetting, int(edges), spare_slots,
            int(bulk and codes == 16 and block == 0), int(saturated == "missing"), buffer,
        )  # fmt: skip
        super().__init__(config)

    @property
    def codes(self) -> int:
        """Bits of the ADC codes it takes; 0 = real numbers."""
        return next(bits for bits, sample in _SAMPLE.items() if sample == self._config.sample)

    def _takes(self, kind: np.dtype[Any]) -> bool:
        return (kind.kind == "f") if not self.codes else kind == np.dtype(np.int16 if self.codes == 16 else np.int32)

    def add(self, samples: ArrayLike) -> int:
        """Absorb samples (N, m), inputs first. Any real dtype; codes only as int16 (16 bits) or int32.

        Returns the status of the library: 0, or a warning > 0 (missing samples, saturated codes).
        Raises InputError for a wrong shape or type; the state is then unchanged. The array is never modified.
        """
        status = self._add_direct(samples)
        if status is not None:
            return status
        given = self._samples(samples)
        if not self.codes:
            return abi.check(self._add_real(given), "add")
        wanted = np.dtype(np.int16 if self.codes == 16 else np.int32)
        if given.dtype != wanted:
            raise InputError(f"this accumulator takes {self.codes}-bit codes as {wanted}, got {given.dtype}")
        return abi.check(self._add_codes(given), "add")

    def remove(self, part: Accumulator, weight: float = 1.0) -> None:
        """Take a part of the record out again, the inverse of merge(): see okid_accumulator_remove().

        A part of an unbroken record was fed with its own samples and the `lags` samples before them.
        Raises InputError when the two do not fit each other.
        """
        abi.check(self._use_both("remove", part, weight), "remove")

    @property
    def slots(self) -> int:
        """Slots of the window that hold rows, the open one included; 1 without a window."""
        return int(self._use("slots"))

    def slot_rows(self, k: int) -> int:
        """Regression rows in slot k, 0 = the oldest."""
        return int(self._use("slot_rows", k))

    def take_slots(self, window: Accumulator, first: int, count: int) -> None:
        """Add slots first .. first + count - 1 of a window to this accumulator, which has none itself."""
        abi.check(self._use_both("take_slots", window, first, count), "take_slots")

    def centre(self) -> None:
        """Take the offsets out of a finished record before it is merged with others: each channel less its own mean.

        Takes no samples any more afterwards, only merges with accumulators that are centred too.
        Raises InputError with a window, forgetting or without edges.
        """
        abi.check(self._use("centre"), "centre")

    def run_sums(self, detrend: str = "mean") -> tuple[NDArray[np.float64], ...]:
        """S (p+1, m, m), head (p, m), tail (p, m), sum (m) of one unbroken run: see okid_accumulator_run().

        Raises InputError when a gap has split the record, IdentificationError when there are no rows yet.
        """
        m, p = self.channels, self.lags
        sums, head, tail, total = np.empty((p + 1, m, m)), np.empty((p, m)), np.empty((p, m)), np.empty(m)
        out = abi.RunSums(*map(abi.pointer, (sums, head, tail, total)))
        abi.check(self._use("run", self._detrend(detrend), out), "run_sums")
        return sums.transpose(0, 2, 1), head, tail, total

    @in_turn
    def to_bytes(self) -> bytes:
        """The whole state for a file or another machine: checked by a CRC, the same for every processor."""
        out = np.empty(int(self._use("serialised_size")), np.uint8)
        abi.check(self._use("serialise", out.ctypes.data, out.size), "to_bytes")
        return out.tobytes()

    @staticmethod
    def from_bytes(data: bytes) -> Accumulator:
        """An accumulator that goes on where to_bytes() stood, bit for bit. InputError when the bytes are damaged."""
        config = abi.AccumulatorConfig()
        data = behind_head(state_bytes(data))
        abi.check(abi.library().okid_accumulator_peek(data, len(data), ctypes.byref(config)), "from_bytes")
        made = Accumulator(
            config.n_u, config.n_y, config.lags, codes=next(k for k, v in _SAMPLE.items() if v == config.sample),
            block=config.block, slots=config.slots, forgetting=config.forgetting, edges=bool(config.edges),
            spare_slots=config.spare_slots, saturated="missing" if config.saturated_missing else "keep",
        )  # fmt: skip
        made.restore(data)
        return made

    def restore(self, data: bytes) -> None:
        """Go back to a state of to_bytes() of an accumulator of the same configuration, else InputError."""
        data = behind_head(state_bytes(data))
        abi.check(self._use("deserialise", data, len(data)), "restore")

    @property
    def arguments(self) -> dict[str, Any]:
        """What it was made with, for another of the same kind."""
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
        twin = Accumulator(**self.arguments)
        twin.restore(self.to_bytes())
        return twin

    def __getstate__(self) -> dict[str, Any]:
        return {"arguments": self.arguments, "state": self.to_bytes()}

    def __setstate__(self, state: dict[str, Any]) -> None:
        self.__init__(**state["arguments"])  # type: ignore[misc]
        self.restore(state["state"])
