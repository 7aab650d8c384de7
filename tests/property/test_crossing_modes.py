# SPDX-License-Identifier: MIT
"""Tracks of modes that cross and veer: two beams side by side, a mass of 0.8 of a node's moves along the first one and
takes its frequencies through those of the second. Shapes and frequencies come from SciPy, with noise on both."""

from __future__ import annotations

import ctypes

import numpy as np
import pytest
from numpy.typing import NDArray
from okid import abi
from scipy.linalg import eigh

Real = NDArray[np.float64]
NODES, MODES, FIRST = 4, 6, 5  # FIRST updates at rest: tracks are born


def beam(stiffness: float) -> Real:
    second = 2.0 * np.eye(NODES) - np.eye(NODES, k=1) - np.eye(NODES, k=-1)
    return stiffness * second @ second


def modes_at(place: float, coupling: float) -> tuple[Real, Real]:
    """Frequencies (6,) in Hz, shapes (8, 6) with the mass at 0 .. 1 of the span; `coupling` N/m from node to node."""
    M, K, zero = np.eye(2 * NODES), np.zeros((2 * NODES, 2 * NODES)), np.eye(NODES)
    M[range(NODES), range(NODES)] += 0.8 * np.maximum(0.0, 1.0 - np.abs(place * (NODES + 1) - 1.0 - np.arange(NODES)))
    K[:NODES, :NODES], K[NODES:, NODES:] = beam(4e4), beam(3.2e4)
    K += coupling * np.block([[zero, -zero], [-zero, zero]])
    squares, shapes = eigh(K, M)
    return np.sqrt(squares[:MODES]) / (2.0 * np.pi), shapes[:, :MODES]


class Tracks:
    def __init__(self) -> None:
        config = abi.TrackConfig(n_y=2 * NODES, max_modes=MODES, max_tracks=2 * MODES)
        self.library, self.handle = abi.library(), ctypes.c_void_p()
        self.block = abi.block(int(self.library.okid_track_memsize(ctypes.byref(config))))
        place = (ctypes.byref(self.handle), ctypes.byref(config), self.block.ctypes.data, self.block.size)
        abi.check(self.library.okid_track_create(*place), "tracks")

    def update(self, frequency_hz: Real, shapes: Real) -> list[int]:
        number, damping = np.zeros(MODES, np.int32), np.full(MODES, 0.01)
        real, imaginary = np.ascontiguousarray(shapes.T), np.zeros((MODES, 2 * NODES))
        given = [abi.pointer(one) for one in (np.ascontiguousarray(frequency_hz), damping, real, imaginary)]
        out = number.ctypes.data_as(abi.int32s)
        abi.check(self.library.okid_track_update(self.handle, MODES, *given, out), "an update")
        return number.tolist()


@pytest.mark.parametrize(("coupling", "updates"), [(0.0, 20), (0.0, 80), (400.0, 80)])
def test_no_track_changes_its_mode(coupling: float, updates: int) -> None:
    """50 runs: not a single update with a wrong number. Uncoupled, modes cross and a mode is one of its beam; coupled,
    they veer over several updates and a mode is its place in the order."""
    path = [modes_at(max(0.0, (k - FIRST) / updates), coupling) for k in range(updates + FIRST)]
    names = []
    for _, shapes in path:
        on_first = np.abs(shapes[:NODES]).max(axis=0) > 1e-6 if coupling == 0.0 else np.ones(MODES, np.bool_)
        names.append([(bool(on_first[k]), int(np.sum(on_first[:k] == on_first[k]))) for k in range(MODES)])
    assert (len({tuple(one) for one in names}) > 1) == (coupling == 0.0)  # they do cross
    for seed in range(50):
        rng, tracks = np.random.default_rng(seed), Tracks()
        own: dict[tuple[bool, int], int] = {}
        for k, (frequency_hz, shapes) in enumerate(path):
            seen = frequency_hz * (1.0 + 1e-3 * rng.standard_normal(MODES))
            noise = 0.1 * np.abs(shapes).max(axis=0) * rng.standard_normal(shapes.shape)
            order = np.argsort(seen)
            number = tracks.update(seen[order], (shapes + noise)[:, order])
            if k >= FIRST - 1:
                for place, found in zip(order, number, strict=True):
                    assert found and own.setdefault(names[k][place], found) == found, (seed, k, names[k][place])
