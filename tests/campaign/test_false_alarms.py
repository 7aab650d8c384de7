# SPDX-License-Identifier: MIT
"""Long campaigns of several laws of scatter: false alarms at the stated rate, drops found, wrong groups no change."""

from __future__ import annotations

import os
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from okid.campaign import change_point, control_chart, trend
from okid.campaign.control_chart import Ranks, groups_needed
from okid.campaign.spec import Trend
from okid.campaign.trend import SeriesTrend, Track, analyse
from okid.campaign.trend_model import scatter_slope
from scipy.stats import chi2

Rng = np.random.Generator
SLOW = os.environ.get("OKID_SLOW") == "1"  # the long tier
F0, SCATTER = np.array([11.0, 32.0, 45.0]), 2e-3
STEP_S, FIRST = 3 * 86400.0, 300  # a group every three days; groups of the training
LAWS: dict[str, Callable[[Rng, tuple[int, int]], Any]] = {
    "gauss": lambda rng, shape: rng.standard_normal(shape),
    "laplace": lambda rng, shape: rng.laplace(size=shape) / np.sqrt(2.0),
    "t3": lambda rng, shape: rng.standard_t(3.0, shape) / np.sqrt(3.0),
    "gamma": lambda rng, shape: (rng.gamma(2.0, size=shape) - 2.0) / np.sqrt(2.0),
    "common": lambda rng, shape: rng.standard_normal(shape) * np.exp(0.5 * rng.standard_normal((shape[0], 1))),
    "cold": lambda rng, shape: rng.standard_normal(shape),  # more in the cold
}


