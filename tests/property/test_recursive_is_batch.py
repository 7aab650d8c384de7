# SPDX-License-Identifier: MIT
"""The recursive kernel against float64 QR of the whole record: the cases of the accuracy table in docs/numerics.md.

Judged by the Markov parameters, frequencies and damping ratios: the observer's coefficients themselves are badly
determined where there is no noise. The bounds are 1e-9 relative, 1e-8 for 24-bit codes without noise.
"""

from __future__ import annotations

import dataclasses

import numpy as np
import okid
import pytest
import reference
import systems
from numpy.typing import NDArray
from okid import Accumulator, InputError, SquareRoot
from okid.identification.identifier import Identifier

SAMPLES = 10000


def lightly_damped(s: systems.Structure, zeta: float) -> systems.Structure:
    return dataclasses.replace(s, R=systems.rayleigh(s.M, s.K, zeta)[0])


def quantised(v: NDArray[np.float64], bits: int) -> tuple[NDArray[np.signedinteger], NDArray[np.float64]]:
    """Codes that use nearly the whole range, and the size of one."""
    scale = np.abs(v).max(axis=0) / (2 ** (bits - 1) - 2)
    return np.round(v / scale).astype(np.int16 if bits == 16 else np.int32), scale


@pytest.mark.parametrize(
    ("make", "zeta", "noise", "bits", "bound", "zeta_bound"),
    [
        (systems.w1, 0.001, 0.0, 16, 1e-9, 1e-8),
        (systems.w1, 0.001, 0.0, 24, 1e-8, 1e-6),
        (systems.w1, 0.01, 1.0, 0, 1e-9, 1e-9),
        (systems.w3, 0.005, 1.0, 0, 1e-9, 1e-9),
        (systems.w3, 0.005, 1.0, 16, 1e-9, 1e-9),
        (systems.w3, 0.001, 0.0, 24, 1e-8, 1e-5),
    ],
)
def test_markov_parameters(make, zeta: float, noise: float, bits: int, bound: float, zeta_bound: float) -> None:
    p, s = 20, lightly_damped(make(), zeta)
    u, y = systems.record(s, SAMPLES, noise, 3)
    v, n_u, n_y = np.hstack([u, y]), u.shape[1], y.shape[1]
    with Accumulator(n_u, n_y, p, codes=bits) as sums:
        if bits:
            codes, scale = quantised(v, bits)
            v = codes * scale
            sums.set_units(scale)
        else:
            codes = v
        for block in np.array_split(codes, 37):
            sums.add(block)
        found = Identifier(n_u, n_y, fs=s.fs, p=p, order=2 * len(s.M)).run(sums)
    batch = reference.observer([v], n_u, p)
    expected = reference.markov(batch, len(found.markov) - 1)
    error = np.linalg.norm(found.markov - expected) / np.linalg.norm(expected)
    A, _, C, _, _ = reference.era(expected, 2 * p, 2 * len(s.M))
    f, damping, _ = reference.modal(A, C, 1 / s.fs)
    f_error = np.max(np.abs(found.frequency_hz / f - 1))
    zeta_error = np.max(np.abs(found.damping_ratio / damping - 1))
    print(f"markov {error:.1e} f {f_error:.1e} zeta {zeta_error:.1e} condition {found.observer.condition:.1e}")
    assert error <= bound
    assert f_error <= bound
    assert zeta_error <= zeta_bound


@pytest.mark.parametrize("make", [systems.w1, systems.w2, systems.w3])
def test_noise_free_records_go_through_the_factor(make) -> None:
    """Noise-free doubles: frequencies, damping and Markov parameters to 1e-8 and better, and the user is told."""
    s = make()
    u, y = systems.record(s, SAMPLES, 0.0, 5, x0=None)
    found = okid.identify(u, y, fs=s.fs, p=20, order=2 * len(s.M), detrend="none")
    assert "qr_factor" in [remark.code for remark in found.warnings]
    f, zeta = s.modes()
    np.testing.assert_allclose([m.frequency_hz for m in found.modes], f, rtol=1e-11)
    np.testing.assert_allclose([m.damping_ratio for m in found.modes], zeta, rtol=1e-9)
    A, B, C, D = s.discrete()
    truth = np.stack([D, *(C @ np.linalg.matrix_power(A, k) @ B for k in range(40))])
    assert np.linalg.norm(found.markov[:41] - truth) <= 1e-12 * np.linalg.norm(truth)


@pytest.mark.parametrize("window", [False, True])
@pytest.mark.parametrize("detrend", ["mean", "none"])
def test_three_solvers_agree(window: bool, detrend: str) -> None:
    p, s = 20, systems.w2()
    u, y = systems.record(s, SAMPLES, 1.0, 6)
    v, n_u, n_y = np.hstack([u, y]) + 0.3, u.shape[1], y.shape[1]
    shape = {"block": 500, "slots": 10} if window else {}
    sums, factor = Accumulator(n_u, n_y, p, **shape), SquareRoot(n_u, n_y, p, **shape)
    sums.add(v)
    factor.add(v)
    dense = Identifier(n_u, n_y, fs=s.fs, p=p, order=12, detrend=detrend)
    structured = Identifier(n_u, n_y, fs=s.fs, p=p, order=12, detrend=detrend, solver="structured")
    one, two, three = dense.run(sums), dense.run(factor), structured.run(sums)
    assert one.regression_rows == two.regression_rows == three.regression_rows
    for other in (two, three):
        assert np.linalg.norm(other.markov - one.markov) <= 1e-12 * np.linalg.norm(one.markov)
        np.testing.assert_allclose(other.mean, one.mean, rtol=1e-10, atol=1e-12)
        np.testing.assert_allclose(other.damping_ratio, one.damping_ratio, rtol=1e-9)
    with pytest.raises(InputError):
        structured.run(factor)
    sums.gap(1)
    sums.add(v[:2000])
    with pytest.raises(InputError):
        structured.run(sums)
