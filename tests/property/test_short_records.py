# SPDX-License-Identifier: MIT
"""Records of 12 to 28 periods of the first mode."""

from __future__ import annotations

from typing import Any

import numpy as np
import okid
import pytest
from scipy.signal import cont2discrete, dlsim, firwin, lfilter

FS, FINE = 128.0, 8
FREQUENCY, DAMPING = np.array([7.1, 11.9, 20.3, 37.7]), np.array([0.009, 0.012, 0.007, 0.01])


def structure(force: Any, shapes: Any) -> Any:
    """Accelerations of the modes, each equally strong, under a force that is a straight line between fine samples."""
    out = np.zeros((len(force), shapes.shape[0]))
    for k, (f, zeta) in enumerate(zip(FREQUENCY, DAMPING, strict=True)):
        w = 2 * np.pi * f
        A, B = np.array([[0, 1], [-w * w, -2 * zeta * w]]), np.array([[0], [1]])
        C, D = np.array([[-w * w, -2 * zeta * w]]), np.array([[1]])
        response = dlsim(cont2discrete((A, B, C, D), 1 / (FS * FINE), method="foh"), force)[1][:, 0]
        out += np.outer(response / response.std(), shapes[:, k])
    return out


def measured(kind: str, samples: int, seed: int) -> Any:
    """Force and three accelerations: one anti-alias filter on all channels, 0.3 % of noise."""
    rng = np.random.default_rng(seed)
    t = np.arange(samples * FINE) / (FS * FINE)
    hit = np.where((t >= 0.05) & (t < 0.053), np.sin(np.pi * (t - 0.05) / 0.003), 0.0)
    force = hit if kind == "hit" else lfilter(np.ones(6) / 6, 1, rng.standard_normal(len(t)))
    taps = firwin(32 * FINE + 1, 0.42 / FINE * 2)
    both = np.column_stack([force, structure(force, rng.standard_normal((3, 4)))])
    both = lfilter(taps, 1, both, axis=0)[::FINE]
    both += 0.003 * both.std(axis=0) * rng.standard_normal(both.shape)
    return both[:, :1], both[:, 1:]


@pytest.mark.parametrize(("samples", "fewest"), [(220, 3), (320, 3), (500, 4)])
@pytest.mark.parametrize("kind", ["hit", "random"])
def test_modes_of_a_short_record(kind: str, samples: int, fewest: int) -> None:
    for seed in range(3):
        u, y = measured(kind, samples, seed)
        modes = [m for m in okid.identify(u, y, fs=FS).modes if m.confident]
        nearest = [int(np.argmin(np.abs(FREQUENCY - m.frequency_hz))) for m in modes]
        assert fewest <= len(set(nearest)) == len(modes), seed
        assert [m.frequency_hz for m in modes] == pytest.approx(FREQUENCY[nearest], rel=0.01), seed
        assert [m.damping_ratio for m in modes] == pytest.approx(DAMPING[nearest], rel=0.4), seed


def test_short_noise_has_no_modes() -> None:
    for seed in range(20):
        rng = np.random.default_rng(seed)
        samples, outputs, inputs = int(rng.choice([160, 300, 600, 1200])), seed % 4 + 1, seed // 4 % 2
        u = rng.standard_normal((samples, 1)) if inputs else None
        y = lfilter([1], [1, -0.7], rng.standard_normal((samples, outputs)), axis=0)
        with pytest.raises(okid.IdentificationError):
            okid.identify(u, y, fs=FS)