@pytest.fixture(autouse=True)
def _quick(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(control_chart, "_SIMULATED", 400)
    monkeypatch.setattr(trend, "find_change", lambda *_: None)


def campaign(seed: int, law: str, bad: float = 0.0, drop: float = 0.0, count: int = 1000) -> SeriesTrend:
    """Three modes, one value in ten missing; a share of the groups, and once two running, has a wrong second mode.

    From group 700 on the lower two modes are `drop` lower. Only "cold" knows a temperature, which moves the modes, too.
    """
    rng = np.random.default_rng([seed, count])
    time = np.arange(count) * STEP_S
    celsius = 12.0 - 10.0 * np.cos(2.0 * np.pi * time / (365.25 * 86400.0)) + 3.0 * rng.standard_normal(count)
    e = LAWS[law](rng, (count, 3))
    if law == "cold":  # 0.25 to 1.75 of the usual; a straight line, not the exponential that is fitted
        e *= 1.0 + 0.05 * np.clip(12.0 - celsius, -15.0, 15.0)[:, None]
    wrong = rng.random(count) < bad
    wrong[500:502] |= bad > 0.0
    f = F0 * (1.0 + SCATTER * e)
    if law == "cold":
        f -= 5e-4 * F0 * (celsius[:, None] - 12.0)
    f[wrong, 1] *= 1.1
    f[700:, :2] *= 1.0 - drop
    f[rng.random((count, 3)) < 0.1] = np.nan
    std = np.full(count, 1e-3)
    tracks = [Track(k + 1, f[:, k], std, np.full(count, 0.01), std) for k in range(3)]
    names = [f"group {k}" for k in range(count)]
    return SeriesTrend("frame", names, time, celsius if law == "cold" else None, tracks)


def watched(one: SeriesTrend) -> list[int]:
    """The groups with an alarm at 5 % a year, trained on the first 300."""
    analyse(one, Trend(training_share=FIRST / 1000.0, false_alarm_per_year=0.05))
    assert one.charts is not None, one.reason
    return [row for row, _ in one.alarms]


@pytest.mark.parametrize("bad", [0.0, 0.05])
@pytest.mark.parametrize("law", LAWS)
def test_long_campaigns_have_the_stated_rate(law: str, bad: float) -> None:
    """5.7 years watched: 25 % of the campaigns without damage may have an alarm, within three binomial deviations."""
    count = 200 if SLOW else 12
    alarmed = sum(bool(watched(campaign(seed, law, bad))) for seed in range(9000, 9000 + count))
    share = 1.0 - 0.95 ** (700.0 * STEP_S / (365.25 * 86400.0))
    bound = 3.0 * np.sqrt(share * (1.0 - share) / count)
    assert share - bound <= alarmed / count <= share + bound


@pytest.mark.parametrize("law", LAWS if SLOW else ["laplace", "cold"])
def test_a_drop_is_found_in_a_long_campaign(law: str) -> None:
    """1.5 % in two modes of 1,000 groups, 5 % of them wrong: within 5 groups in 95 of 100."""
    found, count = 0, 100 if SLOW else 20
    for seed in range(count):
        found += any(700 <= row < 705 for row in watched(campaign(seed, law, 0.05, 0.015)))
    assert found >= 0.95 * count


@pytest.mark.parametrize("law", ["laplace", "t3"] if SLOW else ["laplace"])
def test_wrong_groups_are_no_change_of_the_mean(monkeypatch: pytest.MonkeyPatch, law: str) -> None:
    """Ten campaigns with 5 % wrong groups: a change of the mean in none; one of 2 sigma is measured.

    At a probability of 0.01 of each of ten: two of them by chance once in 230 times.
    """
    monkeypatch.setattr(trend, "find_change", change_point.find_change)
    monkeypatch.setattr(change_point, "_NULL", 199)
    told = near = 0
    for seed in range(10):
        one = campaign(seed, law, 0.05)
        watched(one)
        told += one.change is not None
        one = campaign(seed, law, 0.05, 2.0 * SCATTER)
        watched(one)
        assert one.change is not None and one.shift_hz is not None and one.shift_std_hz is not None
        assert abs(one.change.at - 700) <= 10
        near += bool(np.all(np.abs(one.shift_hz + 2.0 * SCATTER * F0 * [1, 1, 0]) < 3.0 * one.shift_std_hz))
    assert told <= 1 and near >= 9


@pytest.mark.parametrize(("bad", "needed"), [(0.0, 3), (0.05, 4)])
def test_some_wrong_groups_are_no_change(bad: float, needed: int) -> None:
    """Fewer wrong groups than are needed, of one more in a row, are named; as many are an alarm at the last of them."""
    for place in range(needed + 1):
        many = [row for row in range(800, 801 + needed) if row != 800 + place]
        for wrong in (many[:-1], many):
            one = campaign(2, "gauss", bad)
            one.tracks[1].frequency_hz[795 : 802 + needed] = F0[1]
            one.tracks[1].frequency_hz[wrong] = 35.0
            near = [row for row in watched(one) if 795 <= row < 802 + needed]
            assert one.limits is not None and one.limits.needed == needed
            assert near[:1] == ([many[-1]] if wrong == many else [])
            assert [row for row in one.odd if row in many] == ([] if wrong == many else wrong)


@pytest.mark.parametrize(("wrong", "needed"), [(0, 3), (6, 3), (7, 4), (16, 4), (17, 5), (300, 5)])
def test_more_wrong_groups_in_the_training_ask_for_more(wrong: int, needed: int) -> None:
    assert groups_needed(wrong, 300, 122, 0.05) == needed


def test_a_short_training_without_wrong_groups_asks_for_four() -> None:
    assert groups_needed(0, 15, 122, 0.05) == 4


@pytest.mark.parametrize("law", ["gauss", "laplace", "t3", "gamma"])
def test_ranks_do_not_depend_on_the_law(law: str) -> None:
    """T^2 of new groups by rank has the quantiles of chi^2, whatever the law, on the average over trainings."""
    rng = np.random.default_rng(5)
    trainings, count = 400, 50
    ranks = Ranks(LAWS[law](rng, (trainings * count, 3)).reshape(trainings, count, 3) * 7.0)
    new = [np.sum(ranks.scored(LAWS[law](rng, (trainings, 3)) * 7.0) ** 2, axis=1) for _ in range(50)]
    for p in (0.5, 0.8, 0.95):
        share = float(np.mean(np.array(new) <= chi2.ppf(p, 3)))
        deviation = np.sqrt(p * (1.0 - p) * (1.0 / (trainings * 50) + 1.0 / (trainings * count)))
        assert abs(share - p) < 4.0 * deviation + 1.0 / (count + 1.0) ** 1.5


def test_ranks_keep_order_and_direction() -> None:
    rng = np.random.default_rng(6)
    ranks = Ranks(rng.standard_normal((100, 3)))
    direction = np.array([[2.0, -1.0, 2.0]]) / 3.0
    scored = [ranks.scored(size * direction) for size in np.linspace(0.05, 30.0, 200)]
    lengths = np.array([np.linalg.norm(one) for one in scored])
    assert np.all(np.diff(lengths) >= 0.0) and np.all(np.diff(lengths[100:]) > 0.0)
    np.testing.assert_allclose(np.vstack(scored) / lengths[:, None], np.repeat(direction, 200, axis=0), atol=1e-9)


def test_scatter_that_follows_the_temperature_is_measured() -> None:
    """exp(0.5 x) in two columns of heavy tails, none in the third: the slopes of 100 records, and no false ones."""
    rng = np.random.default_rng(7)
    slopes = []
    for _ in range(100):
        x = rng.uniform(-1.0, 1.0, 300)
        left = rng.laplace(size=(300, 3)) * np.exp(0.5 * x[:, None] * np.array([1.0, -1.0, 0.0]))
        slopes.append(scatter_slope(left, np.ones(3), x))
    mean = np.mean(slopes, axis=0)
    np.testing.assert_allclose(mean, [0.5, -0.5, 0.0], atol=0.06)
    assert np.sum(np.array(slopes)[:, 2] != 0.0) <= 12  # 4.6 +- 2.1 by chance
