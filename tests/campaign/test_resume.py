# SPDX-License-Identifier: MIT
"""What is finished is not read twice: after an interruption, when records come, change or go."""

from __future__ import annotations

import os
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from okid.campaign.run import run_campaign
from okid.campaign.state_folder import StateFolder
from rig_records import SMALL, campaign, facts


class _Stop:
    """Ctrl-C when so many records are in sums."""

    def __init__(self, after: int) -> None:
        self._after, self.reached = after, 0

    def __call__(self, records: int, *_others: int) -> None:
        self.reached = records
        if records >= self._after:
            raise KeyboardInterrupt


@pytest.mark.parametrize("by", ['["day"]', "[]"], ids=["small groups", "one large group"])
def test_interrupted_run_goes_on(tmp_path: Path, client: Any, by: str) -> None:
    spec = campaign(tmp_path, changes={'by = ["day"]': f"by = {by}"}, batch_bytes=15_000)
    whole = facts(run_campaign(replace(spec, folder=tmp_path / "whole"), client))
    stop = _Stop(7)
    with pytest.raises(KeyboardInterrupt):
        run_campaign(spec, client, stop)
    kept = {
        name
        for files in StateFolder(spec.folder, spec.sums_key).load().values()
        for _, sums in files
        for name in sums.names()
    }
    assert len(kept) == stop.reached == 7
    again = run_campaign(spec, client)
    assert again.read == SMALL.records - 7 and facts(again) == whole
    last = run_campaign(spec, client)
    assert last.read == 0 and facts(last) == whole


def test_new_record_alone_is_read(tmp_path: Path, client: Any) -> None:
    """Parts are kept, so a group grows by what is new, and is what it would have been from the beginning."""
    spec = campaign(tmp_path, changes={'by = ["day"]': "by = []"}, keep="parts")
    last = sorted((tmp_path / "records").iterdir())[-1]
    last.rename(tmp_path / "later.npy")
    assert run_campaign(spec, client).read == SMALL.records - 1
    (tmp_path / "later.npy").rename(last)
    grown = run_campaign(spec, client)
    assert grown.read == 1
    assert facts(grown) == facts(run_campaign(replace(spec, folder=tmp_path / "fresh"), client))


def test_merged_sums_are_read_anew_and_told(tmp_path: Path, client: Any) -> None:
    spec = campaign(tmp_path, replace(SMALL, records=8, days=2.0), keep="sums")
    last = sorted((tmp_path / "records").iterdir())[-1]
    last.rename(tmp_path / "later.npy")
    run_campaign(spec, client)
    (tmp_path / "later.npy").rename(last)
    grown = run_campaign(spec, client)
    assert grown.read == 4 and any("read again" in remark for remark in grown.remarks)
    assert facts(grown) == facts(run_campaign(replace(spec, folder=tmp_path / "fresh"), client))


def test_content_decides_not_the_time_stamp(tmp_path: Path, client: Any) -> None:
    spec = campaign(tmp_path, replace(SMALL, records=8, days=2.0))
    before = facts(run_campaign(spec, client))
    first, second = sorted((tmp_path / "records").iterdir())[:2]
    os.utime(first, ns=(1, 1))
    touched = run_campaign(spec, client)
    assert touched.read == 0 and facts(touched) == before
    np.save(second, np.load(second)[::-1].copy())
    changed = run_campaign(spec, client)
    assert changed.read == 4 and facts(changed) != before
    assert facts(changed) == facts(run_campaign(replace(spec, folder=tmp_path / "fresh"), client))


def test_removed_record_is_taken_out(tmp_path: Path, client: Any) -> None:
    spec = campaign(tmp_path, replace(SMALL, records=8, days=2.0))
    run_campaign(spec, client)
    sorted((tmp_path / "records").iterdir())[0].unlink()
    less = run_campaign(spec, client)
    assert less.read == 3 and facts(less) == facts(run_campaign(replace(spec, folder=tmp_path / "fresh"), client))


def test_other_order_needs_no_record(tmp_path: Path, client: Any) -> None:
    """Another model order is another model of the same sums."""
    spec = campaign(tmp_path, replace(SMALL, records=8, days=2.0), keep="parts")
    run_campaign(spec, client)
    other = run_campaign(replace(spec, identification=replace(spec.identification, order=4)), client)
    assert other.read == 0
    assert all(sums.result is not None and sums.result["order"] == 4 for sums in other.done.values())


@pytest.mark.parametrize("harm", ["cut", "header", "empty"])
def test_damaged_state_is_read_anew(tmp_path: Path, client: Any, harm: str) -> None:
    spec = campaign(tmp_path, replace(SMALL, records=8, days=2.0))
    whole = facts(run_campaign(spec, client))
    path = sorted((spec.folder / "state").rglob("*.sums"))[0]
    data = path.read_bytes()
    path.write_bytes({"cut": data[:-9], "header": data[:40] + b"#" + data[41:], "empty": b""}[harm])
    again = run_campaign(spec, client)
    assert again.read == 4 and facts(again) == whole


def test_state_is_bounded(tmp_path: Path, client: Any) -> None:
    """One file a group when all is done, whatever the number of records."""
    spec = campaign(tmp_path, changes={'by = ["day"]': "by = []"}, batch_bytes=15_000)
    run_campaign(spec, client)
    files = list((spec.folder / "state").rglob("*"))
    assert [path.suffix for path in files if path.is_file()] == [".sums"]
