# SPDX-License-Identifier: MIT
"""The square-root accumulator against QR of explicit rows, against the shift-structured accumulator, and its solver."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import reference
import systems
from gram import solve_gram
from hypothesis import given
from hypothesis import strategies as st
from okid import Accumulator, IdentificationError, InputError, SquareRoot, abi

sizes = st.tuples(st.integers(0, 3), st.integers(1, 3), st.integers(1, 5))  # n_u, n_y, p
seeds = st.integers(0, 2**31)
detrends = st.sampled_from(["none", "mean"])


def close(left: np.ndarray, right: np.ndarray, tolerance: float = 1e-12) -> bool:
    return float(np.linalg.norm(left - right)) <= tolerance * float(np.linalg.norm(right))


def draw(seed: int, count: int, channels: int) -> np.ndarray:
    rng = np.random.default_rng(seed)
    return rng.standard_normal((count, channels)) * rng.uniform(0.1, 10.0, channels) + rng.uniform(-9.0, 9.0, channels)


def holes(v: np.ndarray, places: list[tuple[int, int]]) -> np.ndarray:
    """A record with missing samples: NaN, infinities and numbers whose squares overflow."""
    out = v.copy()
    for sample, channel in places:
        out[sample, channel % v.shape[1]] = (np.nan, np.inf, -np.inf, 1e300)[sample % 4]
    return out


def present(v: np.ndarray) -> np.ndarray:
    return np.where(np.abs(v) < 1e100, v, np.nan)


def order(n_u: int, n_y: int, p: int) -> np.ndarray:
    """Where the columns [u_n, v_(n-1), .., v_(n-p), y_n] of the factor stand in [v_n; ..; v_(n-p)]."""
    m = n_u + n_y
    return np.r_[np.arange(n_u), np.arange(m, m * (p + 1)), np.arange(n_u, m)]


@given(sizes, seeds, st.integers(0, 150), detrends, st.integers(0, 40))
def test_gram_equals_explicit_rows(size: tuple[int, int, int], seed: int, extra: int, detrend: str, batch: int) -> None:
    n_u, n_y, p = size
    v = draw(seed, p + 4 + extra, n_u + n_y)
    rows = SquareRoot(n_u, n_y, p, batch=batch)
    rows.add(v)
    gram, mean = rows.gram(detrend)
    expected = reference.gram([v], p, False)
    assert np.linalg.norm(gram - reference.gram([v], p, detrend == "mean")) <= 1e-13 * np.linalg.norm(expected)
    np.testing.assert_array_equal(gram, gram.T)
    np.testing.assert_allclose(mean, v[p:].mean(axis=0), rtol=1e-12, atol=1e-12)
    assert rows.rows == len(v) - p


@given(sizes, seeds, detrends)
def test_factor_equals_explicit_qr(size: tuple[int, int, int], seed: int, detrend: str) -> None:
    n_u, n_y, p = size
    v = draw(seed, p + 400, n_u + n_y)
    rows = SquareRoot(n_u, n_y, p)
    rows.add(v)
    factor, mean = rows.factor(detrend)
    explicit = reference.lagged([v], p)[:, order(n_u, n_y, p)]
    if detrend == "mean":
        explicit = explicit - explicit.mean(axis=0)
    r = np.linalg.qr(explicit, mode="r")
    assert close(factor, r * np.sign(np.diag(r))[:, None], 1e-11)
    assert not np.any(np.tril(factor, -1))
    assert np.all(np.diag(factor) >= 0)
    np.testing.assert_allclose(mean, v[p:].mean(axis=0), rtol=1e-12, atol=1e-12)


@given(sizes, seeds, st.lists(st.integers(0, 300), max_size=8), st.integers(0, 50), st.booleans())
def test_any_split_gives_the_same_bits(
    size: tuple[int, int, int], seed: int, cuts: list[int], batch: int, window: bool
) -> None:
    n_u, n_y, p = size
    v = holes(draw(seed, 300, n_u + n_y), [(77, 0), (203, 1)])
    shape = {"batch": batch, "block": 37 * window, "slots": 4 * window, "spare_slots": 2 * window}
    one, many = SquareRoot(n_u, n_y, p, **shape), SquareRoot(n_u, n_y, p, **shape)
    one.add(v)
    for piece in np.split(v, sorted(cuts)):
        many.add(piece)
    assert many.stats == one.stats
    for detrend in ("none", "mean"):
        np.testing.assert_array_equal(many.factor(detrend)[0], one.factor(detrend)[0])
        np.testing.assert_array_equal(many.gram(detrend)[0], one.gram(detrend)[0])


@given(sizes, seeds, st.lists(st.tuples(st.integers(0, 119), st.integers(0, 5)), max_size=6), st.booleans())
def test_missing_samples_leave_their_rows_out(
    size: tuple[int, int, int], seed: int, places: list[tuple[int, int]], split: bool
) -> None:
    n_u, n_y, p = size
    v = holes(draw(seed, 120, n_u + n_y), places)
    lost = ~np.all(np.isfinite(present(v)), axis=1)
    rows = SquareRoot(n_u, n_y, p)
    status = [rows.add(piece) for piece in (np.split(v, [41, 43, 90]) if split else [v])]
    assert max(status) == (abi.WARN_MISSING if np.any(lost) else abi.OK)
    stats = rows.stats
    assert (stats.missing, stats.samples) == (lost.sum(), len(v) - lost.sum())
    assert stats.gaps == lost[0] + np.sum(lost[1:] & ~lost[:-1])
    explicit = reference.lagged([present(v)], p)
    assert stats.rows == len(explicit)
    if len(explicit) > 0:
        expected = reference.gram([present(v)], p, False)
        assert close(rows.gram("none")[0], expected)
        centred = reference.gram([present(v)], p, True)
        assert np.linalg.norm(rows.gram("mean")[0] - centred) <= 1e-12 * np.linalg.norm(expected)


def test_told_gaps_count_and_separate() -> None:
    v = draw(1, 80, 2)
    rows = SquareRoot(1, 1, 3)
    rows.add(v[:40])
    rows.gap(7)
    rows.add(v[40:])
    rows.gap(0)
    assert (rows.stats.missing, rows.stats.gaps) == (7, 1)
    assert close(rows.gram("none")[0], reference.gram([v[:40], v[40:]], 3, False))


@given(sizes, seeds, st.floats(0.0, 1e3))
def test_merging_equals_one_factor_over_all_records(size: tuple[int, int, int], seed: int, drift: float) -> None:
    n_u, n_y, p = size
    records = [draw(seed + k, 3 + p + 37 * k, n_u + n_y) + drift * k for k in range(3)]
    expected = reference.gram(records, p, False)
    for sequence in ((0, 1, 2), (2, 1, 0), (1, 0, 2)):
        parts = [SquareRoot(n_u, n_y, p) for _ in records]
        for part, record in zip(parts, records, strict=True):
            part.add(record)
        first, *others = (parts[k] for k in sequence)
        kept = [other.gram("mean")[0] for other in others]
        for other in others:
            first.merge(other)
        assert close(first.gram("none")[0], expected, 1e-11)
        centred = reference.gram(records, p, True)
        assert np.linalg.norm(first.gram("mean")[0] - centred) <= 1e-12 * np.linalg.norm(expected)
        assert first.rows == sum(len(r) - p for r in records)
        for other, before in zip(others, kept, strict=True):
            np.testing.assert_array_equal(other.gram("mean")[0], before)


def test_merging_with_an_empty_one() -> None:
    v = draw(4, 60, 3) + 1e4
    full, empty = SquareRoot(1, 2, 2), SquareRoot(1, 2, 2)
    full.add(v)
    alone = full.gram("mean")[0]
    empty.merge(full)
    np.testing.assert_allclose(empty.gram("mean")[0], alone, rtol=1e-12, atol=1e-12 * np.max(alone))
    full.merge(SquareRoot(1, 2, 2))
    np.testing.assert_array_equal(full.gram("mean")[0], alone)
    empty.add(v)  # the reference came with the merge
    assert close(empty.gram("mean")[0], reference.gram([v, v], 2, True), 1e-11)


@given(sizes, seeds, st.integers(1, 30), st.integers(1, 5), st.integers(10, 400), detrends)
def test_window_holds_exactly_the_last_rows(
    size: tuple[int, int, int], seed: int, block: int, slots: int, count: int, detrend: str
) -> None:
    n_u, n_y, p = size
    v = draw(seed, p + count, n_u + n_y)
    rows = SquareRoot(n_u, n_y, p, block=block, slots=slots)
    for piece in np.array_split(v, 7):
        rows.add(piece)
    kept = rows.rows
    assert min(count, slots * block) <= kept < min(count + 1, (slots + 1) * block + 1)
    last = v[len(v) - kept - p :]
    expected = reference.gram([last], p, detrend == "mean")
    scale = np.linalg.norm(reference.gram([last], p, False))
    assert np.linalg.norm(rows.gram(detrend)[0] - expected) <= 1e-12 * scale


@given(sizes, seeds, st.integers(5, 40), st.floats(0.9, 0.9999), st.integers(20, 300), detrends)
def test_forgetting_equals_weighted_rows(
    size: tuple[int, int, int], seed: int, block: int, forgetting: float, count: int, detrend: str
) -> None:
    n_u, n_y, p = size
    v = draw(seed, p + count, n_u + n_y)
    closed = count // block
    of_row = np.minimum(np.arange(count) // block, closed)
    weights = np.where(of_row < closed, forgetting ** (block * (closed - 1.0 - of_row)), 1.0)
    rows = SquareRoot(n_u, n_y, p, block=block, forgetting=forgetting)
    for piece in np.array_split(v, 5):
        rows.add(piece)
    expected = reference.gram([v], p, detrend == "mean", weights)
    scale = np.linalg.norm(reference.gram([v], p, False, weights))
    assert np.linalg.norm(rows.gram(detrend)[0] - expected) <= 1e-12 * scale


@given(
    sizes, seeds, st.lists(st.tuples(st.integers(0, 399), st.integers(0, 5)), max_size=5), detrends,
    st.sampled_from([
        {}, {"block": 40, "slots": 3, "spare_slots": 2}, {"block": 25, "slots": 5}, {"block": 30, "forgetting": 0.995},
    ]),
)  # fmt: skip
def test_both_kernels_agree(
    size: tuple[int, int, int], seed: int, places: list[tuple[int, int]], detrend: str, shape: dict[str, float]
) -> None:
    n_u, n_y, p = size
    v = present(holes(draw(seed, 400, n_u + n_y), places))
    rows, sums = SquareRoot(n_u, n_y, p, **shape), Accumulator(n_u, n_y, p, **shape)  # type: ignore[arg-type]
    for piece in np.array_split(v, 9):
        rows.add(piece)
        sums.add(piece)
        assert rows.stats == sums.stats
        if rows.rows > 0:
            both = rows.gram(detrend), sums.gram(detrend)
            scale = np.linalg.norm(sums.gram("none")[0])
            assert np.linalg.norm(both[0][0] - both[1][0]) <= 1e-12 * scale
            np.testing.assert_allclose(both[0][1], both[1][1], rtol=1e-11, atol=1e-11)


def test_units_are_applied_at_the_end() -> None:
    v = np.random.default_rng(3).integers(-(2**15), 2**15, (200, 3)).astype(np.int16)
    scale, offset = np.array([1e-3, -2.5e-4, 0.1]), np.array([0.5, -1.0, 3.0])
    rows = SquareRoot(1, 2, 4)
    rows.set_units(scale, offset)
    rows.add(v)
    real = v * scale + offset
    for detrend in ("none", "mean"):
        gram, mean = rows.gram(detrend)
        assert close(gram, reference.gram([real], 4, detrend == "mean"))
        factor = rows.factor(detrend)[0]
        assert close(factor.T @ factor, gram[np.ix_(order(1, 2, 4), order(1, 2, 4))])
        assert np.all(np.diag(factor) >= 0)
        np.testing.assert_allclose(mean, real[4:].mean(axis=0), rtol=1e-12)


def test_all_kinds_of_numbers_give_the_same_bits() -> None:
    codes = np.random.default_rng(5).integers(-(2**15) + 1, 2**15 - 1, (300, 3))
    wide = np.zeros((300, 6))
    wide[:, ::2] = codes
    forms = [codes.astype(kind) for kind in (np.int16, np.int32, np.float32, np.float64, np.int64)]
    factors = []
    for form in [*forms, np.asfortranarray(forms[3]), wide[:, ::2], codes.tolist()]:
        rows = SquareRoot(1, 2, 4)
        assert rows.add(form) == abi.OK
        factors.append(rows.factor("mean")[0])
    for other in factors[1:]:
        np.testing.assert_array_equal(factors[0], other)


def test_full_scale_codes_are_counted() -> None:
    for kind in (np.int16, np.int32):
        v = np.zeros((10, 2), kind)
        v[3, 0], v[7, 1] = np.iinfo(kind).max, np.iinfo(kind).min
        rows = SquareRoot(1, 1, 2)
        assert rows.add(v) == abi.WARN_SATURATED
        assert (rows.stats.saturated, rows.stats.samples) == (2, 10)


def test_no_digit_is_spent_on_an_offset() -> None:
    codes = np.random.default_rng(6).integers(-1000, 1000, (500, 2)).astype(float)
    rows = SquareRoot(1, 1, 5)
    rows.add(codes + 2.0**40)
    assert close(rows.gram("mean")[0], reference.gram([codes], 5, True))


def test_a_wild_first_sample_does_no_lasting_harm() -> None:
    v = draw(8, 400, 2)
    v[0] = 1e13
    rows = SquareRoot(1, 1, 4, block=50, slots=3)
    rows.add(v)
    assert close(rows.gram("mean")[0], reference.gram([v[len(v) - rows.rows - 4 :]], 4, True))


def test_snapshot_and_reset() -> None:
    v = draw(5, 400, 3)
    shape = {"block": 32, "slots": 5}
    rows, twin = SquareRoot(1, 2, 4, **shape), SquareRoot(1, 2, 4, **shape)
    rows.set_units([2.0, 3.0, 4.0])
    rows.add(v[:250])
    kept, before = rows.snapshot(), rows.gram()[0]
    rows.restore(kept)
    rows.add(v[250:])
    after = rows.gram()[0]
    twin.restore(kept)
    twin.add(v[250:])
    np.testing.assert_array_equal(twin.gram()[0], after)
    rows.restore(kept)
    np.testing.assert_array_equal(rows.gram()[0], before)
    rows.reset()
    assert rows.stats == (0, 0, 0, 0, 0, 0)
    with pytest.raises(IdentificationError):
        rows.gram()
    rows.add(v[:250])
    np.testing.assert_array_equal(rows.gram()[0], before)
    with pytest.raises(InputError):
        rows.restore(kept[:-1])


def test_errors_leave_the_state_unchanged() -> None:
    rows = SquareRoot(1, 2, 3)
    for nothing in (rows.gram, rows.factor):
        with pytest.raises(IdentificationError):
            nothing()
    rows.add(draw(1, 30, 3))
    before = rows.snapshot()
    for wrong in (np.zeros((4, 2)), np.zeros(3), np.zeros((2, 3), complex), np.array([["a", "b", "c"]])):
        with pytest.raises(InputError):
            rows.add(wrong)
    others = (SquareRoot(1, 2, 4), SquareRoot(2, 1, 3), SquareRoot(1, 2, 3, block=9, slots=2), rows)
    for other in (*others, SquareRoot(1, 2, 3, block=9, forgetting=0.9)):
        with pytest.raises(InputError):
            rows.merge(other)
    with pytest.raises(InputError):
        rows.gram("linear")
    assert rows.snapshot() == before


@pytest.mark.parametrize(
    "wrong",
    [
        {"n_u": -1}, {"n_y": 0}, {"lags": 0}, {"lags": 4097}, {"n_u": 250}, {"forgetting": 0.0}, {"forgetting": 1.1},
        {"forgetting": 0.9}, {"slots": 2}, {"block": -1}, {"batch": -1}, {"batch": 1025}, {"block": 2, "slots": 65537},
        {"block": 2, "slots": 2, "spare_slots": -1}, {"block": 2, "slots": 2, "forgetting": 0.9},
    ],
)  # fmt: skip
def test_sizes_out_of_range(wrong: dict[str, float]) -> None:
    with pytest.raises(InputError):
        SquareRoot(**{"n_u": 1, "n_y": 10, "lags": 4, **wrong})  # type: ignore[arg-type]


# ---- the solver --------------------------------------------------------------------------------------------------


def quantised(v: np.ndarray, bits: int) -> np.ndarray:
    lsb = np.abs(v).max(axis=0) / (2.0 ** (bits - 1) - 1.0)
    return np.round(v / lsb) * lsb


def lightly_damped(zeta: float) -> systems.Structure:
    plain = systems.w1()
    damping, _ = systems.rayleigh(plain.M, plain.K, zeta)
    return replace(plain, R=damping)


def least_squares(v: np.ndarray, n_u: int, p: int) -> np.ndarray:
    """theta by SVD of unit columns; minimum norm where the data do not determine it."""
    m = v.shape[1]
    rows = reference.lagged([v], p)
    phi, y = np.hstack([rows[:, :n_u], rows[:, m:]]), rows[:, n_u:m]
    scale = 1.0 / np.linalg.norm(phi, axis=0)
    return (np.linalg.lstsq(phi * scale, y, rcond=1e-12)[0] * scale[:, None]).T


def markov(theta: np.ndarray, n_u: int, p: int) -> np.ndarray:
    return reference.markov(reference.Observer(theta, n_u, len(theta), p, 0.0), 2 * p)


def true_markov(s: systems.Structure, count: int) -> np.ndarray:
    A, B, C, D = s.discrete()
    out, x = [D], B
    for _ in range(count):
        out.append(C @ x)
        x = A @ x
    return np.array(out)


@pytest.mark.parametrize("bits", [16, 24])
def test_lightly_damped_without_noise(bits: int) -> None:
    """W1 with 0.1 % damping, quantised only: cond(V) up to 4e7: the Gram matrix leaves 1e-9."""
    s, p = lightly_damped(1e-3), 20
    u, y = systems.record(s, 10000, 0.0, 1)
    v = quantised(np.hstack([u, y]), bits)
    rows = SquareRoot(1, 3, p)
    rows.add(v)
    found = rows.observer("none")
    assert found.radius < 1.0
    assert close(markov(found.theta, 1, p), markov(least_squares(v, 1, p), 1, p), 1e-12)
    with Accumulator(1, 3, p) as sums:
        sums.add(v)
        assert close(sums.gram("none")[0], rows.gram("none")[0], 1e-12)


@pytest.mark.parametrize(("s", "p"), [(systems.w1(), 20), (lightly_damped(1e-3), 20), (systems.w2(), 15)])
@pytest.mark.parametrize("detrend", ["none", "mean"])
def test_noise_free_data_are_rank_deficient(s: systems.Structure, p: int, detrend: str) -> None:
    u, y = systems.record(s, 6000, 0.0, 2)
    n_u = u.shape[1]
    v = np.hstack([u, y]) + (7.0 if detrend == "mean" else 0.0)
    rows = SquareRoot(n_u, y.shape[1], p)
    rows.add(v)
    found = rows.observer(detrend)
    assert found.radius == found.radius_plain < 1.0
    assert found.condition > 1e20  # of the Gram matrix: the ridge alone holds it
    assert close(markov(found.theta, n_u, p), true_markov(s, 2 * p), 1e-12)
    assert np.max(np.abs(found.innovation)) <= 1e-24 * np.max(y**2)


@given(seeds, st.sampled_from([1.0, 1e-6, 1e6]))
def test_noisy_solution_equals_least_squares(seed: int, force_unit: float) -> None:
    s, p = systems.w1(), 8
    u, y = systems.record(s, 1500, 2.0, seed)
    v = np.hstack([u * force_unit, y])
    rows = SquareRoot(1, 3, p)
    rows.add(v)
    found = rows.observer("none")
    expected = least_squares(v, 1, p)
    assert np.max(np.abs(found.theta - expected) / np.max(np.abs(expected), axis=0)) < 1e-9
    lagged = reference.lagged([v], p)
    residual = lagged[:, 1:4] - np.hstack([lagged[:, :1], lagged[:, 4:]]) @ expected.T
    assert close(found.innovation, residual.T @ residual / (len(lagged) - expected.shape[1]), 1e-9)
    unit = 1.0 / np.sqrt(np.diag(lagged.T @ lagged))
    columns = np.delete(np.arange(lagged.shape[1]), [1, 2, 3])
    gram = (lagged * unit)[:, columns].T @ (lagged * unit)[:, columns]
    true_condition = np.linalg.norm(gram, 1) * np.linalg.norm(np.linalg.inv(gram), 1)
    assert 0.1 * true_condition <= found.condition <= 1.001 * true_condition
    assert 0.3 < found.input_excitation <= 1.0


def test_an_unstable_model_gets_the_ridge_of_the_other_solver() -> None:
    """Trap 22: outputs behind a steep filter that the force does not see."""
    s, p = systems.w1(), 10
    u, y = systems.record(s, 4000, 0.0, 9)
    taps = 0.7 * np.sinc(0.7 * np.arange(-24, 25)) * np.hamming(49)
    noise = 1e-3 * np.std(y) * np.random.default_rng(4).standard_normal(y.shape)
    filtered = np.column_stack([np.convolve(c, taps, "same") for c in y.T]) + noise
    v = np.hstack([u, filtered])
    rows, sums = SquareRoot(1, 3, p), Accumulator(1, 3, p)
    rows.add(v)
    sums.add(v)
    left = rows.observer("mean", stabilise=False)
    assert left.radius == left.radius_plain > 1.05
    found = rows.observer("mean")
    theta, info = solve_gram(sums, "mean", True)
    assert found.radius < 1.0 < found.radius_plain
    assert found.ridge == pytest.approx(info.ridge, rel=1e-12)
    assert found.radius == pytest.approx(info.radius, rel=1e-6)
    assert close(found.theta, theta, 1e-6)
    asked = rows.observer("mean", ridge_min=1e-3, stabilise=False)
    assert asked.ridge == 1e-3


def test_what_the_data_do_not_determine_is_refused() -> None:
    rng = np.random.default_rng(2)
    v = rng.standard_normal((600, 5))

    def attempt(samples: np.ndarray, code: int, p: int = 4) -> None:
        rows = SquareRoot(2, 3, p)
        rows.add(samples)
        with pytest.raises(IdentificationError) as caught:
            rows.observer("mean")
        assert caught.value.status == code

    rows = SquareRoot(2, 3, 4)
    rows.add(v)
    assert rows.observer("mean").theta.shape == (3, 22)
    attempt(v[: 4 + 21], abi.ERR_TOO_SHORT)
    constant = v.copy()
    constant[:, 1] = 0.1
    attempt(constant, abi.ERR_INPUT)
    constant = v.copy()
    constant[:, 4] = -3.3
    attempt(constant, abi.ERR_OUTPUT)
    twice = v.copy()
    twice[:, 1] = 2.0 * twice[:, 0] + 1.0
    attempt(twice, abi.ERR_EXCITATION)
    sines = v.copy()
    sines[:, 0], sines[:, 1] = np.sin(0.3 * np.arange(600)), np.cos(0.5 * np.arange(600))
    attempt(sines, abi.ERR_EXCITATION, p=8)
