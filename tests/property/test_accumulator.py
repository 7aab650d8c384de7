# SPDX-License-Identifier: MIT
"""The accumulator of the library against explicit sums over explicit rows."""

from __future__ import annotations

import ctypes
import pickle
import subprocess
import sys

import numpy as np
import pytest
import reference
from hypothesis import given
from hypothesis import strategies as st
from okid import Accumulator, Error, IdentificationError, InputError, abi

sizes = st.tuples(st.integers(0, 3), st.integers(1, 3), st.integers(1, 5))  # n_u, n_y, p
seeds = st.integers(0, 2**31)


def close(left: np.ndarray, right: np.ndarray, tolerance: float = 1e-9) -> bool:
    return float(np.linalg.norm(left - right)) <= tolerance * float(np.linalg.norm(right))


def draw(seed: int, count: int, channels: int) -> np.ndarray:
    rng = np.random.default_rng(seed)
    return rng.standard_normal((count, channels)) * rng.uniform(0.1, 10.0, channels) + rng.uniform(-2.0, 2.0, channels)


def codes(seed: int, count: int, channels: int, bits: int = 16) -> np.ndarray:
    half = 2 ** (bits - 1)
    drawn = np.random.default_rng(seed).integers(-half, half, (count, channels))
    return drawn.astype(np.int16 if bits == 16 else np.int32)


@given(sizes, seeds, st.integers(1, 200), st.sampled_from(["none", "mean"]))
def test_gram_equals_explicit_rows(size: tuple[int, int, int], seed: int, extra: int, detrend: str) -> None:
    n_u, n_y, p = size
    v = draw(seed, p + 4 + extra, n_u + n_y)
    with Accumulator(n_u, n_y, p) as sums:
        sums.add(v)
        gram, mean = sums.gram(detrend)
        assert sums.rows == len(v) - p
    assert close(gram, reference.gram([v], p, detrend == "mean"))
    np.testing.assert_array_equal(gram, gram.T)
    np.testing.assert_allclose(mean, v[p:].mean(axis=0), rtol=1e-9, atol=1e-12)


@given(sizes, seeds, st.integers(1, 50))
def test_codes_are_summed_exactly(size: tuple[int, int, int], seed: int, extra: int) -> None:
    n_u, n_y, p = size
    v = codes(seed, p + extra, n_u + n_y)
    with Accumulator(n_u, n_y, p, codes=16) as sums:
        sums.add(v)
        gram, _ = sums.gram("none")
    exact = reference.gram_exact([v], p)
    assert [[int(x) for x in row] for row in gram] == exact
    assert np.all(gram == np.round(gram))


@given(sizes, seeds, st.integers(1, 40), st.sampled_from([24, 32]))
def test_wide_codes_are_summed_exactly(size: tuple[int, int, int], seed: int, extra: int, bits: int) -> None:
    n_u, n_y, p = size
    v = codes(seed, p + extra, n_u + n_y, bits)
    with Accumulator(n_u, n_y, p, codes=bits) as sums, Accumulator(n_u, n_y, p, codes=bits) as split:
        sums.add(v)
        for piece in np.array_split(v, 3):
            split.add(piece)
        gram = sums.gram("none")[0]
        np.testing.assert_array_equal(gram, split.gram("none")[0])
    exact = np.array(reference.gram_exact([v], p), dtype=float)  # each entry rounded once
    np.testing.assert_allclose(gram, exact, rtol=2.3e-16, atol=0.0)


def test_a_word_that_is_no_24_bit_code_is_refused() -> None:
    v = codes(1, 20, 2, 24)
    wrong = v.copy()
    wrong[7, 1] = 2**23
    with Accumulator(1, 1, 2, codes=24) as sums:
        sums.add(v)
        before = sums.to_bytes()
        with pytest.raises(InputError):
            sums.add(wrong)
        assert sums.to_bytes() == before


@given(sizes, seeds, st.lists(st.integers(0, 300), max_size=8), st.booleans(), st.booleans())
def test_any_split_gives_the_same_bits(
    size: tuple[int, int, int], seed: int, cuts: list[int], whole: bool, edges: bool
) -> None:
    n_u, n_y, p = size
    v = codes(seed, 300, n_u + n_y) if whole else draw(seed, 300, n_u + n_y)
    with (
        Accumulator(n_u, n_y, p, codes=16 * whole, edges=edges) as one,
        Accumulator(n_u, n_y, p, codes=16 * whole) as many,
    ):
        one.add(v)
        for piece in np.split(v, sorted(cuts)):
            many.add(piece)
        assert many.stats == one.stats
        np.testing.assert_array_equal(many.gram("mean")[0], one.gram("mean")[0])


