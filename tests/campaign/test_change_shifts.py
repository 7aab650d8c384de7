# SPDX-License-Identifier: MIT
"""The change test in a campaign: every mode in every group from sums alone, temperature removed, damage found."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from okid import InputError
from okid.campaign.run import run_campaign
from okid.campaign.tables import make_tables
from okid.campaign.trend import analyse, series_of
from okid.campaign.virtual_year import COLUMNS, Year, frequencies
from rig_records import campaign

WITH_TEST = {"[trend]": "[trend]\nchange_test = true"}
DAMAGED = Year(records=60, samples=2048, days=60.0, damage=0.02, damage_day=45.0, seed=3)


def test_damage_of_one_column(tmp_path: Path, client: Any) -> None:
    """The truth is the rig's: frequencies of its damaged column, found as shifts of the series without temperature."""
    spec = campaign(tmp_path, DAMAGED, WITH_TEST)
    tables = make_tables(spec, run_campaign(spec, client))
    shifts = tables["shifts"]
    assert len(shifts) == 3 * len(tables["groups"])  # three modes, in every group
    by_name = {one.name: one for one in series_of(tables)}
    one = by_name["frame, change test"]
    analyse(one, spec.trend)
    assert one.watched == [1, 2, 3] and one.alarms, one.remarks
    assert one.time_s[one.alarms[0][0]] >= 45.0 * 86400.0 + one.time_s[0] - 86400.0
    assert one.change is not None and one.shift_hz is not None and one.shift_std_hz is not None
    columns = COLUMNS.copy()
    columns[DAMAGED.damaged - 1] *= 1.0 - DAMAGED.damage
    truth = frequencies(columns) - frequencies(COLUMNS)
    assert np.all(np.abs(one.shift_hz - truth) < 4.0 * one.shift_std_hz + 0.05 * np.abs(truth))


def test_auto_keeps_no_sums(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="keeps no sums"):
        campaign(tmp_path, Year(records=2, samples=300, days=2.0), {**WITH_TEST, 'method = "okid-era"\np = 20': ""})
