# SPDX-License-Identifier: MIT
"""Refinement from correlation sums: the Cramér-Rao bound of the rows in them, intervals that hold, merging, codes.

The bound, the structures and their simulation are the tests' own (test_refine.py, systems.py); they share with the
library the model class: poles, shapes, white noise at the sensors. The last test has a force that is far from white,
and offsets.
"""

from __future__ import annotations

import ctypes
import os
from typing import Any

import numpy as np
import okid
import pytest
import systems
from numpy.typing import NDArray
from okid import abi
from scipy.signal import lfilter
from test_refine import bound, made, options

SLOW = os.environ.get("OKID_SLOW") == "1"  # the long tier
Array = NDArray[np.float64]
DRAWS = 64
CASES = {"w1": (20000, 2000), "w2": (30000, 4000), "w3": (100000, 6500)}  # samples, lags


class Sums:
    """okid_correlation_t of double samples or 16-bit codes, its memory and what it gives."""

    def __init__(self, n_u: int, n_y: int, lags: int, **more: Any) -> None:
        self.lib = abi.library()
        self.config = abi.CorrelationConfig(
            n_u,
            n_y,
            lags,
            0,
            more.get("sample", abi.SAMPLE_DOUBLE),
            more.get("block", 0),
            more.get("slots", 4),
            0,
            0,
            1.0,
        )
        size = self.lib.okid_correlation_memsize(ctypes.byref(self.config))
        self.block, self.handle = ctypes.create_string_buffer(size), ctypes.c_void_p()
        made_it = self.lib.okid_correlation_create(
            ctypes.byref(self.handle), ctypes.byref(self.config), self.block, size
        )
        assert made_it == abi.OK

    def add(self, u: Array, y: Array) -> Sums:
        v = np.ascontiguousarray(np.hstack([u, y]))
        codes = self.config.sample == abi.SAMPLE_INT16
        add = self.lib.okid_correlation_add_i16 if codes else self.lib.okid_correlation_add
        kind = ctypes.c_int16 if codes else ctypes.c_double
        v = v.astype(np.int16) if codes else v
        assert add(self.handle, v.ctypes.data_as(ctypes.POINTER(kind)), len(v)) == abi.OK
        return self

    def merge(self, other: Sums) -> Sums:
        assert self.lib.okid_correlation_merge(self.handle, other.handle) == abi.OK
        return self

    def refine(self, start: okid.Model, detrend: int = abi.DETREND_NONE) -> Refined:
        return Refined(self, start, detrend)


class Refined:
    """Poles of the refined model, ascending, and the draws of its deviations."""

    def __init__(self, sums: Sums, start: okid.Model, detrend: int) -> None:
        lib, found = sums.lib, abi.Refined()
        size = lib.okid_correlation_sums_memsize(sums.handle)
        room, view = ctypes.create_string_buffer(size), abi.CorrelationSums()
        assert lib.okid_correlation_sums(sums.handle, detrend, ctypes.byref(view), room, size) == abi.OK
        parts = [np.asfortranarray(getattr(start, name), dtype=float) for name in "ABCD"]
        self.n, n_u, n_y = len(parts[0]), parts[1].shape[1], len(parts[2])
        config = abi.RefineConfig(n_u, n_y, self.n, 0, DRAWS, 0, 0)
        size = lib.okid_refine_memsize(ctypes.byref(config))
        memory, handle = ctypes.create_string_buffer(size), ctypes.c_void_p()
        assert lib.okid_refine_create(ctypes.byref(handle), ctypes.byref(config), memory, size) == abi.OK
        model = abi.ModelView(n_u, n_y, self.n, *(x.ctypes.data_as(abi.doubles) for x in parts), None)
        self.status = lib.okid_refine_from_correlation(
            handle, ctypes.byref(model), ctypes.byref(view), ctypes.byref(found)
        )
        assert self.status == abi.OK
        self.noise = np.ctypeslib.as_array(found.noise_std, (n_y,)).copy()
        self.samples = found.samples
        self.A = np.ctypeslib.as_array(found.A, (self.n**2,)).reshape(self.n, self.n).T.copy()
        self.draws = []
        for k in range(DRAWS):
            out = [np.empty(x.shape, order="F") for x in parts]
            pointers = [x.ctypes.data_as(abi.doubles) for x in out]
            assert lib.okid_refine_replicate(handle, k, *pointers) == abi.OK
            self.draws.append(out[0])

    def modes(self, fs: float) -> Array:
        return poles(self.A, fs)

    def deviations(self, fs: float) -> Array:
        scatter = np.array([poles(a, fs) for a in self.draws])
        return np.sqrt((DRAWS - 1) / DRAWS * np.sum((scatter - scatter.mean(axis=0)) ** 2, axis=0))