@given(sizes, seeds, st.lists(st.tuples(st.integers(0, 119), st.integers(0, 5)), max_size=6), st.booleans())
def test_missing_samples_leave_their_rows_out(
    size: tuple[int, int, int], seed: int, holes: list[tuple[int, int]], split: bool
) -> None:
    n_u, n_y, p = size
    v = draw(seed, 120, n_u + n_y)
    for sample, channel in holes:
        v[sample, channel % (n_u + n_y)] = np.nan if sample % 2 else np.inf
    lost = ~np.all(np.isfinite(v), axis=1)
    with Accumulator(n_u, n_y, p) as sums:
        for piece in np.split(v, [41, 43, 90]) if split else [v]:
            sums.add(piece)
        stats = sums.stats
        assert stats.missing == lost.sum()
        assert stats.samples == len(v) - lost.sum()
        assert stats.gaps == lost[0] + np.sum(lost[1:] & ~lost[:-1])
        rows = reference.lagged([v], p)
        assert stats.rows == len(rows)
        if len(rows) > 1:
            assert close(sums.gram("none")[0], reference.gram([v], p, False))
            assert close(sums.gram("mean")[0], reference.gram([v], p, True), 1e-9 * max(1.0, np.ptp(rows) ** 2))


def test_told_gaps_count_and_separate() -> None:
    v = draw(1, 80, 2)
    with Accumulator(1, 1, 3) as sums:
        sums.add(v[:40])
        sums.gap(7)
        sums.add(v[40:])
        sums.gap(0)
        assert (sums.stats.missing, sums.stats.gaps) == (7, 1)
        assert close(sums.gram("none")[0], reference.gram([v[:40], v[40:]], 3, False))


@given(sizes, seeds, st.booleans())
def test_merging_equals_one_accumulator_over_all_records(size: tuple[int, int, int], seed: int, whole: bool) -> None:
    n_u, n_y, p = size
    make = codes if whole else draw
    records = [make(seed + k, 30 + 7 * k, n_u + n_y) for k in range(3)]
    parts = [Accumulator(n_u, n_y, p, codes=16 * whole) for _ in records]
    for part, record in zip(parts, records, strict=True):
        part.add(record)
    forward, backward = parts[0].copy(), parts[2].copy()
    for part in (parts[1], parts[2]):
        forward.merge(part)
    for part in (parts[1], parts[0]):
        backward.merge(part)
    gram = forward.gram("none")[0]
    if whole:
        assert [[int(x) for x in row] for row in gram] == reference.gram_exact(records, p)
        np.testing.assert_array_equal(gram, backward.gram("none")[0])
    assert close(gram, reference.gram(records, p, False))
    assert close(backward.gram("mean")[0], reference.gram(records, p, True))
    assert forward.rows == sum(len(r) - p for r in records)


@given(sizes, seeds, st.integers(1, 30), st.integers(1, 5), st.integers(10, 400), st.booleans())
def test_window_holds_exactly_the_last_rows(
    size: tuple[int, int, int], seed: int, block: int, slots: int, count: int, whole: bool
) -> None:
    n_u, n_y, p = size
    v = codes(seed, p + count, n_u + n_y) if whole else draw(seed, p + count, n_u + n_y)
    with Accumulator(n_u, n_y, p, codes=16 * whole, block=block, slots=slots) as sums:
        for piece in np.array_split(v, 7):
            sums.add(piece)
        kept = sums.rows
        assert min(count, slots * block) <= kept < min(count + 1, (slots + 1) * block + 1)
        last = v[len(v) - kept - p :]
        gram = sums.gram("none")[0]
        if whole:
            assert [[int(x) for x in row] for row in gram[:2]] == reference.gram_exact([last], p)[:2]
        assert close(gram, reference.gram([last], p, False))
        if kept > 1:
            assert close(sums.gram("mean")[0], reference.gram([last], p, True), 1e-8)


