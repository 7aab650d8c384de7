# SPDX-License-Identifier: MIT
"""Lanes, spectra, response functions, diagram against what NumPy, SciPy and okid.frf make of the whole record."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import okid
import pytest
from numpy.typing import NDArray
from okid.frf import h1
from okid.live.averages import Averages, segment_length
from okid.live.config import Identification, PageConfig
from okid.live.diagram import Material, draw
from okid.live.envelope import MISSING, NOT_SENT, Envelope
from okid.live.measured import Measured
from okid.live.recent import Recent
from okid.live.run_state import Channel
from scipy.signal import lfilter, welch

FS = 1000.0


def pieces(total: int, seed: int) -> list[tuple[int, int]]:
    """A record cut anyhow."""
    cuts = np.sort(np.random.default_rng(seed).choice(np.arange(1, total), size=37, replace=False))
    edges = [0, *cuts.tolist(), total]
    return list(zip(edges[:-1], edges[1:], strict=True))


def two_modes(samples: int, seed: int = 1) -> NDArray[np.float64]:
    """(3, samples): a white force and two responses with modes at 40 and 90 Hz, 1 % damping."""
    rng = np.random.default_rng(seed)
    u = rng.standard_normal(samples)
    y = []
    for share in (0.7, -0.4):
        out = 0.01 * rng.standard_normal(samples)
        for f, weight in ((40.0, 1.0), (90.0, share)):
            r = np.exp(-0.01 * 2 * np.pi * f / FS)
            out += weight * lfilter([1.0, -1.0], [1.0, -2 * r * np.cos(2 * np.pi * f / FS), r * r], u)
        y.append(out)
    return np.vstack([u, *y])


@pytest.mark.parametrize("seed", range(5))
def test_columns_are_those_of_the_whole_record(seed: int) -> None:
    data = np.random.default_rng(seed).standard_normal((3, 2000))
    data[1, 700:705] = np.nan
    data[2, 900:920] = np.nan
    recent, envelope = Recent(3, 5000), Envelope(3, FS)
    for a, b in pieces(2000, seed):
        placed = recent.add(a, data[:, a:b])
        assert placed is not None
        envelope.add(placed)
    first, low, high, marks = envelope.since(0)
    whole = data.reshape(3, 200, 10)
    assert first == 0 and low.shape == (3, 200)
    kept = ~np.all(np.isnan(whole), axis=2)
    assert np.array_equal(np.isnan(low), ~kept) and not kept[2, 90]
    assert np.array_equal(low[kept], np.nanmin(whole[kept], axis=1).astype(np.float32))
    assert np.array_equal(high[kept], np.nanmax(whole[kept], axis=1).astype(np.float32))
    assert np.array_equal(marks == MISSING, np.any(np.isnan(whole), axis=2))
    assert np.array_equal(recent.read(0, 2000), data.T, equal_nan=True)


def test_a_jump_is_marked_as_not_sent_and_a_repeat_is_left_out() -> None:
    data = np.arange(400.0)[None, :]
    recent, envelope = Recent(1, 1000), Envelope(1, FS)
    for a, b in ((0, 100), (150, 300), (250, 400), (10, 60)):
        placed = recent.add(a, data[:, a:b])
        if placed is not None:
            envelope.add(placed)
    _, low, high, marks = envelope.since(0)
    assert marks[0].tolist() == [0] * 10 + [NOT_SENT] * 5 + [0] * 25
    assert high[0, 39] == 399.0 and low[0, 15] == 150.0 and np.isnan(low[0, 12])


def test_a_long_hole_is_a_new_beginning_and_memory_does_not_grow() -> None:
    recent, envelope = Recent(2, 300), Envelope(2, FS, seconds=0.5)
    for first in (0, 250, 10**9, 10**9 + 100):
        placed = recent.add(first, np.full((2, 100), float(first)))
        assert placed is not None and len(placed.block) <= 400
        envelope.add(placed)
    first, low, _, _ = envelope.since(0)
    assert first == 10**8 and low.shape[1] == 20 and recent.oldest == 10**9
    assert np.isnan(recent.read(10**9 - 5, 6)[:5]).all()


def test_averages_are_those_of_welch_and_h1() -> None:
    data = two_modes(40000)
    averages = Averages(1, 2, 3, FS, 2048)
    for a, b in pieces(40000, 4):
        averages.add(data[:, a:b].T)
    line, density = welch(data, FS, "hann", 2048, detrend="constant")
    assert np.allclose(averages.frequency_hz, line)
    for k in range(3):
        assert np.allclose(averages.spectrum(k), density[k], rtol=1e-9)
    expected = h1(data[0], data[1:].T, FS, nperseg=2048)
    assert averages.averages == expected.averages == 38
    for k in range(2):
        found = averages.response(k, 0)
        assert found is not None
        assert np.allclose(found.response, expected.response[:, k, 0], rtol=1e-8)
        assert np.allclose(found.coherence, expected.coherence[:, k], rtol=1e-8)


def test_two_inputs_together() -> None:
    rng = np.random.default_rng(2)
    u = rng.standard_normal((2, 20000))
    y = lfilter([1.0], [1.0, -0.5], u[0]) + 3.0 * u[1]
    averages = Averages(2, 1, 3, FS, 512)
    averages.add(np.vstack([u, y]).T)
    expected = h1(u.T, y, FS, nperseg=512)
    for k in range(2):
        found = averages.response(0, k)
        assert found is not None and np.allclose(found.response, expected.response[:, 0, k], rtol=1e-8)
    assert np.allclose(np.abs(averages.response(0, 1).response), 3.0, rtol=0.05)  # type: ignore[union-attr]


def test_a_dead_channel_costs_its_own_curves_only() -> None:
    data = two_modes(20000)
    data[2, 5000:] = np.nan
    averages = Averages(1, 2, 3, FS, 1024)
    averages.add(data.T)
    alone = Averages(1, 1, 2, FS, 1024)
    alone.add(data[:2].T)
    first, second, whole = averages.response(0, 0), averages.response(1, 0), alone.response(0, 0)
    assert first is not None and second is not None and whole is not None
    assert np.array_equal(first.response, whole.response) and second.averages == 8 < first.averages == 38
    silent = Averages(1, 2, 3, FS, 1024)
    silent.add(np.full((5000, 3), np.nan))
    assert silent.response(0, 0) is None and np.isnan(silent.spectrum(0)).all() and silent.averages == 0


def test_old_averages_fade_after_the_window() -> None:
    loud = np.random.default_rng(3).standard_normal((40000, 1))
    loud[:20000] *= 100.0
    averages = Averages(0, 1, 1, FS, 256, most=5)
    averages.add(loud)
    assert float(np.median(averages.spectrum(0))) == pytest.approx(2.0 / FS, rel=0.6)


def test_one_average_has_no_coherence() -> None:
    averages = Averages(1, 1, 2, FS, 64)
    averages.add(np.random.default_rng(0).standard_normal((64, 2)))
    found = averages.response(0, 0)
    assert found is not None and np.isnan(found.coherence).all()


def test_length_of_segments() -> None:
    assert segment_length(1000.0) == 4096
    assert segment_length(1000.0, 5.0) == 2048
    assert segment_length(100.0) == 256
    assert segment_length(1.0) == 64
    assert segment_length(51200.0) == 4096


def page_config(**more: object) -> PageConfig:
    return PageConfig(Path("a.toml"), Path("s"), True, "", **more)  # type: ignore[arg-type]


CHANNELS = [Channel("f", "force", "N", 1), Channel("a", "acceleration", "m/s^2", 1), Channel("b", "velocity", "m/s", 2)]


def test_gaps_every_second_shorten_the_segments() -> None:
    data = two_modes(60000)
    data[:, ::700] = np.nan
    measured = Measured(CHANNELS, FS, page_config())
    for first in range(0, 60000, 500):
        measured.add(first, data[:, first : first + 500])
    assert measured.averages.length == 512
    assert measured.averages.useful > 50
    found = measured.averages.response(0, 0)
    assert found is not None and float(np.median(found.coherence[20:])) > 0.9


def test_what_was_before_a_change_does_not_count() -> None:
    data = two_modes(30000)
    measured = Measured(CHANNELS, FS, page_config(identification=Identification(window_s=8.0)))
    louder = data.copy()
    louder[:, :12000] *= 10.0
    for first in range(0, 30000, 50):
        measured.add(first, louder[:, first : first + 50])
        if first == 13000:
            measured.restart(12000)
    assert float(np.median(measured.averages.spectrum(0))) == pytest.approx(2.0 / FS, rel=0.3)
    material = measured.material()
    assert material is not None and np.array_equal(material.stretches[0], data[:, 22000:].T)


def test_blows_are_averaged_when_their_ring_down_is_there() -> None:
    rng = np.random.default_rng(5)
    config = page_config(hammer=True, hit_s=1.0, hit_before_s=0.1)
    measured = Measured(CHANNELS, FS, config)
    data = 1e-3 * rng.standard_normal((3, 9000))
    for at in (1000, 3000, 7000):
        pulse = np.zeros(9000)
        pulse[at : at + 4] = [30.0, 80.0, 80.0, 30.0]
        data[0] += pulse
        data[1] += lfilter([0.0, 1.0], [1.0, -1.95, 0.98], pulse)
    for first in range(0, 9000, 50):
        if first in (2150, 4100, 8100):
            measured.hit({2150: 1000, 4100: 3000, 8100: 7000}[first])
        measured.add(first, data[:, first : first + 50])
    assert measured.averages.averages == 3 and measured.averages.length == 1100
    found = measured.averages.response(0, 0)
    assert found is not None and float(np.min(found.coherence[1:300])) > 0.99
    material = measured.material()
    assert material is not None and len(material.stretches) == 3


def test_the_diagram_finds_the_modes() -> None:
    data = two_modes(10000)
    found = draw(Material(1, 2, FS, [data.T]), Identification(p=20))
    assert found["text"] == "" and found["p"] == 20
    assert [round(mode[0]) for mode in found["modes"]] == [40, 90]
    stable = [pole for pole in found["poles"] if pole[3] == 4]
    assert len(stable) >= 10 and all(2 <= pole[1] <= 20 for pole in found["poles"])


@pytest.mark.parametrize(("noise", "count"), [(0.0, 4000), (0.02, 4000), (0.1, 2000)])
def test_only_lines_of_stable_poles_are_modes(noise: float, count: int) -> None:
    """In these records noise gathers one or two clusters that are found in half of the models, with poles that do not
    hold."""
    u, y = okid.demo_record()
    data = np.column_stack([u, y])[:count]
    data[:, 1:] += noise * np.std(y, axis=0) * np.random.default_rng(3).standard_normal((count, 3))
    found = draw(Material(1, 3, 1000.0, [data]), Identification())
    assert [round(mode[0]) for mode in found["modes"]] == [11, 32, 46]


def test_a_diagram_that_cannot_be_made_says_why() -> None:
    assert "no model" in draw(Material(1, 2, FS, [np.zeros((5000, 3))]), Identification())["text"]
    assert draw(Material(1, 2, FS, [two_modes(30).T]), Identification())["text"] != ""
    assert "'okid-eras'" in draw(Material(1, 2, FS, [two_modes(5000).T]), Identification(method="okid-eras"))["text"]


@pytest.mark.parametrize(
    "wanted",
    [Identification(method="n4sid-cva", p=20, rows=20), Identification(p=20, forgetting=0.9998, detrend="linear")],
)
def test_the_diagram_follows_the_config(wanted: Identification) -> None:
    found = draw(Material(1, 2, FS, [two_modes(10000).T, two_modes(10000, seed=2).T]), wanted)
    assert [round(mode[0]) for mode in found["modes"]][:2] == [40, 90] and found["stretches"] == 2


def test_the_diagram_of_ambient_responses() -> None:
    found = draw(Material(0, 2, FS, [two_modes(20000)[1:].T]), Identification(p=20))
    assert [round(mode[0]) for mode in found["modes"]] == [40, 90]
