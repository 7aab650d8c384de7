# SPDX-License-Identifier: MIT
"""State space from M, R, K and back, and M, R, K out of it, against SciPy."""

from __future__ import annotations

import ctypes
from dataclasses import dataclass

import numpy as np
import pytest
import systems
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from okid import Accumulator, Identifier, abi
from scipy.linalg import eigh, qr
from scipy.signal import cont2discrete

Array = NDArray[np.float64]
Model = tuple[Array, Array, Array, Array]


def column_major(x: Array) -> Array:
    return np.asfortranarray(x, dtype=np.float64)


def view(model: Model) -> abi.ModelView:
    kept = [column_major(x) for x in model]
    out = abi.ModelView(kept[1].shape[1], kept[2].shape[0], len(kept[0]), *map(abi.pointer, kept), None)
    out.kept = kept  # type: ignore[attr-defined]
    return out


def convert(name: str, model: Model, dt: float, hold: int) -> Model:
    """okid_mechanics_c2d or _d2c."""
    library, given_model = abi.library(), view(model)
    out = [np.empty(x.shape, order="F") for x in (model[0], model[1], model[3])]
    size = library.okid_mechanics_hold_memsize(given_model.n_u, given_model.n_y, given_model.n_z)
    work = abi.block(size)
    function = getattr(library, f"okid_mechanics_{name}")
    status = function(ctypes.byref(given_model), dt, hold, *map(abi.pointer, out), work.ctypes.data, size)
    abi.check(status, name)
    return out[0], out[1], model[2], out[2]


@dataclass
class Found:
    """What okid_mkr_identify returned, as arrays."""

    status: int
    notes: int
    M: Array
    R: Array
    K: Array
    R_normal: Array
    frequency_hz: Array
    damping_ratio: Array


def mkr(model: Model, s: systems.Structure, hold: int = abi.HOLD_ZERO, sensing: list[int] | None = None) -> Found:
    library, given_model, n = abi.library(), view(model), len(s.M)
    kinds = sensing or [abi.SENSE_ACCELERATION] * len(s.sense_dofs)
    maps = [np.array(x, np.int32) for x in (s.force_dofs, s.sense_dofs, kinds)]
    places = [x.ctypes.data_as(abi.int32s) for x in maps]
    config = abi.MkrConfig(n, hold, s.dt, places[0], None, places[1], None, places[2])
    size = library.okid_mkr_memsize(given_model.n_u, given_model.n_y, given_model.n_z, n)
    work, out = abi.block(size), abi.Mkr()
    status = library.okid_mkr_identify(
        ctypes.byref(given_model), ctypes.byref(config), ctypes.byref(out), work.ctypes.data, size
    )
    abi.check(status, "okid_mkr_identify")
    square = [np.ctypeslib.as_array(x, (n, n)).T.copy() for x in (out.M, out.R, out.K, out.R_normal)]
    modes = [np.ctypeslib.as_array(x, (n,)).copy() for x in (out.frequency_hz, out.damping_ratio)]
    return Found(status, out.notes, *square, *modes)


def pdc(frequency_hz: Array, damping_ratio: Array, weight: Array | None = None) -> abi.Pdc:
    out = abi.Pdc()
    kept = [None if x is None else np.ascontiguousarray(x) for x in (frequency_hz, damping_ratio, weight)]
    status = abi.library().okid_pdc_fit(len(frequency_hz), *map(abi.pointer, kept), ctypes.byref(out))
    abi.check(status, "okid_pdc_fit")
    return out


def relative(left: Array, right: Array) -> float:
    return float(np.linalg.norm(left - right) / np.linalg.norm(right))


def continuous(s: systems.Structure, sensing: list[int]) -> Model:
    n, minv = len(s.M), np.linalg.inv(s.M)
    a = np.block([[np.zeros((n, n)), np.eye(n)], [-minv @ s.K, -minv @ s.R]])
    b = np.vstack([np.zeros((n, len(s.force_dofs))), minv[:, list(s.force_dofs)]])
    kinds = [(np.eye(n, 2 * n), 0 * b[:n]), (np.eye(n, 2 * n, n), 0 * b[:n]), (a[n:], b[n:])]
    rows = [(kinds[k][0][o], kinds[k][1][o]) for o, k in zip(s.sense_dofs, sensing, strict=True)]
    return a, b, np.array([c for c, _ in rows]), np.array([d for _, d in rows])