@given(sizes, seeds, st.integers(5, 40), st.floats(0.9, 0.9999), st.integers(20, 300), st.booleans())
def test_forgetting_equals_weighted_rows(
    size: tuple[int, int, int], seed: int, block: int, forgetting: float, count: int, whole: bool
) -> None:
    n_u, n_y, p = size
    v = codes(seed, p + count, n_u + n_y) if whole else draw(seed, p + count, n_u + n_y)
    closed = count // block
    of_row = np.minimum(np.arange(count) // block, closed)
    weights = np.where(of_row < closed, forgetting ** (block * (closed - 1.0 - of_row)), 1.0)
    with Accumulator(n_u, n_y, p, codes=16 * whole, block=block, forgetting=forgetting) as sums:
        for piece in np.array_split(v, 5):
            sums.add(piece)
        assert close(sums.gram("none")[0], reference.gram([v], p, False, weights))
        assert close(sums.gram("mean")[0], reference.gram([v], p, True, weights), 1e-8)


def test_units_are_applied_to_codes() -> None:
    v = codes(3, 200, 3)
    scale, offset = np.array([1e-3, 2.5e-4, 0.1]), np.array([0.5, -1.0, 3.0])
    with Accumulator(1, 2, 4, codes=16) as sums:
        sums.set_units(scale, offset)
        sums.add(v)
        assert close(sums.gram("none")[0], reference.gram([v * scale + offset], 4, False))
        assert close(sums.gram("mean")[0], reference.gram([v * scale + offset], 4, True))


def test_full_scale_codes_are_counted() -> None:
    v = np.zeros((10, 2), np.int16)
    v[3, 0], v[7, 1] = 32767, -32768
    with Accumulator(1, 1, 2, codes=16) as sums:
        assert sums.add(v) == abi.WARN_SATURATED
        assert sums.stats.saturated == 2


@pytest.mark.parametrize("whole", [False, True])
def test_snapshot_copy_and_pickle(whole: bool) -> None:
    v = codes(5, 400, 3) if whole else draw(5, 400, 3)
    with Accumulator(1, 2, 4, codes=16 * whole, block=32, slots=5) as sums:
        sums.add(v[:250])
        kept, twin, thawed = sums.to_bytes(), sums.copy(), pickle.loads(pickle.dumps(sums))
        before = sums.gram()[0]
        sums.add(v[250:])
        after = sums.gram()[0]
        np.testing.assert_array_equal(twin.gram()[0], before)
        for other in (twin, thawed):
            other.add(v[250:])
            np.testing.assert_array_equal(other.gram()[0], after)
        sums.restore(kept)
        np.testing.assert_array_equal(sums.gram()[0], before)
        sums.reset()
        assert sums.rows == 0
        with pytest.raises(InputError):
            sums.restore(kept[:-1])


def test_errors_leave_the_state_unchanged() -> None:
    with Accumulator(1, 2, 3) as sums, Accumulator(1, 2, 2) as shorter, Accumulator(1, 2, 3, codes=16) as exact:
        with pytest.raises(IdentificationError):
            sums.gram()
        sums.add(draw(1, 30, 3))
        before = sums.to_bytes()
        for wrong in (np.zeros((4, 2)), np.zeros(3), np.zeros((2, 3), complex), np.array([["a", "b", "c"]])):
            with pytest.raises(InputError):
                sums.add(wrong)
        for other in (shorter, exact):
            with pytest.raises(InputError):
                sums.merge(other)
        with pytest.raises(InputError):
            exact.add(np.zeros((3, 3)))
        with pytest.raises(InputError):
            sums.gram("linear")
        assert sums.to_bytes() == before
    with pytest.raises(Error):
        sums.rows  # noqa: B018 - closed above


@pytest.mark.parametrize(
    "wrong",
    [
        {"n_u": -1}, {"n_y": 0}, {"lags": 0}, {"lags": 4097}, {"n_u": 250}, {"forgetting": 0.0}, {"forgetting": 1.1},
        {"forgetting": 0.9}, {"slots": 2}, {"block": -1},
    ],
)  # fmt: skip
def test_sizes_out_of_range(wrong: dict[str, float]) -> None:
    with pytest.raises(InputError):
        Accumulator(**{"n_u": 1, "n_y": 10, "lags": 4, **wrong})  # type: ignore[arg-type]


def test_block_too_small_or_absent() -> None:
    library, config = abi.library(), abi.AccumulatorConfig(1, 2, 4, 0, 0, 0, 1.0, 1, 0)
    needed = library.okid_accumulator_memsize(ctypes.byref(config))
    handle, memory = ctypes.c_void_p(), abi.block(needed)
    create = library.okid_accumulator_create
    args = (ctypes.byref(handle), ctypes.byref(config))
    assert create(*args, memory.ctypes.data, needed - 1) == abi.ERR_MEMORY
    assert create(*args, None, needed) == abi.ERR_NULL
    assert create(None, args[1], memory.ctypes.data, needed) == abi.ERR_NULL
    assert create(*args, memory.ctypes.data, needed) == abi.OK
    shifted = np.zeros(needed + 8, np.uint8)
    assert create(*args, shifted.ctypes.data + 1, needed) == abi.OK  # any alignment: the slack is inside memsize


def test_float32_and_lists_and_strided_arrays() -> None:
    v = draw(2, 60, 2).astype(np.float32)
    wide = np.zeros((60, 4))
    wide[:, ::2] = v
    grams = []
    for given_samples in (v, v.tolist(), wide[:, ::2], np.asfortranarray(v.astype(float))):
        with Accumulator(1, 1, 3) as sums:
            sums.add(given_samples)
            grams.append(sums.gram()[0])
    for other in grams[1:]:
        np.testing.assert_array_equal(grams[0], other)


def test_a_pickle_works_in_another_process() -> None:
    """The block holds no addresses: a worker process goes on where this one stopped."""
    rng = np.random.default_rng(4)
    codes = rng.integers(-9000, 9000, (9000, 8), dtype=np.int16)
    sums = Accumulator(2, 6, 40, codes=16)
    sums.add(codes[:6000])
    program = (
        "import pickle, sys; import numpy as np; sums, rest = pickle.load(sys.stdin.buffer); sums.add(rest);"
        "sys.stdout.buffer.write(sums.gram('mean')[0].tobytes())"
    )
    done = subprocess.run(
        [sys.executable, "-c", program], input=pickle.dumps((sums, codes[6000:])), capture_output=True, check=True
    )
    sums.add(codes[6000:])
    np.testing.assert_array_equal(np.frombuffer(done.stdout), sums.gram("mean")[0].ravel())
