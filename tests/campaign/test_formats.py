# SPDX-License-Identifier: MIT
"""The same record in other formats: the same integer sums of codes, gaps where samples are missing."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import okid
import pytest
from okid.campaign.pieces import make_identifier, record_sums
from okid.campaign.record_read import read_one
from okid.campaign.run import run_campaign
from okid.campaign.spec import CampaignSpec, load_spec
from okid.formats import Record, write_record
from program import okid as run_okid
from rig_records import SMALL, campaign, facts
from two_masses import rig_text, simulate_rig


@pytest.fixture(scope="module")
def spec(tmp_path_factory: pytest.TempPathFactory) -> CampaignSpec:
    return campaign(tmp_path_factory.mktemp("formats"), replace(SMALL, records=4, days=1.0))


def sums_of(spec: CampaignSpec, name: str, path: Path) -> list[bytes]:
    return [one.to_bytes() for one in record_sums(spec, read_one(spec, name, str(path)), make_identifier(spec).lags)]


@pytest.mark.parametrize("kind", ["csv", "uff", "h5", "mf4", "mat", "parquet"])
def test_codes_in_engineering_units_are_exact(spec: CampaignSpec, tmp_path: Path, kind: str) -> None:
    """Numbers that are scale code come back as their codes, whatever file they were in."""
    source = sorted((spec.base / "records").iterdir())[0]
    values = np.load(source) * np.array(spec.channels.scale)
    path = tmp_path / f"r.{kind}"
    write_record(path, Record(list(spec.channels.names), values, spec.channels.fs_hz, ["N", "m/s^2", "m/s^2", "m/s^2"]))
    assert sums_of(spec, path.name, path) == sums_of(spec, source.name, source)


def test_other_sample_rate_is_refused(spec: CampaignSpec, tmp_path: Path) -> None:
    write_record(tmp_path / "r.csv", Record(list(spec.channels.names), np.ones((50, 4)), 100.0))
    with pytest.raises(okid.InputError, match=r"r.csv: has a sample rate of 100 Hz, the campaign of 128 Hz"):
        read_one(spec, "r.csv", str(tmp_path / "r.csv"))


def test_missing_samples_are_a_gap(spec: CampaignSpec, tmp_path: Path) -> None:
    """NaN ends a run in the codes too, and is counted; nothing is put in its place."""
    codes = np.load(sorted((spec.base / "records").iterdir())[0])
    values = codes * np.array(spec.channels.scale)
    values[700:710, 2], values[:3, 0], values[-1, 1] = np.nan, np.nan, np.nan
    np.save(tmp_path / "r.npy", values)
    one = replace(spec, identification=replace(spec.identification, pieces=1))
    record = read_one(one, "r.npy", str(tmp_path / "r.npy"))
    found = record_sums(one, record, 20)[0]
    by_hand = okid.Accumulator(1, 3, 20, codes=16)
    by_hand.set_units(spec.channels.scale)
    by_hand.gap(3)
    by_hand.add(codes[3:700])
    by_hand.gap(10)
    by_hand.add(codes[710:-1])
    by_hand.gap(1)
    by_hand.centre()
    assert found.to_bytes() == by_hand.to_bytes() and found.stats.missing == 14
    assert record.missing is not None and int(record.missing.sum()) == 14


def test_temperature_of_a_channel(tmp_path: Path, client: Any) -> None:
    """The mean of a column that is not identified, in its own scale."""
    columns = 'columns = ["force", "acc1", "acc2", "acc3"]'
    made = campaign(
        tmp_path, replace(SMALL, records=4, days=1.0),
        {columns: 'columns = ["t", "force", "acc1", "acc2", "acc3"]',
         'column = "temperature_c"': 'channel = "t"\nscale = 0.1\noffset = -40.0'},
    )  # fmt: skip
    for k, path in enumerate(sorted((tmp_path / "records").iterdir())):
        codes = np.load(path)
        np.save(path, np.column_stack([np.full(len(codes), 500 + 10 * k, np.int16), codes]))
    records = next(iter(run_campaign(made, client).done.values())).records
    assert [record["temperature_c"] for record in records] == pytest.approx([10.0, 11.0, 12.0, 13.0])


SPEC = """[records]
files = ["a.{kind}"]
config = "a.toml"
[channels]
inputs = ["force1"]
outputs = ["acc1", "acc2"]
fs_hz = 250.0
{scale}
[identification]
p = 12
[group]
by = []
"""


@pytest.fixture(scope="module")
def rig(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Frames of a rig as a candump log and as a journal."""
    folder = simulate_rig(tmp_path_factory.mktemp("frames"), rig_text(20.0))
    done = run_okid("convert", folder / "a.log", folder / "a.okj", "-c", folder / "a.toml")
    assert done.returncode == 0, done.stderr
    return folder


def test_frames_are_exact_codes(rig: Path, client: Any) -> None:
    """Journal and log give the same integers, and the modes of `okid.Session` on the decoded samples."""
    done = run_okid("convert", rig / "a.log", rig / "decoded.csv", "-c", rig / "a.toml")
    assert done.returncode == 0, done.stderr
    table = okid.read_csv(rig / "decoded.csv")
    values = table.columns(["force1", "acc1", "acc2"], "a")
    steps = [float(np.min(np.diff(np.unique(values[:, k])))) for k in range(3)]
    scale = "scale = [" + ", ".join(f"{one:.6g}" for one in steps) + "]"
    found = []
    for kind in ("log", "okj"):
        (rig / f"{kind}.toml").write_text(SPEC.format(kind=kind, scale=scale))
        outcome = run_campaign(load_spec(rig / f"{kind}.toml"), client)
        assert not outcome.skipped, outcome.skipped
        found.append(facts(outcome)["all records"])
    assert found[0] == found[1]
    session = okid.Session(["force1"], ["acc1", "acc2"], fs=250.0, p=12, sigma_blocks=0)
    session.feed(values)
    for mode, own in zip(session.modes(), found[0][1], strict=True):
        assert own["frequency_hz"] == pytest.approx(mode.frequency_hz, rel=1e-6)


def test_log_without_config_is_told(rig: Path, client: Any) -> None:
    (rig / "none.toml").write_text(SPEC.format(kind="log", scale="").replace('config = "a.toml"\n', ""))
    outcome = run_campaign(load_spec(rig / "none.toml"), client)
    assert 'needs the CONFIG.toml of its channels: give [records] "config"' in outcome.skipped[0].reason
