# SPDX-License-Identifier: MIT
"""Method auto of a campaign, the default: the modes of a group are those of okid.identify() on its records."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import okid
import pytest
from okid.campaign import tasks
from okid.campaign.run import run_campaign
from okid.campaign.spec import CampaignSpec
from okid.campaign.tables import make_tables
from rig_records import SMALL, campaign, facts

NAMED = (
    'method = "okid-era"\np = 20\npieces = 5             # a record is cut into, for the standard deviations of a day'
)


def default(folder: Path, changes: dict[str, str] | None = None, **own: Any) -> CampaignSpec:
    return campaign(folder, changes={NAMED: "", **(changes or {})}, **own)


def test_modes_of_a_day_are_those_of_identify(tmp_path: Path, client: Any) -> None:
    spec = default(tmp_path)
    assert spec.identification.method == "auto"
    out = run_campaign(spec, client)
    truth = json.loads((tmp_path / "truth.json").read_text())["frequency_hz_at_15_c"]
    assert len(out.groups) == 6 and not out.faults and not out.skipped
    for group in out.groups:
        modes = [mode for mode in out.done[group.ident].result["modes"] if mode["holds"]]
        assert [mode["frequency_hz"] for mode in modes] == pytest.approx(truth, rel=0.02)  # temperature moves them
        assert all(0 < mode["frequency_std_hz"] < 0.01 * mode["frequency_hz"] for mode in modes)
    first = out.groups[0]
    records = [np.load(ref.url) * np.array(spec.channels.scale) for ref in sorted(first.records, key=lambda r: r.name)]
    alone = okid.identify([one[:, :1] for one in records], [one[:, 1:] for one in records], fs=spec.channels.fs_hz)
    listed = out.done[first.ident].result["modes"]
    assert [mode["frequency_hz"] for mode in listed] == [mode.frequency_hz for mode in alone.modes]
    assert [mode["holds"] for mode in listed] == [mode.confident for mode in alone.modes]


def test_a_group_that_grows_is_read_again_and_another_is_not(tmp_path: Path, client: Any) -> None:
    spec = default(tmp_path)
    last = sorted((tmp_path / "records").iterdir())[-1]
    last.rename(tmp_path / "later.npy")
    first = run_campaign(spec, client)
    assert first.read == SMALL.records - 1 and run_campaign(spec, client).read == 0
    (tmp_path / "later.npy").rename(last)
    grown = run_campaign(spec, client)
    assert grown.read == 4  # the records of that day
    (tmp_path / "again").mkdir()
    assert facts(grown) == facts(run_campaign(default(tmp_path / "again"), client))


def test_a_group_above_the_bound_says_what_was_left_out(
    tmp_path: Path, client: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    spec = default(tmp_path, {'by = ["day"]': "by = []"})
    monkeypatch.setattr(tasks, "MOST_NUMBERS", 10 * 4 * SMALL.samples)
    out = run_campaign(spec, client)
    (done,) = out.done.values()
    assert len(done.records) == 10 and len(out.skipped) == SMALL.records - 10
    assert "name a method" in out.skipped[0].reason
    assert sum(mode["holds"] for mode in done.result["modes"]) == 3
    assert run_campaign(spec, client).read == 0


def test_a_bad_record_costs_itself_and_silence_costs_its_group(tmp_path: Path, client: Any) -> None:
    spec = default(tmp_path, {'by = ["day"]': 'by = ["record"]'})
    records = sorted((tmp_path / "records").iterdir())
    records[3].write_bytes(b"no array")
    np.save(records[5], np.zeros((SMALL.samples, 4), np.int16))
    out = run_campaign(spec, client)
    assert [one.name for one in out.skipped] == [f"records/{records[3].name}"]
    silent = [done.result["fault"] for done in out.done.values() if done.result["fault"]]
    assert len(silent) == 1 and "\n" not in silent[0]
    assert sum(bool(done.result["modes"]) for done in out.done.values()) == SMALL.records - 2


def test_missing_numbers_are_counted_and_a_record_of_none_is_left_out(tmp_path: Path, client: Any) -> None:
    spec = default(tmp_path)
    paths = sorted((tmp_path / "records").iterdir())[:3]
    first, empty, dead = (np.load(path).astype(float) * np.array(spec.channels.scale) for path in paths)
    first[100:140, 2] = first[130:150, 1] = np.nan
    empty[:], dead[:, 3] = np.nan, np.nan  # a channel without a number costs no rows
    for path, samples in zip(paths, (first, empty, dead), strict=True):
        np.save(path, samples)
    out = run_campaign(spec, client)
    assert [(one.name, one.reason) for one in out.skipped] == [
        (f"records/{paths[1].name}", "holds no number in any row")
    ]
    counted = {one["name"]: one["missing"] for done in out.done.values() for one in done.records}
    assert [counted.pop(f"records/{path.name}") for path in (paths[0], paths[2])] == [50, 0]
    assert set(counted.values()) == {0}


def test_codes_at_full_scale_are_left_out_when_asked(tmp_path: Path, client: Any) -> None:
    spec = default(tmp_path, {"fs_hz": 'saturated = "missing"\nfs_hz'})
    path = sorted((tmp_path / "records").iterdir())[0]
    codes = np.load(path)
    codes[700:703, 2] = 32767
    np.save(path, codes)
    out = run_campaign(spec, client)
    (record,) = (one for done in out.done.values() for one in done.records if one["name"].endswith(path.name))
    assert record["saturated"] == 3
    assert all(sum(mode["holds"] for mode in done.result["modes"]) == 3 for done in out.done.values())


def test_command(tmp_path: Path) -> None:
    default(tmp_path)
    for words, told in ((["check"], "method auto; series: frame"), (["run", "--workers", "1"], "6 of 6 groups with")):
        run = [sys.executable, "-m", "okid.campaign", words[0], str(tmp_path / "SPEC.toml"), *words[1:]]
        done = subprocess.run(run, capture_output=True, text=True, timeout=1800)
        assert done.returncode == 0, done.stderr
        assert told in done.stdout
    assert "frame: not watched: 2 training groups, 10 are needed" in done.stdout
    page = (tmp_path / "out" / "report.html").read_text()
    assert "<tr><th>method</th><td>auto</td></tr>" in page


def test_a_dead_sensor_costs_neither_its_record_nor_the_track(tmp_path: Path, client: Any) -> None:
    spec = default(tmp_path, {'by = ["day"]': 'by = ["record"]'})
    for path in sorted((tmp_path / "records").iterdir())[8:12]:
        codes = np.load(path)
        codes[:, 2] = 7
        np.save(path, codes)
    out = run_campaign(spec, client)
    assert not out.skipped and not out.faults
    modes = make_tables(spec, out)["modes"]
    confident = modes[modes["holds"]]
    assert len(confident) == 3 * SMALL.records and set(confident["track"]) == {1, 2, 3}
    assert confident.groupby("track")["frequency_hz"].std().max() < 0.5
    hurt = confident[confident["shape_re"].map(lambda shape: np.isnan(np.array(shape, dtype=float)).any())]
    assert len(hurt) == 3 * 4
