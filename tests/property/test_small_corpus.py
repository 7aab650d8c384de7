# SPDX-License-Identifier: MIT
"""The default call on simulated measurements with known modes, each kind something that it once failed on.

What a kind is and how it is made: tests/support/small_corpus.py. A true mode is found when a confident one lies within
half its half-power bandwidth, or 0.05 %, one to one; a confident mode that is none of them is false. `pytest -s` prints
the table.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import okid
import pytest
from numpy.typing import NDArray
from small_corpus import HUM_HZ, KINDS, PICKUP_HZ, Record

SEEDS = {"plate, three hits at 4 kHz": 1, "plate, one hit at 48 kHz": 1}  # how many records; of all others two
Real = NDArray[np.float64]


class Bound(NamedTuple):
    """What holds in each record of a kind; `damping`: relative error of the worst mode found."""

    found: int
    false: int
    damping: float


BOUNDS = {
    "plate, three hits at 4 kHz": Bound(19, 2, 0.5),
    "plate, one hit at 48 kHz": Bound(20, 1, 0.2),
    "rod, hardly damped": Bound(1, 0, 0.02),
    "bridge, one sensor": Bound(5, 0, 0.4),
    "building in an earthquake": Bound(6, 0, 0.02),
    "mixed sensors, told": Bound(3, 0, 0.02),
    "mixed sensors, not told": Bound(3, 0, 0.02),
    "close pair": Bound(3, 0, 0.6),
    "short free decay": Bound(4, 0, 0.02),
    "hit of 0.3 s": Bound(4, 0, 0.02),
    "hum and pick-up": Bound(3, 0, 0.02),
    "noise, ambient": Bound(0, 0, 0.0),
    "noise with an input": Bound(0, 0, 0.0),
    "weak modes": Bound(6, 0, 0.5),
}


class Answer(NamedTuple):
    record: Record
    modes: list[okid.Mode]  # all that are listed
    codes: dict[str, str]  # of warnings, with their texts
    matched: dict[int, okid.Mode]  # true mode -> the confident one
    false: list[okid.Mode]

    def damping_error(self) -> float:
        """Relative, of the worst mode found."""
        return max((abs(m.damping_ratio / self.record.damping[k] - 1) for k, m in self.matched.items()), default=0.0)


def answer(record: Record) -> Answer:
    try:
        result = okid.identify(record.u, record.y, fs=record.fs, **record.options)
    except okid.IdentificationError:  # no model: nothing is confident
        return Answer(record, [], {}, {}, [])
    sure = [mode for mode in result.modes if mode.confident]
    distance = {(k, j): abs(mode.frequency_hz - hz) for k, hz in enumerate(record.hz) for j, mode in enumerate(sure)}
    matched: dict[int, int] = {}
    for k, j in sorted(distance, key=lambda pair: distance[pair]):
        near = distance[k, j] <= record.hz[k] * max(record.damping[k], 5e-4)
        if near and k not in matched and j not in matched.values():
            matched[k] = j
    false = [mode for j, mode in enumerate(sure) if j not in matched.values()]
    codes = {warning.code: warning.text for warning in result.warnings}
    return Answer(record, list(result.modes), codes, {k: sure[j] for k, j in matched.items()}, false)


@pytest.fixture(scope="module")
def corpus() -> dict[str, list[Answer]]:
    found = {kind: [answer(make(seed)) for seed in range(1, SEEDS.get(kind, 2) + 1)] for kind, make in KINDS.items()}
    print(f"\n{'kind':28} {'found':>12} {'false':>6} {'damping':>8}")
    for kind, answers in found.items():
        for one in answers:
            print(f"{kind:28} {len(one.matched):6} of {len(one.record.hz):2} {len(one.false):6} "
                  f"{100 * one.damping_error():6.2f} %")  # fmt: skip
    return found


@pytest.mark.parametrize("kind", KINDS)
def test_found_false_and_damping(corpus: dict[str, list[Answer]], kind: str) -> None:
    bound = BOUNDS[kind]
    for one in corpus[kind]:
        assert len(one.matched) >= bound.found
        assert len(one.false) <= bound.false, one.false
        assert one.damping_error() <= bound.damping


def mac(a: NDArray[np.complex128], b: Real) -> float:
    return float(abs(np.vdot(a, b)) ** 2 / (np.vdot(a, a).real * (b @ b)))


@pytest.mark.parametrize("kind", ["building in an earthquake", "mixed sensors, told", "close pair", "short free decay",
                                  "hit of 0.3 s", "hum and pick-up"])  # fmt: skip
def test_shapes_are_those_of_the_structure(corpus: dict[str, list[Answer]], kind: str) -> None:
    for one in corpus[kind]:
        assert min(mac(mode.shape, one.record.shapes[:, k]) for k, mode in one.matched.items()) > 0.95


def test_velocities_beside_accelerations(corpus: dict[str, list[Answer]]) -> None:
    for told in (True, False):
        for one in corpus["mixed sensors, told" if told else "mixed sensors, not told"]:
            assert min(mode.mpc for mode in one.matched.values()) > 0.95
            assert ("mixed_quantities" in one.codes) != told


def test_a_short_decay_is_no_tone(corpus: dict[str, list[Answer]]) -> None:
    for one in corpus["short free decay"]:
        assert 0 in one.matched
        assert not [mode for mode in one.modes if "tone" in mode.why]


def test_lines_of_the_mains_and_of_the_rate_are_not_confident(corpus: dict[str, list[Answer]]) -> None:
    for one in corpus["hum and pick-up"]:
        for hz in (HUM_HZ, PICKUP_HZ):
            assert not [m for m in one.modes if m.confident and abs(m.frequency_hz / hz - 1) < 0.002]


def test_deviations_are_finite_and_cover_the_error(corpus: dict[str, list[Answer]]) -> None:
    """Of all confident modes that are true: below the value, and nine errors of ten within three of them.

    Known to be wrong: one damping of the plate struck three times and one of the weak modes have one above the value.
    """
    within, known, exploded = 0, 0, []
    for kind, answers in corpus.items():
        for one in answers:
            for k, mode in one.matched.items():
                if mode.frequency_std_hz is None or mode.damping_ratio_std is None:
                    continue
                assert 0 < mode.frequency_std_hz < 0.05 * mode.frequency_hz, kind
                assert 0 < mode.damping_ratio_std < 3 * mode.damping_ratio, kind
                exploded += [kind] if mode.damping_ratio_std > mode.damping_ratio else []
                known += 2
                within += abs(mode.frequency_hz - one.record.hz[k]) <= 3 * mode.frequency_std_hz
                within += abs(mode.damping_ratio - one.record.damping[k]) <= 3 * mode.damping_ratio_std
    total = sum(len(one.matched) for answers in corpus.values() for one in answers)
    assert set(exploded) <= {"plate, three hits at 4 kHz", "weak modes"} and len(exploded) <= 4, exploded
    assert known >= 1.8 * total
    assert within >= 0.9 * known


def test_weak_modes_have_deviations_of_the_right_size(corpus: dict[str, list[Answer]]) -> None:
    for one in corpus["weak modes"]:
        for k, mode in one.matched.items():
            assert mode.frequency_std_hz is not None and mode.damping_ratio_std is not None
            assert abs(mode.frequency_hz - one.record.hz[k]) < 5 * mode.frequency_std_hz
            assert abs(mode.damping_ratio - one.record.damping[k]) < 5 * mode.damping_ratio_std
            assert mode.frequency_std_hz < 2 * one.record.hz[k] * one.record.damping[k]
