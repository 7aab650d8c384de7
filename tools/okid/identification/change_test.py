# SPDX-License-Identifier: MIT
"""Has a structure changed since a baseline? A test on sums of blocks that identifies nothing (okid/change.h)."""

from __future__ import annotations

import ctypes
from collections.abc import Iterable
from typing import NamedTuple

import numpy as np

from okid import abi
from okid._errors import InputError
from okid.abi.accumulator import Accumulator
from okid.shown.notebook_html import own_fields, short, summary, table


class ModeShift(NamedTuple):
    """A mode of the baseline (Hz) in a test: relative change of its frequency and the standard deviation of that."""

    frequency_hz: float
    damping_ratio: float
    shift: float
    sigma: float

    def _repr_html_(self) -> str:
        return own_fields(self)


class ChangeVerdict(NamedTuple):
    """`alarm`: `p_value`, the probability of so much without a change, is below the rate of false alarms. `farthest`:
    index of the mode that moved most, in its standard deviations. NaN with fewer than four blocks."""

    alarm: bool
    p_value: float
    statistic: float
    freedom: float
    farthest: int
    blocks: int
    modes: list[ModeShift]

    def _repr_html_(self) -> str:
        """The mode that moved most, in its standard deviations, has an arrow."""
        rows = (
            [f"{k}", f"{one.frequency_hz:.5f}", f"{100.0 * one.damping_ratio:.4f}", short(one.shift, 100.0, "+.3g"),
             short(one.sigma, 100.0, ".2g"), "←" if self.alarm and k == self.farthest + 1 else ""]
            for k, one in enumerate(self.modes, 1)
        )  # fmt: skip
        said = (
            f"{'alarm' if self.alarm else 'no alarm'}: p-value {short(self.p_value, form='.3g')}, {self.blocks} blocks"
        )
        return summary(said) + table(("mode", "f [Hz]", "ζ [%]", "shift of f [%]", "± [%]", ""), rows)


class ChangeTest:
    """Blocks of a baseline, then blocks of tests: each an Accumulator with at least 2 rows - 1 lags.

    Parameters: `n_u`, `n_y`; `fs` Hz; `rows` block rows i, some half a period of the lowest mode; `order` states of the
    baseline, 0 = as many as it shows; `blocks` at most; `false_alarm` the probability of an alarm in one test of a
    structure that did not change. Raises InputError. Source: lib/include/okid/change.h.
    """

    def __init__(
        self, n_u: int, n_y: int, *, fs: float, rows: int, order: int = 0, blocks: int = 20, false_alarm: float = 0.001
    ) -> None:
        config = abi.ChangeConfig(n_u, n_y, rows, order, blocks, false_alarm, fs)
        size = int(abi.library().okid_change_memsize(ctypes.byref(config)))
        if size == 0:
            given = ", ".join(f"{name}={getattr(config, name)}" for name, *_ in config._fields_)
            raise InputError(f"no ChangeTest for {given}: see okid/change.h for the ranges", abi.ERR_DIM)
        self._block, self._handle = abi.block(size), ctypes.c_void_p()
        place = (ctypes.byref(self._handle), ctypes.byref(config), self._block.ctypes.data, self._block.size)
        abi.check(abi.library().okid_change_create(*place), "ChangeTest")

    def _add(self, blocks: Iterable[Accumulator]) -> None:
        library = abi.library()
        library.okid_change_clear(self._handle)
        for one in blocks:
            scratch = np.empty((one.channels * (one.lags + 1)) ** 2)
            abi.check(library.okid_change_add(self._handle, one.handle, abi.pointer(scratch)), "a block")

    def learn(self, blocks: Iterable[Accumulator]) -> int:
        """The baseline. @return its states. Raises InputError, IdentificationError."""
        self._add(blocks)
        abi.check(abi.library().okid_change_learn(self._handle), "the baseline")
        return int(abi.library().okid_change_order(self._handle))

    def test(self, blocks: Iterable[Accumulator]) -> ChangeVerdict:
        """Compare with the baseline. Raises InputError, IdentificationError."""
        self._add(blocks)
        found, mode, modes = abi.ChangeVerdict(), abi.ChangeMode(), []
        abi.check(abi.library().okid_change_test(self._handle, ctypes.byref(found)), "the test")
        for k in range(found.modes):
            abi.check(abi.library().okid_change_mode(self._handle, k, ctypes.byref(mode)), "a mode")
            modes.append(ModeShift(mode.frequency_hz, mode.damping_ratio, mode.shift, mode.sigma))
        return ChangeVerdict(
            bool(found.alarm), found.p_value, found.statistic, found.freedom, found.farthest, found.blocks, modes
        )
