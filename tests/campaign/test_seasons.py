# SPDX-License-Identifier: MIT
"""Two years of a structure that follows its temperature, in a line or with a bend at 0 °C: what the charts make of it.

The long tier has the seeds behind the figures of docs/validation.md: seasons.py prints them.
"""

from __future__ import annotations

import os

import numpy as np
import pytest
import seasons
from okid.campaign import control_chart, trend
from okid.campaign.temperature_curve import slopes

SEEDS = range(20 if os.environ.get("OKID_SLOW") == "1" else 3)


@pytest.fixture(autouse=True)
def _quick(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(control_chart, "_SIMULATED", 400)
    monkeypatch.setattr(trend, "find_change", lambda *_: None)


@pytest.mark.parametrize("name", seasons.KINDS)
def test_a_year_without_damage(name: str) -> None:
    """At most one episode of alarms a year, at most 2 % of the groups in no chart, the bend named where one is."""
    for seed in SEEDS:
        one = seasons.campaign(name, seed, None)
        _, lost = seasons.watched(one)
        assert seasons.episodes([row for row, _ in one.alarms]) <= 1 and lost <= 0.02
        told = [remark for remark in one.remarks if remark.startswith("lack of fit")]
        bends = one.curve.bends
        if name == "line":
            assert bends == () and not told
            continue
        assert bends is not None and min(abs(bend) for bend in bends) < 1.5 and len(told) == 1
        assert one.regression is not None
        steep = slopes(one.regression)[0][:, 0] / seasons.frequencies(seasons.KINDS[name])[0]
        assert steep[0] == pytest.approx(-5e-3, rel=0.2) and steep[-1] == pytest.approx(-4e-4, rel=0.5)


@pytest.mark.parametrize("name", seasons.KINDS)
def test_a_drop_is_alarmed(name: str) -> None:
    """1.5 % of the first frequency, in summer and in frost: within a week."""
    for seed in SEEDS:
        damage = 30 + 15 * seed % 300
        one = seasons.campaign(name, 1000 + seed, damage)
        days, lost = seasons.watched(one)
        late = min(day - damage for day in days if day >= damage)
        assert late < 7.0 and lost <= 0.02


def test_a_line_alone_fits_badly() -> None:
    one = seasons.campaign("frost", 0, None)
    seasons.watched(one, 1)
    assert one.curve.bends == ()
    assert any("lack of fit" in remark and 'temperature_order = "auto"' in remark for remark in one.remarks)
    bent = seasons.campaign("frost", 0, None)
    seasons.watched(bent)
    assert one.regression is not None and bent.regression is not None
    assert np.max(one.regression.variance / bent.regression.variance) > 1.5
