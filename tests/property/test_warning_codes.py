# SPDX-License-Identifier: MIT
"""Warnings that no other test provokes: each by a record that deserves it and, beside it, not by one that does not."""

from __future__ import annotations

import re
from collections.abc import Callable
from typing import Any

import numpy as np
import okid
import pytest
from numpy.typing import NDArray
from systems import Structure, chain, rayleigh, record, w2

Real = NDArray[np.float64]
RATE, DOFS = 200.0, {"input_dofs": [1], "output_dofs": [1, 2, 3]}
W2_DOFS = {"input_dofs": [1, 4], "output_dofs": [1, 2, 3, 4, 5, 6]}


def frame(samples: int = 4000, noise: float = 1.0, dashpot: float = 0.0, at: int = 2) -> tuple[Real, Real]:
    """Force and accelerations of three masses; a dashpot to the ground makes the damping non-proportional."""
    M, K = chain([1.0, 0.8, 1.2], [3e4, 2e4, 2.5e4])
    R, _ = rayleigh(M, K, 0.01)
    R[at, at] += dashpot
    return record(Structure(M, R, K, force_dofs=(0,), sense_dofs=(0, 1, 2), dt=1 / RATE), samples, noise, seed=3)


def one_sine() -> tuple[Real, Real]:
    """A force that is not the one the structure felt."""
    draw, (_, y) = np.random.default_rng(7), frame()
    return np.sin(0.1 * np.arange(4000.0))[:, None] + 1e-3 * draw.standard_normal((4000, 1)), y


def twice() -> tuple[Real, Real]:
    u, y = frame()
    return u, np.hstack([y, 2 * y[:, :1]])


def single_mass() -> tuple[Real, Real]:
    one = Structure(np.eye(1), np.array([[3.0]]), np.array([[3e4]]), force_dofs=(0,), sense_dofs=(0,), dt=1 / RATE)
    return record(one, 4000, 1.0, seed=1)


def forces_exchanged() -> tuple[Real, Real]:
    u, y = record(w2(), 6000, 1.0, seed=5)
    return u[:, ::-1], y


def velocities(u: Real, y: Real) -> tuple[Real, Real]:
    return u, np.cumsum(y, axis=0) / RATE


def exchanged(u: Real, y: Real) -> tuple[Real, Real]:
    return u, y[:, [1, 0, 2]]


CASES: list[tuple[str, str, Callable[[], tuple[Real, Real]], dict[str, Any]]] = [
    ("few_rows", r"for 69 unknowns per output, 10 for each are advised", lambda: frame(700), {"p": 20}),
    ("ill_conditioned", r"condition|repeat|noise", twice, {"p": 20}),
    ("order_reduced", r"order", frame, {"p": 20, "order": 60}),
    ("p_reduced", r"^p is \d+ instead of 4096", frame, {"p": 4096, "method": "okid-era"}),
    ("no_modes", r"order 1 as asked for has no vibration mode", frame, {"p": 20, "order": 1}),
    ("order_unclear", r"order", one_sine, {"method": "n4sid-moesp"}),
    (
        "pdc_undetermined",
        r"one frequency cannot tell",
        single_mass,
        {"p": 20, "order": 2, "input_dofs": [1], "output_dofs": [1]},
    ),
    ("pdc_residual", r"not proportional", lambda: frame(8000, 0.2, 10.0, 0), {"p": 40, "order": 6, **DOFS}),
    ("mkr_complex_modes", r"complex", lambda: frame(8000, 0.2, 100.0), {"p": 40, "order": 6, **DOFS}),
    ("mkr_feedthrough_misfit", r"feedthrough|D", lambda: velocities(*frame()), {"p": 40, "order": 6, **DOFS}),
    ("mkr_stiffness_indefinite", r"stiffness|K", lambda: exchanged(*frame()), {"p": 40, "order": 6, **DOFS}),
    ("mkr_pairs_disagree", r"pair|forces", forces_exchanged, {"p": 40, "order": 12, **W2_DOFS}),
]


@pytest.mark.parametrize(("code", "words", "make", "options"), CASES, ids=[case[0] for case in CASES])
def test_each_is_told(code: str, words: str, make: Callable[[], tuple[Real, Real]], options: dict[str, Any]) -> None:
    u, y = make()
    said = {each.code: each.text for each in okid.identify(u, y, fs=RATE, sigma_blocks=0, **options).warnings}
    assert code in said, said
    assert re.search(words, said[code]), said[code]


def test_a_good_record_gives_none_of_them() -> None:
    u, y = frame(8000)
    said = {each.code for each in okid.identify(u, y, fs=RATE, p=40, order=6, **DOFS).warnings}
    assert not said & {case[0] for case in CASES}
