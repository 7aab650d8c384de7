# SPDX-License-Identifier: MIT
"""The square-root accumulator of libokid: the triangular factor of the regression rows instead of their Gram matrix."""

from __future__ import annotations

import ctypes
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from okid import abi
from okid._errors import InputError
from okid.abi.arguments import state_bytes, whole
from okid.abi.sums import Sums
from okid.abi.turns import in_turn


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


class SquareRoot(Sums):
    """Block QR of the regression rows [u_n, v_(n-1), .., v_(n-p), y_n]: the condition of the data is not squared.

    Slower than an Accumulator by q/m, for records of very light damping without noise and as the second opinion.
    Takes real numbers and ADC codes alike; a sample with a NaN or infinite channel counts as missing.

    Parameters: `n_u` inputs, `n_y` outputs, `lags` p; `batch` rows absorbed at once (0 = the default); `block`,
    `slots`, `spare_slots` and `forgetting` as for an Accumulator. Raises InputError for sizes out of range.
    Source: lib/include/okid/steps/square_root.h, paper eq. 36-39.
    """

    kernel = "okid_square_root"

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
        for name, value in (("n_u", n_u), ("n_y", n_y), ("lags", lags)):
            whole(name, value, 0, 65536)
        super().__init__(abi.SquareRootConfig(n_u, n_y, lags, batch, block, slots, spare_slots, forgetting))

    def add(self, samples: ArrayLike) -> int:
        """Absorb samples (N, m), inputs first; int16 and int32 arrays are ADC codes, anything else real numbers.

        Returns the status of the library: 0, or a warning > 0 (missing samples, saturated codes).
        Raises InputError for a wrong shape or type; the state is then unchanged. The array is never modified.
        """
        status = self._add_direct(samples)
        if status is not None:
            return status
        given = self._samples(samples)
        codes = given.dtype in (np.int16, np.int32)
        return abi.check(self._add_codes(given) if codes else self._add_real(given), "add")

    def factor(self, detrend: str = "mean") -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Upper triangular R (m(p+1), m(p+1)), diagonal >= 0, of rows [u_n, v_(n-1) .. v_(n-p), y_n], and the m means.

        Raises IdentificationError when there are no rows yet.
        """
        lower, mean = self._matrix("factor", detrend)
        return lower.T, mean

    @in_turn
    def observer(self, detrend: str = "mean", *, ridge_min: float = 0.0, stabilise: bool = True) -> Observer:
        """Observer Markov parameters from the factor; `stabilise` False leaves an unstable ARX model as it is.

        Raises IdentificationError when the data do not determine them (too short, constant channel, repeated inputs).
        """
        library = abi.library()
        config = abi.ObserverConfig(self.n_u, self.n_y, self.lags, ridge_min, int(not stabilise))
        work = abi.block(int(library.okid_observer_factor_memsize(ctypes.byref(config))))
        factor = np.ascontiguousarray(self.factor(detrend)[0].T)
        theta = np.empty((self.n_u + self.lags * self.channels, self.n_y))
        innovation, info = np.empty((self.n_y, self.n_y)), abi.ObserverInfo()
        status = library.okid_observer_solve_factor(
            ctypes.byref(config), abi.pointer(factor), self.rows, abi.pointer(theta), abi.pointer(innovation),
            ctypes.byref(info), work.ctypes.data, work.size,
        )  # fmt: skip
        abi.check(status, "observer")
        return Observer(theta.T, innovation, *(float(getattr(info, name)) for name in Observer._fields[2:]))

    @in_turn
    def snapshot(self) -> bytes:
        """The whole state as bytes: what memcpy would copy."""
        return self._memory().tobytes()

    @in_turn
    def restore(self, snapshot: bytes) -> None:
        """Go back to a snapshot() of the same configuration. InputError when the size differs."""
        memory, snapshot = self._memory(), state_bytes(snapshot)
        if len(snapshot) != memory.size:
            raise InputError(f"the snapshot has {len(snapshot)} bytes, this accumulator {memory.size}")
        memory[:] = np.frombuffer(snapshot, dtype=np.uint8)