def random_structure(rng: np.random.Generator, n: int) -> systems.Structure:
    """Full M and K, non-proportional R of 0.5 to 5 %, frequencies over a decade, some instruments missing."""
    omega = np.sort(rng.uniform(20.0, 200.0, n)) + 5.0 * np.arange(n)
    phi = np.linalg.inv(qr(rng.standard_normal((n, n)))[0] * np.sqrt(rng.uniform(0.5, 3.0, n)))
    dual = np.linalg.inv(phi)
    mass, stiffness = dual.T @ dual, dual.T @ np.diag(omega**2) @ dual
    damping = dual.T @ np.diag(2.0 * rng.uniform(0.005, 0.05, n) * omega) @ dual
    dashpot = rng.standard_normal(n)
    damping += 0.01 * float(omega[0]) * np.outer(dashpot, dashpot)
    places = rng.permutation(n)
    sensors = sorted({int(places[0]), *(int(d) for d in places[: rng.integers(1, n + 1)])})
    forces = sorted({int(places[0]), *(d for d in range(n) if d not in sensors)})
    return systems.Structure(mass, damping, stiffness, tuple(forces), tuple(sensors), 0.7 * np.pi / float(omega[-1]))


def realization(model: Model, rng: np.random.Generator, omega: float) -> Model:
    """Another realization of the same system: states of one size, then a random change of basis of condition 10."""
    z = len(model[0])
    turn = qr(rng.standard_normal((z, z)))[0] * 10.0 ** rng.uniform(-0.5, 0.5, z)
    turn = qr(rng.standard_normal((z, z)))[0] @ turn.T * np.repeat([omega, 1.0], z // 2)
    back = np.linalg.inv(turn)
    return turn @ model[0] @ back, turn @ model[1], model[2] @ back, model[3]


@given(st.integers(0, 2**31), st.integers(1, 8), st.sampled_from([abi.HOLD_ZERO, abi.HOLD_FIRST]))
def test_sampling_equals_scipy_and_goes_back(seed: int, n: int, hold: int) -> None:
    rng = np.random.default_rng(seed)
    s = random_structure(rng, n)
    model = continuous(s, [int(k) for k in rng.integers(0, 3, len(s.sense_dofs))])
    ours = convert("c2d", model, s.dt, hold)
    theirs = cont2discrete(model, s.dt, "zoh" if hold == abi.HOLD_ZERO else "foh")
    for left, right in zip(ours, theirs[:4], strict=True):
        np.testing.assert_allclose(left, right, rtol=0, atol=1e-12 * float(np.max(np.abs(right))))
    back = convert("d2c", ours, s.dt, hold)
    for i, (left, right) in enumerate(zip(back, model, strict=True)):
        size = ours[3] if i == 3 else right  # D_c is what is left of D_d
        np.testing.assert_allclose(left, right, rtol=0, atol=1e-11 * float(np.max(np.abs(size))))


@given(st.integers(0, 2**31), st.integers(1, 8), st.sampled_from([abi.HOLD_ZERO, abi.HOLD_FIRST]))
def test_mkr_of_any_structure_and_realization(seed: int, n: int, hold: int) -> None:
    rng = np.random.default_rng(seed)
    s = random_structure(rng, n)
    sensing = [int(k) for k in rng.integers(0, 3, len(s.sense_dofs))]
    model = convert("c2d", continuous(s, sensing), s.dt, hold)
    omega = float(np.sqrt(np.mean(eigh(s.K, s.M, eigvals_only=True))))
    found = mkr(realization(model, rng, omega), s, hold, sensing)
    assert relative(found.M, s.M) < 1e-9
    assert relative(found.K, s.K) < 1e-9
    assert relative(found.R, s.R) < 1e-8


@given(st.integers(0, 2**31), st.integers(2, 12), st.booleans())
def test_pdc_equals_lstsq(seed: int, n: int, weighted: bool) -> None:
    rng = np.random.default_rng(seed)
    f, zeta = rng.uniform(1.0, 300.0, n), rng.uniform(0.001, 0.05, n)
    weight = rng.uniform(0.1, 5.0, n) if weighted else np.ones(n)
    root, omega = np.sqrt(weight), 2.0 * np.pi * f
    table = root[:, None] * np.column_stack([0.5 / omega, 0.5 * omega])
    size = np.linalg.norm(table, axis=0)
    expected = np.linalg.lstsq(table / size, root * zeta, rcond=None)[0]
    found = pdc(f, zeta, weight if weighted else None)
    scale = float(np.max(np.abs(expected)))
    np.testing.assert_allclose([found.alpha, found.beta] * size, expected, rtol=0, atol=1e-12 * found.condition * scale)
    misfit = np.linalg.norm(root * zeta - table / size @ expected) / np.linalg.norm(root * zeta)
    assert found.residual == pytest.approx(misfit, abs=1e-10)


@settings(max_examples=10)
@given(st.integers(0, 2**31))
def test_over_order_keeps_the_structure(seed: int) -> None:
    s = systems.w1()
    v = np.hstack(systems.record(s, 6000, 2.0, seed))
    with Accumulator(1, 3, 30) as sums:
        sums.add(v)
        m = Identifier(1, 3, fs=s.fs, p=30, rows=60, order=14).run(sums)
    found = mkr((m.A, m.B, m.C, m.D), s)
    np.testing.assert_allclose(found.frequency_hz, s.modes()[0], rtol=5e-4)
    assert relative(found.M, s.M) < 0.03
    assert relative(found.K, s.K) < 0.03
