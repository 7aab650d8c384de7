# SPDX-License-Identifier: MIT
"""--sigma: derivatives of a method and identification without each block say the same; what is named is done.

Coverage of the truth by the default is in test_uncertainty.py.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import pytest
import systems
from methods import METHODS
from numpy.typing import NDArray
from okid import InputError, Session, identify
from program import okid

Array = NDArray[np.float64]
W1 = systems.w1()
U, Y = systems.record(W1, 6000, 2.0, 5)
DOFS: dict[str, Any] = {"input_dofs": [1], "output_dofs": [1, 2, 3]}


def deviations(modes: Sequence[Any]) -> Array:
    """Of f, zeta and the entries of the shapes that are not 1 by scaling."""
    rows = [[m.frequency_std_hz, m.damping_ratio_std, *m.shape_re_std, *m.shape_im_std] for m in modes]
    return np.array([x for row in rows for x in row if x != 0.0], float)


def found(method: str, **options: Any) -> Any:
    return identify(U, Y, fs=W1.fs, method=method, order=6, **options)


@pytest.mark.parametrize("method", METHODS)
def test_both_ways_agree(method: str) -> None:
    """Within 12 % for every number, M, K, R, alpha and beta too; and they are two ways."""
    a, b = (found(method, sigma=sigma, **DOFS) for sigma in ("analytic", "jackknife"))
    pairs = [(deviations(a.modes), deviations(b.modes))]
    for name in ("M_std", "K_std", "R_std", "R_normal_modes_std"):
        pairs.append((np.array(getattr(a.mkr, name)).ravel(), np.array(getattr(b.mkr, name)).ravel()))
    pairs.append((np.array([a.pdc.alpha_std, a.pdc.beta_std]), np.array([b.pdc.alpha_std, b.pdc.beta_std])))
    for one, other in pairs:
        np.testing.assert_allclose(one, other, rtol=0.12)
    assert not np.array_equal(*pairs[0])


@pytest.mark.parametrize("method", METHODS)
def test_they_agree_without_inputs_and_over_records_with_gaps(method: str) -> None:
    """The median over everything that is printed: of few blocks single deviations differ by a fifth."""
    y = Y.copy()
    y[1500:1509, 1] = np.nan
    for u, outputs in ((None, Y), ([U[:2500], U[2500:]], [y[:2500], y[2500:]])):
        one, other = (
            deviations(identify(u, outputs, fs=W1.fs, method=method, order=6, rows=20, sigma=sigma).modes)
            for sigma in ("analytic", "jackknife")
        )
        assert len(one) == len(other) >= 18 and not np.array_equal(one, other)
        assert abs(np.median(one / other) - 1) < 0.12 and np.all(abs(np.log(one / other)) < 0.6)


def test_the_default_is_analytic_and_blocks_alone_mean_the_jackknife() -> None:
    default, analytic = deviations(found("n4sid-cva").modes), deviations(found("n4sid-cva", sigma="analytic").modes)
    blocks, jackknife = found("n4sid-cva", sigma_blocks=20), found("n4sid-cva", sigma="jackknife")
    np.testing.assert_array_equal(default, analytic)
    np.testing.assert_array_equal(deviations(blocks.modes), deviations(jackknife.modes))
    assert not np.array_equal(default, deviations(jackknife.modes))
    assert all(m.frequency_std_hz is None for m in found("n4sid-cva", sigma="none").modes)


def test_a_hankel_matrix_without_a_derivative_takes_the_jackknife() -> None:
    one, other = (
        deviations(found("okid-era", hankel="innovations", sigma=sigma).modes) for sigma in ("analytic", "jackknife")
    )
    np.testing.assert_array_equal(one, other)


def test_nearly_noise_free_records_take_the_jackknife() -> None:
    """The QR factor of the record has no derivative by its sums."""
    u, y = systems.record(W1, 4000, 0.0, 5)
    one, other = (
        identify(u, y, fs=W1.fs, method="n4sid-cva", order=6, sigma=sigma) for sigma in ("analytic", "jackknife")
    )
    assert "qr_factor" in {w.code for w in one.warnings}
    np.testing.assert_array_equal(deviations(one.modes), deviations(other.modes))


@pytest.mark.parametrize("memory", [{}, {"window_s": 4000 / W1.fs, "update_s": 200 / W1.fs}, {"forgetting": 0.9995}])
@pytest.mark.parametrize("method", ["okid-era", "n4sid-moesp", "n4sid-ssarx"])
def test_streams_agree_too(method: str, memory: dict[str, Any]) -> None:
    """Sums with offsets, gaps between their blocks and weights."""
    rows = np.hstack([U, Y]) + np.array([0.5, 3.0, -2.0, 9.81])
    rows[2500:2503, 1] = np.nan

    def of(sigma: str) -> Array:
        session = Session(1, 3, fs=W1.fs, method=method, order=6, p=20, rows=20, sigma=sigma, **memory)
        session.feed(rows)
        return deviations(session.modes())

    one, other = of("analytic"), of("jackknife")
    np.testing.assert_allclose(one, other, rtol=0.15)
    assert not np.array_equal(one, other)


def free_decay() -> Array:
    """6,000 samples, over after some 500: the twentieth that it begins in has nearly all of its power."""
    A, _, C, _ = W1.discrete()
    state = np.random.default_rng(3).standard_normal(len(A))
    rows = []
    for _ in range(6000):
        rows.append(C @ state)
        state = A @ state
    clean = np.array(rows)
    return clean + 0.01 * clean[:300].std(axis=0) * np.random.default_rng(4).standard_normal(clean.shape)


def test_what_one_block_rules_takes_the_jackknife() -> None:
    """A free decay: the first-order change is not that of the model without the block (14 times smaller)."""
    y = free_decay() + np.array([3.0, -2.0, 9.81])
    one, other = (
        deviations(identify(None, y, fs=W1.fs, method="n4sid-moesp", order=6, sigma=sigma).modes)
        for sigma in ("analytic", "jackknife")
    )
    np.testing.assert_array_equal(one, other)
    for memory in ({}, {"window_s": 6000 / W1.fs}):
        got = []
        for sigma in ("analytic", "jackknife"):
            with Session(0, 3, fs=W1.fs, method="n4sid-moesp", order=6, sigma=sigma, **memory) as session:
                session.feed(y)
                got.append(deviations(session.identify().modes))
        assert len(got[0]) >= 18
        np.testing.assert_array_equal(*got)


def test_another_word_is_refused() -> None:
    with pytest.raises(InputError, match='sigma: found "bootstrap", expected one of: analytic'):
        found("n4sid-cva", sigma="bootstrap")
    out = okid("identify", "--sigma", "bootstrap", "x.csv", "--outputs", "a", "--fs", "1")
    assert out.returncode == 2 and "--sigma" in out.stderr
