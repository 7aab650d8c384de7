# SPDX-License-Identifier: MIT
"""A structure pulled aside and let go, no force measured: what follows is a free decay, of which a fast mode takes a
small part. Sums of damped cosines at nodes of a cantilever; noise of the sensors alone, before the release, too."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import okid
import pytest
from numpy.typing import NDArray

Real = NDArray[np.float64]

FS, SENSORS = 100.0, 6
F, ZETA = np.array([1.3, 3.9, 7.1, 11.8]), np.array([0.008, 0.006, 0.01, 0.012])
SHAPES = np.sin(np.outer(np.arange(1, SENSORS + 1) / SENSORS, np.pi * (np.arange(4) + 0.5)))


def released(seed: int, seconds: float, before: float, noise: float, pushed: float = 0.0) -> Real:
    """Accelerations; `pushed`: rms of the modal forces of wind, over the amplitude that each mode starts with."""
    rng = np.random.default_rng(seed)
    t = np.arange(int(seconds * FS)) / FS
    out = np.zeros((int(before * FS), SENSORS))
    free = np.zeros((len(t), SENSORS))
    for f, z, shape in zip(F, ZETA, SHAPES.T, strict=True):
        w = 2 * np.pi * f
        wave = np.exp(-z * w * t) * np.cos(w * np.sqrt(1 - z * z) * t + 0.3)
        if pushed > 0:
            wave += np.convolve(pushed * rng.standard_normal(len(t)), np.exp(-z * w * t) * np.sin(w * t))[: len(t)]
        free += np.outer(wave, shape) * shape[-1]
    rows = np.vstack([out, free])
    return np.asarray(rows + noise * rng.standard_normal(rows.shape))


def scores(result: okid.Result) -> tuple[list[float], list[float]]:
    """Errors over their deviations; deviations of damping over damping."""
    z, width = [], []
    assert len(result.confident_modes) == len(F), result.table()
    for mode, f, zeta in zip(result.confident_modes, F, ZETA, strict=True):
        z += [(mode.frequency_hz - f) / mode.frequency_std_hz, (mode.damping_ratio - zeta) / mode.damping_ratio_std]
        width.append(mode.damping_ratio_std / zeta)
    return z, width


@pytest.mark.parametrize(("seconds", "before"), [(20.0, 3.0), (60.0, 3.0), (20.0, 0.0)])
def test_deviations_are_those_of_the_noise(seconds: float, before: float) -> None:
    z, width = [], []
    for seed in range(5):
        result = okid.identify(None, released(seed, seconds, before, 0.01), fs=FS)
        assert ("free_decays" in [one.code for one in result.warnings]) == (before > 0)
        of_one, own = scores(result)
        z, width = z + of_one, width + own
    assert 0.5 < np.sqrt(np.mean(np.square(z))) < 1.5 and np.max(np.abs(z)) < 4
    assert np.median(width) < 0.005


def test_wind_beside_a_release_is_no_free_decay() -> None:
    z: list[float] = []
    for seed in range(5):
        result = okid.identify(None, released(seed, 60.0, 3.0, 0.001, pushed=0.03), fs=FS)
        assert "free_decays" not in [one.code for one in result.warnings]
        for mode in result.confident_modes:
            k = int(np.argmin(np.abs(F - mode.frequency_hz)))
            assert abs(mode.frequency_hz / F[k] - 1) < 0.02
            if mode.frequency_std_hz is not None:
                z.append((mode.frequency_hz - F[k]) / mode.frequency_std_hz)
    assert np.sqrt(np.mean(np.square(z))) < 2


def test_a_stream_ends_with_what_a_file_gives(tmp_path: Path) -> None:
    rows = released(0, 20.0, 3.0, 0.01)
    whole = okid.identify(None, rows, fs=FS)
    config = tmp_path / "c.toml"
    channel = '[[channel]]\nname = "y{0}"\nrole = "acceleration"\ncan_id = {1}\nstart_bit = 0\nlength = 16\n'
    config.write_text(
        '[acquisition]\nrate_hz = 100.0\n[[bus]]\nname = "can0"\ninterface = "vcan0"\n'
        + "".join(channel.format(k, 256 + k) for k in range(SENSORS))
    )
    for session in (okid.Session(0, SENSORS, fs=FS), okid.Session.from_config(config)):
        session.feed(rows)
        for mode, other in zip(session.identify().confident_modes, whole.confident_modes, strict=True):
            assert (mode.frequency_hz, mode.damping_ratio_std) == (other.frequency_hz, other.damping_ratio_std)
