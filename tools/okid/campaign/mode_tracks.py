# SPDX-License-Identifier: MIT
"""Modes of successive groups paired into tracks by the library (okid/track.h): which mode is which over time."""

from __future__ import annotations

import ctypes
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from okid import abi
from okid.campaign.spec import Trend

MOST = 256  # modes of a group, and tracks


class Tracker:
    """Tracks of one series. A mode that is not seen for any time keeps its number; the first group begins them."""

    def __init__(self, n_y: int) -> None:
        config = abi.TrackConfig(n_y, MOST, MOST, 1, 2**31 - 1, 0.0, 0.0, 0.0)
        size = int(abi.library().okid_track_memsize(ctypes.byref(config)))
        self._block, self._handle = abi.block(size), ctypes.c_void_p()
        place = (ctypes.byref(self._handle), ctypes.byref(config), self._block.ctypes.data, self._block.size)
        abi.check(abi.library().okid_track_create(*place), "tracks")
        self._known: list[tuple[float, NDArray[np.complex128]]] = []  # the last modes whose shapes were whole

    def _whole(self, f: NDArray[np.float64], shapes: list[NDArray[np.complex128]]) -> NDArray[np.complex128]:
        """Entries of outputs that were left out (NaN) as the whole shape nearest in frequency has them, else 0."""
        for k, shape in enumerate(shapes):
            gone = np.isnan(shape)
            if not gone.any():
                continue
            near = min(self._known, key=lambda one: abs(one[0] - f[k]), default=(0.0, np.zeros_like(shape)))[1]
            power = np.vdot(near[~gone], near[~gone]).real
            scale = np.vdot(near[~gone], shape[~gone]) / power if power > 0.0 else 0.0
            shapes[k] = np.where(gone, scale * near, shape)
        if all(np.isfinite(shape).all() for shape in shapes) and shapes:
            self._known = list(zip(f.tolist(), shapes, strict=True))
        return np.array(shapes)

    def update(self, modes: Sequence[dict[str, Any]]) -> list[int]:
        """The number of each mode of the next group, 0 = none."""
        count = min(len(modes), MOST)
        if count == 0:
            return []
        f = np.array([mode["frequency_hz"] for mode in modes[:count]])
        z = np.array([mode["damping_ratio"] for mode in modes[:count]])
        shapes = self._whole(f, [np.array(mode["shape_re"], dtype=float) + 1j * np.array(mode["shape_im"], dtype=float)
                                 for mode in modes[:count]])  # fmt: skip
        re, im = np.ascontiguousarray(shapes.real), np.ascontiguousarray(shapes.imag)
        numbers = np.zeros(count, dtype=np.int32)
        pointers = [abi.pointer(one) for one in (f, z, re, im)]
        out = numbers.ctypes.data_as(ctypes.POINTER(ctypes.c_int32))
        abi.check(abi.library().okid_track_update(self._handle, count, *pointers, out), "tracks")
        return [*numbers.tolist(), *[0] * (len(modes) - count)]


def good(mode: dict[str, Any], trend: Trend) -> bool:
    """Is a mode one of the structure, as far as its indicators tell?"""
    mpc = mode["mpc"]
    return (
        mode["holds"] is not False
        and 0.0 < mode["damping_ratio"] <= trend.max_damping
        and (mpc is None or mpc >= trend.min_mpc)
    )


def follow(groups: Sequence[list[dict[str, Any]]], n_y: int, trend: Trend) -> list[list[int]]:
    """Track numbers of all modes of the groups of one series, in the order of time; 0 = not followed.

    Groups without a model (no modes) are no miss. Cost: the library's, O(n^2 (n_y + n)) a group.
    """
    tracker = Tracker(n_y)
    out = []
    for modes in groups:
        chosen = [k for k, mode in enumerate(modes) if good(mode, trend)]
        numbers = [0] * len(modes)
        for k, number in zip(chosen, tracker.update([modes[k] for k in chosen]), strict=True):
            numbers[k] = number
        out.append(numbers)
    return out
