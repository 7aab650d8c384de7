# SPDX-License-Identifier: MIT
"""okid_model_fit() against recursions written here; B, D and x0 of a record against regressors of every sample."""

from __future__ import annotations

import ctypes

import numpy as np
import okid
import pytest
import systems
from numpy.typing import NDArray
from okid import abi
from scipy.linalg import solve_discrete_are

Array = NDArray[np.float64]


def left_of(s: systems.Structure, u: Array, y: Array, x0: Array, gain: Array | None) -> Array:
    """5 x n_y: squares left by simulation, by prediction; sum, squares and count of what was measured."""
    A, B, C, D = s.discrete()
    lib, (n_y, n) = abi.library(), C.shape
    kept = [np.ascontiguousarray(one.T) for one in (A, B, C, D)]
    turned = None if gain is None else np.ascontiguousarray(gain.T)
    model = abi.ModelView(
        u.shape[1],
        n_y,
        n,
        *map(abi.pointer, kept),
        None if turned is None else abi.pointer(turned),
    )
    work, sums = abi.block(lib.okid_model_fit_memsize(model)), np.zeros((5, n_y))
    rows, start = np.hstack([u, y]), np.ascontiguousarray(x0)
    assert (
        lib.okid_model_fit(
            model,
            abi.pointer(rows),
            1,
            abi.pointer(start),
            abi.pointer(sums),
            work.ctypes.data,
            8,
        )
        < 0
    )
    status = lib.okid_model_fit(
        model,
        abi.pointer(rows),
        len(rows),
        abi.pointer(start),
        abi.pointer(sums),
        work.ctypes.data,
        work.size,
    )
    assert status == 0
    return sums


@pytest.mark.parametrize("make", [systems.w1, systems.w2, systems.w3])
@pytest.mark.parametrize("missing", [False, True])
def test_one_pass_is_simulation_and_prediction(make: object, missing: bool) -> None:
    s = make()  # type: ignore[operator]
    u, y = systems.record(s, 700, 2.0, 4)
    A, B, C, D = s.discrete()
    n, n_y = len(A), len(C)
    P = solve_discrete_are(A.T, C.T, 1e-3 * np.eye(n), np.eye(n_y))
    gain = A @ P @ C.T @ np.linalg.inv(C @ P @ C.T + np.eye(n_y))
    x0 = np.random.default_rng(2).standard_normal(n)
    if missing:
        y[30:33, 0] = np.nan
        y[500] = np.nan
    simulated, predicted = np.zeros_like(y), np.zeros_like(y)
    x, z = x0.copy(), x0.copy()
    for k in range(len(u)):
        simulated[k], predicted[k] = C @ x + D @ u[k], C @ z + D @ u[k]
        x = A @ x + B @ u[k]
        innovation = y[k] - predicted[k]
        z = A @ z + B @ u[k] + (gain @ innovation if np.all(np.isfinite(innovation)) else 0.0)
    found = left_of(s, u, y, x0, gain)
    wanted = [
        np.nansum((y - simulated) ** 2, 0),
        np.nansum((y - predicted) ** 2, 0),
        np.nansum(y, 0),
        np.nansum(y**2, 0),
    ]
    for row, expected in zip(found, wanted, strict=False):
        np.testing.assert_allclose(row, expected, rtol=1e-9, atol=1e-9)
    np.testing.assert_array_equal(found[4], np.sum(np.isfinite(y), 0))
    without = left_of(s, u, y, x0, None)
    np.testing.assert_allclose(without[1], without[0])


def test_what_it_refuses() -> None:
    lib = abi.library()
    assert lib.okid_model_fit_memsize(abi.ModelView(1, 0, 2)) == 0
    assert lib.okid_model_fit(abi.ModelView(1, 1, 2), None, 0, None, None, ctypes.c_void_p(), 0) < 0


@pytest.mark.parametrize("make", [systems.w1, systems.w3])
def test_inputs_of_a_whole_record_are_the_least_squares_ones(make: object) -> None:
    """B and D of a whole record come from sums of the filters' states, here from the regressors of every sample."""
    s = make()  # type: ignore[operator]
    u, y = systems.record(s, 1500, 1.0, 8)
    order = 2 * len(s.M)
    found = okid.identify(
        u,
        y,
        fs=s.fs,
        method="n4sid-moesp",
        order=order,
        rows=12,
        detrend="none",
        sigma_blocks=0,
    ).model
    n, n_u, n_y = order, u.shape[1], y.shape[1]
    free = np.zeros((len(u), n_y, n))
    driven = np.zeros((len(u), n_y, n * n_u))
    power, state = np.eye(n), np.zeros((n, n * n_u))
    for k in range(len(u)):
        free[k], driven[k] = found.C @ power, found.C @ state
        power = found.A @ power
        state = found.A @ state + np.kron(u[k], np.eye(n))
    direct = np.einsum("kc,oe->koec", u, np.eye(n_y)).reshape(len(u), n_y, n_y * n_u)
    regressors = np.concatenate([driven, direct, free], axis=2).reshape(len(u) * n_y, -1)
    solution = np.linalg.lstsq(regressors, y.reshape(-1), rcond=None)[0]
    B = solution[: n * n_u].reshape(n_u, n).T
    D = solution[n * n_u : n * n_u + n_y * n_u].reshape(n_y, n_u)
    assert found.x0 is not None
    np.testing.assert_allclose(found.B, B, rtol=1e-6, atol=1e-8 * np.max(np.abs(B)))
    np.testing.assert_allclose(found.D, D, rtol=1e-6, atol=1e-8 * np.max(np.abs(D)))
    np.testing.assert_allclose(
        found.x0[0],
        solution[n * n_u + n_y * n_u :],
        atol=1e-6 * np.max(np.abs(found.x0)),
    )
