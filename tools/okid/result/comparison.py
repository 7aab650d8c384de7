# SPDX-License-Identifier: MIT
"""Two results of one structure, mode by mode: shifts with their standard deviations, and which are more than chance."""

from __future__ import annotations

import ctypes
import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from okid._errors import InputError
from okid.abi import host
from okid.data.input_file import read_input
from okid.result.result import Result
from okid.shown.notebook_html import items, own_fields, short, summary, table

Place = str | Path
Known = Result | Mapping[str, Any] | Place


class ComparedMode(NamedTuple):
    """One side of a pair: number in its result, from 1, values and standard deviations (None: not known)."""

    mode: int
    frequency_hz: float
    frequency_std_hz: float | None
    damping_ratio: float
    damping_ratio_std: float | None

    def _repr_html_(self) -> str:
        return own_fields(self)


class ComparedPair(NamedTuple):
    """A mode of both results. Shifts are b minus a; percent of a; None: not known without both standard deviations.

    p_value: of so much by chance among the shifts of all pairs (Holm). mac: None where there are no common shapes.
    """

    a: ComparedMode
    b: ComparedMode
    mac: float | None
    shift_hz: float
    shift_std_hz: float | None
    shift_percent: float
    shift_std_percent: float | None
    z: float | None
    p_value: float | None
    more_than_chance: bool | None
    verdict: str
    damping_shift: float
    damping_shift_std: float | None
    damping_shift_percent: float
    damping_shift_std_percent: float | None
    damping_z: float | None
    damping_p_value: float | None
    damping_more_than_chance: bool | None
    damping_verdict: str

    def _repr_html_(self) -> str:
        return own_fields(self)


def _pair(raw: Mapping[str, Any]) -> ComparedPair:
    sides = {side: ComparedMode(**raw[side]) for side in ("a", "b")}
    return ComparedPair(**{**raw, **sides})


class ComparisonTable(list[dict[str, Any]]):
    """A row a pair, the keys of ComparedPair with those of its sides as a_… and b_… (pandas.DataFrame takes it); str()
    of it: what `okid compare` prints."""

    def __init__(self, pairs: list[ComparedPair], text: str) -> None:
        super().__init__(
            {
                **{
                    f"{side}_{key}": value for side in ("a", "b") for key, value in getattr(one, side)._asdict().items()
                },
                **{key: value for key, value in one._asdict().items() if key not in ("a", "b")},
            }
            for one in pairs
        )
        self._text = text

    def __str__(self) -> str:
        return self._text


class Comparison:
    """What compare() returns. `pairs`; `only_a`, `only_b`: modes without a partner; `cross_mac` (confident modes of a,
    of b), empty without common shapes; `changed`: some shift is more than chance; `warnings`: what limits it."""

    def __init__(self, raw: dict[str, Any], text: str) -> None:
        self._raw, self._text = raw, text
        self.pairs = [_pair(one) for one in raw["pairs"]]
        self.only_a, self.only_b = ([ComparedMode(**one) for one in raw[key]] for key in ("only_a", "only_b"))
        self.changed = bool(raw["changed"])
        self.warnings = [f"{one['code']}: {one['text']}" for one in raw["warnings"]]

    @property
    def cross_mac(self) -> NDArray[np.float64]:
        """MAC of every confident mode of a with every one of b."""
        shape = tuple(len(self._raw[side]["modes"]) for side in ("a", "b"))
        found = np.array(self._raw["cross_mac"], dtype=np.float64)
        return found.reshape(shape) if found.size else np.zeros((0, 0))

    def table(self) -> ComparisonTable:
        """The pairs as rows; str() of it is the table for a person."""
        return ComparisonTable(self.pairs, self._text)

    def to_dict(self) -> dict[str, Any]:
        """okid.comparison/1, as `okid compare --json` writes it."""
        out: dict[str, Any] = json.loads(json.dumps(self._raw))
        return out

    def __str__(self) -> str:
        return self._text

    def __repr__(self) -> str:
        moved = sum(bool(one.more_than_chance or one.damping_more_than_chance) for one in self.pairs)
        return f"<Comparison of {len(self.pairs)} pairs of modes, {moved} moved by more than chance>"

    def _repr_html_(self) -> str:
        head = ("A", "B", "f A [Hz]", "f B [Hz]", "shift [%]", "± [%]", "z", "MAC", "verdict", "damping")
        rows = [
            [f"{one.a.mode}", f"{one.b.mode}", f"{one.a.frequency_hz:.5f}", f"{one.b.frequency_hz:.5f}",
             f"{one.shift_percent:+.3f}", short(one.shift_std_percent, form=".2g"), short(one.z, form="+.1f"),
             short(one.mac, form=".3f"), one.verdict, one.damping_verdict]
            for one in self.pairs
        ]  # fmt: skip
        only = [f"only in {side}: {one.frequency_hz:.5g} Hz" for side, modes in (("A", self.only_a), ("B", self.only_b))
                for one in modes]  # fmt: skip
        return summary(repr(self).strip("<>")) + table(head, rows) + items(only + self.warnings)


def text_and_name(result: object, name: str) -> tuple[bytes, bytes]:
    """A result as the library takes it; `name` is its own where it is no file. InputError for anything else."""
    if isinstance(result, str | Path):
        text, name = read_input(result), str(result)
        if b"\0" in text:
            raise InputError(f"{name}: holds a NUL byte, expected an okid.result/1")
        return text, name.encode("utf-8", "replace")
    raw = result.to_dict() if isinstance(result, Result) else result
    if not isinstance(raw, Mapping):
        kinds = "a Result, its to_dict() or the name of an okid.result/1 file"
        raise InputError(f"{name} is {result!r:.60}, expected {kinds}")
    try:
        return json.dumps(dict(raw), allow_nan=False).encode(), name.encode()
    except (TypeError, ValueError, RecursionError) as fault:
        raise InputError(f"{name}: not an okid.result/1: {fault}") from None


def compare(a: Known, b: Known) -> Comparison:
    """Compare two results of one structure: `a` the earlier, `b` the later one; every shift is b minus a.

    Each is a Result, its to_dict() or the name of its file. Confident modes are one where the MAC at the outputs that
    both have is 0.8 or more within 30 % of frequency; below that only where the frequencies agree within three
    standard deviations. A shift is more than chance where its Student's t, over all shifts of f and ζ together (Holm),
    would come by chance in less than 1 % of comparisons. The same as `okid compare`. Raises InputError.

    >>> import okid
    >>> force, y = okid.demo_record()
    >>> before, after = (okid.identify(force[k], y[k], fs=1000.0) for k in (slice(0, 10000), slice(10000, 20000)))
    >>> found = okid.compare(before, after)
    >>> len(found.pairs), found.changed, found.pairs[0].verdict
    (3, False, 'no change beyond chance')
    """
    made = ctypes.c_void_p()
    host.call("compare", *text_and_name(a, "a"), *text_and_name(b, "b"), ctypes.byref(made))
    try:
        raw, text = (getattr(host.library(), f"okid_host_comparison_{what}")(made).decode("utf-8", "replace")
                     for what in ("json", "table"))  # fmt: skip
    finally:
        host.library().okid_host_comparison_delete(made)
    return Comparison(json.loads(raw), text)
