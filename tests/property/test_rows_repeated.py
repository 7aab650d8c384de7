# SPDX-License-Identifier: MIT
"""A sensor that is read more often than it samples: rows repeat the one before, and modes get images."""

from __future__ import annotations

from typing import Any

import numpy as np
import okid
import pytest
from systems import Structure, chain, rayleigh, record

SENSOR = 104.0  # Hz, of its own clock


def vibration(samples: int) -> Any:
    M, K = chain([1.0, 0.8, 1.2], [3e4, 2e4, 2.5e4])
    R, _ = rayleigh(M, K, 0.01)
    return record(Structure(M, R, K, force_dofs=(0,), sense_dofs=(0, 1, 2), dt=1 / SENSOR), samples, 1.0, seed=3)[1]


def read(y: Any, rate: float, late: float, seed: int) -> Any:
    """What a program gets that looks `rate` times a second, each time late by up to a share of its period."""
    rng = np.random.default_rng(seed)
    at = (np.arange(int(len(y) * rate / SENSOR) - 1) + late * rng.random(int(len(y) * rate / SENSOR) - 1)) / rate
    return y[(at * SENSOR).astype(int)]


def codes(result: Any) -> list[str]:
    return [warning.code for warning in result.warnings]


@pytest.mark.parametrize(("rate", "late"), [(200.0, 0.1), (150.0, 0.0), (208.0, 0.3), (1000.0, 0.0)])
def test_it_is_told_and_the_remedy_serves(rate: float, late: float) -> None:
    y = vibration(6000)
    polled = read(y, rate, late, 1)
    with pytest.raises(okid.IdentificationError, match=r"rows repeat all outputs of the row before.*give fs=10[345]"):
        okid.identify(None, polled, fs=rate)
    new = np.r_[True, np.any(polled[1:] != polled[:-1], axis=1)]
    right = okid.identify(None, polled[new], fs=SENSOR)
    plain = okid.identify(None, y, fs=SENSOR)
    assert "rows_repeated" not in codes(right)
    sure = [[m.frequency_hz for m in one.modes if m.confident] for one in (right, plain)]
    assert len(sure[0]) == 3
    assert sure[0] == pytest.approx(sure[1], rel=1e-3)


def test_named_methods_say_so_too() -> None:
    polled = read(vibration(6000), 200.0, 0.1, 2)
    assert "rows_repeated" in codes(okid.identify(None, polled, fs=200.0, method="n4sid-cva", order=6))


@pytest.mark.parametrize("mutes", [1, 4])
def test_stretches_in_which_nothing_was_measured_are_no_repeats(mutes: int) -> None:
    y = vibration(8000)
    for k in range(mutes):
        y[1000 + k * 7000 // mutes :][: 3000 // mutes] = 0.0
    found = [m.frequency_hz for m in okid.identify(None, y, fs=SENSOR).modes if m.confident]
    whole = [m.frequency_hz for m in okid.identify(None, vibration(8000), fs=SENSOR).modes if m.confident]
    assert len(found) == 3
    assert found == pytest.approx(whole, rel=3e-3)


def test_coarse_samples_that_are_equal_by_chance_are_no_repeats() -> None:
    y = vibration(6000)[:, :1]
    coarse = np.round(y / y.std())
    assert np.mean(coarse[1:] == coarse[:-1]) > 0.2
    assert "rows_repeated" not in codes(okid.identify(None, coarse, fs=SENSOR, method="n4sid-cva", order=6))
