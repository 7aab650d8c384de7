# SPDX-License-Identifier: MIT
"""Hits behind an anti-alias filter: what the force did between samples is not known, what follows it needs no force.
Pulses of 4 ms and decays at 8 times the rate, filtered and decimated together; noise of the sensors alone."""

from __future__ import annotations

import numpy as np
import okid
import pytest
from numpy.typing import NDArray
from scipy.signal import decimate, lfilter

Real = NDArray[np.float64]

FS, FINER, SENSORS = 1000.0, 8, 4
F, ZETA = np.array([35.0, 88.0, 161.0, 270.0]), np.array([0.02, 0.012, 0.01, 0.015])
SHAPES = np.sin(np.outer(np.arange(1, SENSORS + 1) / (SENSORS + 0.5), np.pi * np.arange(1, 5)))


def struck(
    seed: int, hits: int, place: int = -1, seconds: float = 4.0, noise: float = 0.003, scraping: float = 0.0
) -> tuple[Real, Real]:
    """Force and accelerations; the noise is relative to the largest acceleration."""
    rng = np.random.default_rng(seed)
    force = np.zeros(int(seconds * FS * FINER))
    for hit in range(hits):
        first = int((0.1 + hit * seconds / hits) * FS * FINER) + int(rng.integers(0, FINER))
        force[first : first + 32] += rng.uniform(0.7, 1.3) * np.hanning(32)
        force[first : first + int(scraping * FS * FINER)] += 0.03 * np.abs(
            rng.standard_normal(int(scraping * FS * FINER))
        )
    rows = np.zeros((len(force), SENSORS))
    for f, z, shape in zip(F, ZETA, SHAPES.T, strict=True):
        pole = np.exp(2 * np.pi * f * complex(-z, np.sqrt(1 - z * z)) / FS / FINER)
        moved = lfilter([0.0, pole.imag], [1, -2 * pole.real, abs(pole) ** 2], force)
        rows += np.outer(np.gradient(np.gradient(moved)), shape) * shape[place]
    y = decimate(rows, FINER, ftype="fir", axis=0)
    u = decimate(force, FINER, ftype="fir")
    return u, y + noise * np.max(np.abs(y)) * rng.standard_normal(y.shape)


def scores(result: okid.Result) -> list[float]:
    z = []
    assert len(result.confident_modes) == len(F), result.table()
    for mode, f, zeta in zip(result.confident_modes, F, ZETA, strict=True):
        z += [(mode.frequency_hz - f) / mode.frequency_std_hz, (mode.damping_ratio - zeta) / mode.damping_ratio_std]
    return z


@pytest.mark.parametrize("hits", [1, 4])
def test_deviations_are_those_of_the_noise(hits: int) -> None:
    z = []
    for seed in range(8):
        u, y = struck(seed, hits)
        result = okid.identify(u, y, fs=FS)
        assert result.refinement is not None
        z += scores(result)
    assert 0.6 < np.sqrt(np.mean(np.square(z))) < 1.4 and np.max(np.abs(z)) < 4


def test_of_hits_at_several_places() -> None:
    z = []
    for seed in range(4):
        hits = [struck(100 * seed + k, 1, place=k % 4, seconds=1.5) for k in range(12)]
        us, ys = [u for u, _ in hits], [y[:, :2] for _, y in hits]
        result = okid.identify(us, ys, fs=FS, hit_dofs=[k % 4 + 1 for k in range(12)], output_dofs=[1, 2])
        assert result.refinement is not None
        z += scores(result)
    assert 0.6 < np.sqrt(np.mean(np.square(z))) < 1.4 and np.max(np.abs(z)) < 4


@pytest.mark.parametrize("refine", [None, False])
def test_picked_modes_are_those_of_the_table(refine: bool | None) -> None:
    u, y = struck(0, 1)
    every, picked = (okid.identify(u, y, fs=FS, refine=refine, modes=modes) for modes in (None, [1, 3]))
    values = [[(m.frequency_hz, m.damping_ratio_std, m.found_in) for m in one.modes] for one in (every, picked)]
    assert values[1] == [values[0][0], values[0][2]]


def test_a_mode_that_dies_away_under_the_hammer_keeps_the_answer_of_all_samples() -> None:
    """The hammer stays and scrapes for 0.1 s: what follows is white and knows little of the last mode."""
    u, y = struck(3, 1, scraping=0.1)
    result = okid.identify(u, y, fs=FS)
    last = result.confident_modes[-1]
    assert abs(last.frequency_hz - F[-1]) < 0.2 and last.damping_ratio_std < 0.01 * last.damping_ratio
