# SPDX-License-Identifier: MIT
"""States of a stream: damaged anywhere, of another rate, of other channels, of the other kind of method. Before, auto
took 100 of 100 flipped bits, and gave 500 Hz as 1000."""

from __future__ import annotations

import contextlib
import re
import struct
import zlib
from typing import Any

import numpy as np
import okid
import pytest

ROWS = np.random.default_rng(3).standard_normal((40, 3))
KINDS: list[dict[str, Any]] = [{}, {"method": "okid-era", "p": 2, "order": 2}]
NAMED = {"inputs": ["f"], "outputs": ["a", "b"]}


def session(kind: dict[str, Any], **more: Any) -> okid.Session:
    given: dict[str, Any] = {"fs": 500.0, **NAMED, **kind, **more}
    return okid.Session(**given)


def fed(kind: dict[str, Any], **more: Any) -> okid.Session:
    one = session(kind, **more)
    one.feed(ROWS)
    return one


def refused(one: okid.Session, state: bytes, words: str) -> None:
    """By restore() and merge(), in one line, and nothing is changed."""
    before = one.to_bytes()
    for take in (one.restore, one.merge):
        with pytest.raises(okid.InputError, match=words) as told:
            take(state)
        assert "\n" not in str(told.value)
    assert one.to_bytes() == before


@pytest.mark.parametrize("kind", KINDS)
def test_every_flipped_bit_is_noticed(kind: dict[str, Any]) -> None:
    state = fed(kind).to_bytes()
    one = session(kind)
    for at in range(len(state)):
        flipped = bytearray(state)
        flipped[at] ^= 1 << (at % 8)
        with pytest.raises(okid.InputError):
            one.restore(bytes(flipped))
    for size in range(len(state)):
        with pytest.raises(okid.InputError):
            one.restore(state[:size])
    assert one.samples == 0
    one.restore(state)
    assert one.samples == len(ROWS) and one.to_bytes() == state


@pytest.mark.parametrize("kind", KINDS)
def test_another_rate_and_other_channels(kind: dict[str, Any]) -> None:
    state = fed(kind).to_bytes()
    refused(session(kind, fs=1000.0), state, re.escape("is of a stream of 500 Hz; expected 1000 Hz"))
    refused(session(kind, outputs=["b", "a"]), state, re.escape("is of the outputs a, b; expected b, a"))
    refused(session(kind, inputs=["g"]), state, re.escape("is of the inputs f; expected g"))
    three = session(kind, outputs=["a", "b", "c"])
    refused(three, state, re.escape("is of the outputs a, b; expected a, b, c"))
    odd = session(kind, inputs=["f\x1b[31m"])
    refused(odd, state, "is of the inputs f; expected f")
    refused(session(kind), odd.to_bytes(), re.escape(r"is of the inputs f\x1b[31m; expected f"))


def test_samples_are_no_sums() -> None:
    samples, sums = (fed(kind) for kind in KINDS)
    refused(sums, samples.to_bytes(), "is of method auto .* expected one of a named method")
    refused(samples, sums.to_bytes(), "is of a named method .* expected one of method auto")


def test_states_without_a_head() -> None:
    """Of auto they are refused, with the reason; sums of 0.1 and of okid.Accumulator are read as ever."""
    samples, sums = (fed(kind) for kind in KINDS)
    bare = samples.to_bytes()
    bare = bare[int.from_bytes(bare[8:16], "little") :]
    assert bare.startswith(b"okid.rec")
    for one in (samples, sums):
        refused(one, bare, "of method auto keeps no rate and no names of channels")
    plain = okid.Accumulator(1, 2, 2)
    plain.add(ROWS)
    again = session(KINDS[1])
    again.restore(plain.to_bytes())
    assert again.samples == len(ROWS)
    assert okid.Accumulator.from_bytes(sums.to_bytes()).to_bytes() == plain.to_bytes()


def head(text: bytes, body: bytes = b"", size: int | None = None) -> bytes:
    """A head with its check sum made right."""
    first = b"OKIDSTR\n" + struct.pack("<Q", 20 + len(text) if size is None else size)
    return first + struct.pack("<I", zlib.crc32(text + body, zlib.crc32(first))) + text + body


ABOUT = b'{"keeps": "samples", "rate_hz": 500.0, "inputs": ["f"], "outputs": ["a", "b"]}'
FORGED = {
    "nested": b"[" * 100000, "empty": b"", "a list": b"[]", "no rate": b'{"keeps": "samples"}',
    "not UTF-8": b'{"\xff": 1}',
    "a text for the rate": ABOUT.replace(b"500.0", b'"500"'), "names of numbers": ABOUT.replace(b'"f"', b"1"),
    "a name for the names": ABOUT.replace(b'["f"]', b'"f"'),
}  # fmt: skip


@pytest.mark.parametrize("what", list(FORGED))
def test_forged_heads(what: str) -> None:
    refused(session({}), head(FORGED[what]), "head cannot be read")


def test_forged_samples() -> None:
    one, mark = session({}), b"okid.rec"
    for size in (0, 19, 2**63, 2**64 - 1):
        refused(one, head(ABOUT, b"", size), "size differs from its header")
    for numbers in ((1, 2, 1, 2**61), (1, 2, 2**61, 0), (1, 2, -1, -1), (1, 2, 1, 2)):
        refused(one, head(ABOUT, mark + struct.pack("<4q", *numbers)), "size differs from its header")
    refused(one, head(ABOUT, mark + struct.pack("<4q", 1, 1, 0, 0)), "is of 1 inputs and 1 outputs")
    refused(one, head(ABOUT, mark + struct.pack("<6q", 1, 2, 2, 1, 2, 1) + bytes(24)), "not in order")
    refused(one, head(ABOUT.replace(b"500.0", b"1e999")), "head cannot be read|of a stream of inf")


@pytest.mark.parametrize("kind", [okid.Accumulator, okid.SquareRoot])
def test_counts_do_not_leave_their_range_by_merging(kind: Any) -> None:
    """Release 0.2: -9223372036854775808 missing samples."""
    one, two = kind(1, 2, 5), kind(1, 2, 5)
    for sums in (one, two):
        sums.add(ROWS)
        sums.gap(2**62)
    before = one.stats
    with pytest.raises(okid.InputError, match="would leave its range"):
        one.merge(two)
    assert one.stats == before
    one.add(ROWS)  # the clock is beyond the end: a gap has no room, and takes nothing back
    one.gap(3)
    assert one.stats.missing == before.missing and one.stats.samples == 2 * len(ROWS)
    three = kind(1, 2, 5)
    for _ in range(200):  # doubles each time
        three.add(ROWS)
        four = kind(1, 2, 5)
        four.merge(three)
        try:
            three.merge(four)
        except okid.InputError:
            break
    assert 2**61 <= three.stats.samples <= 2**62 and 0 < three.rows <= three.stats.samples


@pytest.mark.parametrize("kind", KINDS)
def test_counts_of_streams(kind: dict[str, Any]) -> None:
    one, two = fed(kind), fed(kind)
    for stream in (one, two):
        stream.gap(2**62 - 100)
    before, after = one.stats, None
    with contextlib.suppress(okid.InputError):
        one.merge(two.to_bytes())
        after = one.stats
    assert one.stats == before if after is None else min(after) >= 0 and after.samples == 2 * len(ROWS)
    with pytest.raises(okid.InputError, match=r"count: found 5000, expected 0 to \d+$"):
        one.gap(5000)
