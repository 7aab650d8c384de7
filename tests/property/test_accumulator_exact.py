# SPDX-License-Identifier: MIT
"""Codes are summed exactly: however a record is cut, split by gaps, windowed or merged, the same bits come out."""

from __future__ import annotations

import numpy as np
import pytest
import reference
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray
from okid import Accumulator, InputError

sizes = st.tuples(st.integers(0, 3), st.integers(1, 3), st.integers(1, 5))  # n_u, n_y, p
seeds = st.integers(0, 2**31)
widths = st.sampled_from([16, 24, 32])
Codes = NDArray[np.signedinteger]


def draw(seed: int, count: int, channels: int, bits: int) -> Codes:
    """Codes over the whole range, with one channel that stands at an offset."""
    half = 2 ** (bits - 1)
    v = np.random.default_rng(seed).integers(-half, half, (count, channels))
    v[:, 0] = half // 2 + v[:, 0] // 1000
    return v.astype(np.int16 if bits == 16 else np.int32)


def exact(records: list[Codes], p: int) -> NDArray[np.float64]:
    """Every entry of the Gram matrix from Python integers, rounded once."""
    return np.array(reference.gram_exact(records, p), dtype=object).astype(float)


@given(sizes, seeds, widths, st.lists(st.tuples(st.integers(1, 60), st.integers(0, 3)), min_size=1, max_size=6))
def test_splits_and_gaps(size: tuple[int, int, int], seed: int, bits: int, pieces: list[tuple[int, int]]) -> None:
    n_u, n_y, p = size
    v = draw(seed, sum(n for n, _ in pieces), n_u + n_y, bits)
    records: list[Codes] = [v[:0]]
    with Accumulator(n_u, n_y, p, codes=bits) as sums, Accumulator(n_u, n_y, p, codes=bits, buffer=1) as small:
        at = 0
        for count, gap in pieces:
            part = v[at : at + count]
            at += count
            sums.add(part)
            for each in np.array_split(part, 3):
                small.add(each)
            records[-1] = np.concatenate([records[-1], part])
            if gap:
                sums.gap(gap)
                small.gap(gap)
                records.append(v[:0])
        assert sums.rows == small.rows == sum(max(0, len(r) - p) for r in records)
        assert sums.to_bytes() == small.to_bytes()
        if sums.rows > 0:
            np.testing.assert_array_equal(sums.gram("none")[0], exact([r for r in records if len(r)], p))


