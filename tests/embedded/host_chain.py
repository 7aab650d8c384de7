# SPDX-License-Identifier: MIT
"""What the node does, on the host: the same codes through libokid, but by the Gram matrix and the dense observer."""

from __future__ import annotations

import ctypes
from typing import Any

import numpy as np
from numpy.typing import NDArray
from okid import Accumulator, abi
from okid.abi.layout import EraConfig, ObserverConfig, ObserverInfo
from qemu_node import Modes

N_U, N_Y, ORDER = 1, 3, 6
Real = NDArray[np.float64]


def sums(parts: list[NDArray[np.int16]], p: int, gaps: list[int] | None = None) -> Accumulator:
    """The accumulator of the node, fed with parts that `gaps` missing samples separate."""
    accumulator = Accumulator(N_U, N_Y, p, codes=16, edges=False)
    for k, part in enumerate(parts):
        if k > 0 and gaps is not None:
            accumulator.gap(gaps[k - 1])
        accumulator.add(part)
    return accumulator


def call(name: str, *arguments: Any) -> int:
    """A function of the library; raises for an error status."""
    return abi.check(getattr(abi.library(), name)(*arguments), name)


def observe(accumulator: Accumulator, p: int) -> tuple[Real, ObserverInfo]:
    """Observer Markov parameters, dense solver."""
    gram = np.asfortranarray(accumulator.gram("mean")[0])
    config, info = ObserverConfig(N_U, N_Y, p, 0.0, 0), ObserverInfo()
    theta = np.zeros(N_Y * (N_U + p * (N_U + N_Y)))
    work = abi.block(abi.library().okid_observer_memsize(ctypes.byref(config)))
    call("okid_observer_solve", ctypes.byref(config), abi.pointer(gram), accumulator.rows, abi.pointer(theta), None,
         ctypes.byref(info), work.ctypes.data, work.size)  # fmt: skip
    return theta, info


def identify(accumulator: Accumulator, p: int, rate_hz: float) -> Modes:
    """Modes with r = c = p and the order of three degrees of freedom."""
    theta, info = observe(accumulator, p)
    markov = np.zeros((2 * p + 1) * N_Y * N_U)
    call("okid_markov_recursion", N_U, N_Y, p, abi.pointer(theta), 2 * p, abi.pointer(markov), None)
    config, era, count = EraConfig(N_U, N_Y, p, p, 0, 0, 0), ctypes.c_void_p(), ctypes.c_int32()
    block = abi.block(abi.library().okid_era_memsize(ctypes.byref(config)))
    call("okid_era_create", ctypes.byref(era), ctypes.byref(config), block.ctypes.data, block.size)
    call("okid_era_decompose", era, abi.pointer(markov))
    values = np.ctypeslib.as_array(abi.library().okid_era_singular_values(era, ctypes.byref(count)), (2 * p,))[:10]
    A, B, C = np.zeros(ORDER * ORDER), np.zeros(ORDER * N_U), np.zeros(N_Y * ORDER)
    call("okid_era_realize", era, ORDER, abi.pointer(A), abi.pointer(B), abi.pointer(C), None, None)
    half = ORDER // 2
    sizes = [half, half, half, N_Y * half, N_Y * half, half, half, ORDER * half, ORDER * half]
    out = [np.zeros(size) for size in sizes]  # f, zeta, mpc, shape re, im, mu re, im, psi re, im
    work = abi.block(abi.library().okid_modal_memsize(N_Y, ORDER))
    modes = abi.Modes(0, 0.0, *map(abi.pointer, out))
    view = abi.ModelView(N_U, N_Y, ORDER, A=abi.pointer(A), C=abi.pointer(C))
    call("okid_modal_analyse", view, 1 / rate_hz, modes, work.ctypes.data, work.size)
    emac, found = np.zeros(half), modes.count
    call("okid_era_emac", era, ORDER, modes, abi.pointer(emac))
    shape = (out[3] + 1j * out[4]).reshape(half, N_Y)
    kept = [a[:found] for a in (out[0], out[1], out[2], emac, shape)]
    return Modes(0, 5, info.radius, info.ridge, values.copy(), *kept)