def poles(a: Array, fs: float) -> Array:
    """Frequencies, then damping ratios, by ascending frequency."""
    mu = np.linalg.eigvals(a)
    lam = np.log(mu[mu.imag > 0]) * fs
    lam = lam[np.argsort(abs(lam))]
    return np.concatenate([abs(lam) / (2 * np.pi), -lam.real / abs(lam)])


def start_of(name: str, s: systems.Structure, u: Array, y: Array) -> okid.Model:
    return okid.identify(u, y, fs=s.fs, order=2 * len(s.M), **options(name, "n4sid-moesp")).model


ALL = [(name, noise) for name in CASES for noise in (1.0, 5.0)]


@pytest.mark.parametrize(("name", "noise"), ALL if SLOW else [("w1", 5.0), ("w2", 1.0)])
def test_errors_reach_the_cramer_rao_bound_of_the_rows_and_the_intervals_hold(name: str, noise: float) -> None:
    s, (samples, lags) = getattr(systems, name)(), CASES[name]
    truth, ratios, inside = np.concatenate(s.modes()), [], []
    for seed in range(200 if SLOW and name == "w1" else 40):
        u, y, sigma = made.__wrapped__(name, noise, 7000 + seed, samples)
        if seed == 0:
            limit = np.concatenate(bound(s, u[lags:], sigma))
        refined = Sums(u.shape[1], y.shape[1], lags).add(u, y).refine(start_of(name, s, u, y))
        assert refined.samples == samples - lags
        assert np.allclose(refined.noise, sigma, rtol=0.04)
        error = refined.modes(s.fs) - truth
        ratios.append(error / limit)
        inside.append(abs(error) < 1.96 * refined.deviations(s.fs))
    square, half = np.mean(np.array(ratios) ** 2, axis=0), len(s.M)
    print(name, noise, "f", np.sqrt(square[:half].mean()), "zeta", np.sqrt(square[half:].mean()), "worst",
          np.sqrt(square.max()), "inside", np.mean(inside))  # fmt: skip
    by_chance = 3 / np.sqrt(2 * len(ratios) * half)  # of a pooled rms; of a single one sqrt(half) times that
    assert np.sqrt(square[:half].mean()) < max(1.1, 1 + by_chance)
    assert np.sqrt(square[half:].mean()) < max(1.1, 1 + by_chance)
    assert np.sqrt(square.max()) < max(1.3, 1 + by_chance * np.sqrt(half))
    assert 0.92 < np.mean(inside) < 0.98, np.mean(inside)


def test_merged_records_and_codes_are_one_record() -> None:
    s = systems.w1()
    u, y, _ = made("w1", 1.0, 17, 12000)
    v, z, _ = made("w1", 1.0, 18, 12000)
    start = start_of("w1", s, u, y)
    scale = 3000 / np.max(abs(np.hstack([u, y])), axis=0)
    for sample, factor in ((abi.SAMPLE_DOUBLE, np.ones(4)), (abi.SAMPLE_INT16, scale)):

        def sums(*parts: tuple[Array, Array], sample: int = sample, factor: Array = factor) -> Sums:
            out = Sums(1, 3, 2000, sample=sample)
            out.lib.okid_correlation_set_units(out.handle, np.ascontiguousarray(1 / factor).ctypes.data_as(abi.doubles))
            for a, b in parts:
                out.add(np.round(a * factor[:1]) if sample else a, np.round(b * factor[1:]) if sample else b)
                out.lib.okid_correlation_gap(out.handle, 0)
            return out

        batch = sums((u, y), (v, z)).refine(start).modes(s.fs)
        merged = sums((u, y)).merge(sums((v, z))).refine(start).modes(s.fs)
        assert np.max(abs(merged / batch - 1)) < (1e-15 if sample else 1e-9)
        assert np.max(abs(batch / np.concatenate(s.modes()) - 1)) < 0.02


def test_a_coloured_force_with_offsets_is_no_white_one() -> None:
    """A force of 1/f kind with offsets on all channels: not the white one of the other tests."""
    s = systems.w1()
    rng = np.random.default_rng(4)
    u = lfilter([1.0], [1.0, -0.95], rng.standard_normal((20000, 1)), axis=0)
    clean = systems.simulate(s.discrete(), u)
    y = clean + 0.02 * clean.std(axis=0) * rng.standard_normal(clean.shape)
    start = start_of("w1", s, u, y)
    plain = Sums(1, 3, 2000).add(u, y).refine(start, abi.DETREND_MEAN)
    moved = Sums(1, 3, 2000).add(u + 5.0, y - 7.0).refine(start, abi.DETREND_MEAN)
    error = (plain.modes(s.fs) - np.concatenate(s.modes())) / plain.deviations(s.fs)
    assert np.sqrt(np.mean(error**2)) < 2.0
    assert np.max(abs(moved.modes(s.fs) / plain.modes(s.fs) - 1)) < 1e-8