@given(sizes, seeds, widths, st.permutations(range(4)), st.booleans())
def test_merge_order(size: tuple[int, int, int], seed: int, bits: int, order: list[int], centre: bool) -> None:
    n_u, n_y, p = size
    records = [draw(seed + k, 12 + 9 * k, n_u + n_y, bits) // (k + 2) for k in range(4)]

    def summed(record: Codes) -> Accumulator:
        sums = Accumulator(n_u, n_y, p, codes=bits)
        sums.add(record.astype(np.int16 if bits == 16 else np.int32))
        if centre:
            sums.centre()
        return sums

    chain = summed(records[order[0]])
    for k in order[1:]:
        chain.merge(summed(records[k]))
    left, right = summed(records[0]), summed(records[2])
    left.merge(summed(records[1]))
    right.merge(summed(records[3]))
    left.merge(right)
    written = Accumulator.from_bytes(left.to_bytes())
    np.testing.assert_array_equal(chain.gram("mean")[0], left.gram("mean")[0])
    np.testing.assert_array_equal(chain.gram("none")[0], written.gram("none")[0])
    if not centre:
        np.testing.assert_array_equal(left.gram("none")[0], exact(records, p))
        return
    expected = reference.gram([r - r[p:].mean(axis=0) for r in records], p, False)
    amplitude = float(np.sqrt(np.diag(expected).max()))
    left_of_means = 2.0**-9 * np.sqrt(sum(len(r) - p for r in records))  # of each lag row
    atol = 1e-12 * amplitude**2 + left_of_means * (2 * amplitude + left_of_means)
    np.testing.assert_allclose(left.gram("none")[0], expected, rtol=0, atol=atol)


@given(sizes, seeds, widths, st.integers(1, 20), st.integers(1, 4), st.integers(1, 120), st.integers(1, 9))
def test_window(
    size: tuple[int, int, int], seed: int, bits: int, block: int, slots: int, count: int, cuts: int
) -> None:
    n_u, n_y, p = size
    v = draw(seed, p + count, n_u + n_y, bits)
    shape = {"codes": bits, "block": block, "slots": slots}
    with Accumulator(n_u, n_y, p, **shape) as sums, Accumulator(n_u, n_y, p, **shape, buffer=3) as small:
        sums.add(v)
        for piece in np.array_split(v, cuts):
            small.add(piece)
        last = v[len(v) - sums.rows - p :]
        np.testing.assert_array_equal(sums.gram("none")[0], exact([last], p))
        np.testing.assert_array_equal(sums.gram("mean")[0], small.gram("mean")[0])


@given(sizes, seeds, st.lists(st.integers(0, 299), max_size=6))
def test_saturated_codes_as_missing(size: tuple[int, int, int], seed: int, holes: list[int]) -> None:
    n_u, n_y, p = size
    v = draw(seed, 300, n_u + n_y, 16)
    v[v == -32768] = 1
    v[v == 32767] = 1
    for k, hole in enumerate(holes):
        v[hole, k % (n_u + n_y)] = 32767 if k % 2 else -32768
    whole = np.all((v > -32768) & (v < 32767), axis=1)
    edges = np.flatnonzero(np.diff(np.concatenate([[0], whole.astype(int), [0]])))
    records = [v[a:b] for a, b in edges.reshape(-1, 2)]
    with Accumulator(n_u, n_y, p, codes=16, saturated="missing") as sums:
        sums.add(v)
        assert sums.stats.saturated == len({(hole, k % (n_u + n_y)) for k, hole in enumerate(holes)})
        assert sums.stats.missing == 300 - whole.sum()
        np.testing.assert_array_equal(sums.gram("none")[0], exact(records, p))


@given(sizes, seeds, st.sampled_from([0, 16, 32]), st.sampled_from(["mean", "none"]))
def test_sums_of_one_run(size: tuple[int, int, int], seed: int, bits: int, detrend: str) -> None:
    n_u, n_y, p = size
    v = draw(seed, p + 40, n_u + n_y, bits or 16)
    with Accumulator(n_u, n_y, p, codes=bits) as sums:
        sums.set_units(1e-3, 0.5)
        sums.add(v if bits else v.astype(float))
        s, head, tail, total = sums.run_sums(detrend)
        gram = sums.gram(detrend)[0]
        m, rows = n_u + n_y, sums.rows
        g = np.concatenate([total] + [total + (head[:b] - tail[:b]).sum(axis=0) for b in range(1, p + 1)])
        corner = np.block([[s[b - a] if b >= a else s[a - b].T for b in range(p + 1)] for a in range(p + 1)])
        for a in range(1, p + 1):
            for b in range(a, p + 1):
                for k in range(a):
                    edge = np.outer(head[a - 1 - k], head[b - 1 - k]) - np.outer(tail[a - 1 - k], tail[b - 1 - k])
                    corner[a * m : (a + 1) * m, b * m : (b + 1) * m] += edge
        upper = np.triu(corner) - np.triu(np.outer(g, g)) / rows * (detrend == "mean")
        size_of_sums = np.abs(gram).max() if bits else np.abs(sums.gram("none")[0]).max()  # doubles keep no more digits
        np.testing.assert_allclose(upper, np.triu(gram), rtol=0, atol=1e-12 * size_of_sums)
        sums.gap(1)
        sums.add(v if bits else v.astype(float))
        with pytest.raises(InputError):
            sums.run_sums(detrend)


def test_damaged_bytes_are_refused() -> None:
    with Accumulator(1, 2, 3, codes=16) as sums:
        sums.add(draw(1, 50, 3, 16))
        written = sums.to_bytes()
        for wrong in (b"", written[:-1], written[:40] + b"\x07" + written[41:], b"X" + written[1:]):
            with pytest.raises(InputError):
                Accumulator.from_bytes(wrong)
        assert sums.to_bytes() == written


@pytest.mark.parametrize("wrong", [{"slots": 2, "block": 5}, {"forgetting": 0.9, "block": 5}, {"edges": False}])
def test_what_cannot_be_centred(wrong: dict[str, float]) -> None:
    with Accumulator(1, 2, 3, **wrong) as sums:  # type: ignore[arg-type]
        sums.add(np.ones((40, 3)))
        with pytest.raises(InputError):
            sums.centre()
