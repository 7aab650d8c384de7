# SPDX-License-Identifier: MIT
"""One bad record is told and left out; the rest of its group stands. Also one that no worker survives."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from distributed.scheduler import KilledWorker
from okid.campaign import run
from okid.campaign.run import run_campaign
from okid.campaign.tables import make_tables
from okid.campaign.trend import analyse, series_of
from okid.campaign.virtual_year import Year
from rig_records import SMALL, campaign, facts

CODES = np.zeros((1500, 4), np.int16)
BAD: dict[str, tuple[Callable[[Path], Any], str]] = {
    "empty": (lambda path: path.write_bytes(b""), "is empty"),
    "text": (lambda path: path.write_text("hello"), "not a record, or damaged"),
    "cut": (lambda path: path.write_bytes(path.read_bytes()[:2000]), "its head says (1500, 4) of int16"),
    "pickle": (
        lambda path: np.save(path, np.array([{}], dtype=object), allow_pickle=True),
        "its head says (1,) of object",
    ),
    "columns": (
        lambda path: np.save(path, CODES[:, :3]),
        "holds an array (1500, 3), expected (samples, 4): force, acc1",
    ),
    "flat": (lambda path: np.save(path, CODES[:, 0]), "holds an array (1500,), expected (samples, 4)"),
    "short": (lambda path: np.save(path, CODES[:15]), "too short for 20 lags"),
    "none": (lambda path: np.save(path, CODES[:0]), "holds no samples"),
    "wide": (
        lambda path: np.save(path, CODES.astype(np.int32) + 40_000),
        "holds codes from 40000 to 40000, expected 16 bits",
    ),
    "complex": (lambda path: np.save(path, CODES.astype(complex)), "holds complex128, expected int16"),
    "broken codes": (lambda path: np.save(path, CODES + 1e-5), "'force', sample 0: 1e-05 is not scale code + offset"),
    "gone": (lambda path: path.unlink(), ""),
}


@pytest.mark.parametrize("kind", list(BAD))
def test_bad_record_is_left_out_and_told(tmp_path: Path, client: Any, kind: str) -> None:
    spec = campaign(tmp_path, replace(SMALL, records=8, days=2.0))
    victim = sorted((tmp_path / "records").iterdir())[1]
    harm, words = BAD[kind]
    harm(victim)
    outcome = run_campaign(spec, client)
    assert outcome.read == (7 if kind == "gone" else 8) and not outcome.faults
    victim.unlink(missing_ok=True)
    without = run_campaign(replace(spec, folder=tmp_path / "without"), client)
    assert facts(outcome) == facts(without) and len(outcome.done) == 2
    if kind == "gone":
        return
    assert [one.name for one in outcome.skipped] == [f"records/{victim.name}"]
    reason = outcome.skipped[0].reason
    assert words in reason and "\n" not in reason and str(tmp_path) not in reason
    row = make_tables(spec, outcome)["records"].set_index("record").loc[f"records/{victim.name}"]
    assert row["status"] == "skipped" and row["reason"] == reason


def test_damage_is_found_among_bad_records(tmp_path: Path, client: Any) -> None:
    """50 records of a frame under temperature, three of them bad, each in another way: the drop of two modes by 1.5 %
    and 1.8 % is an alarm within five records, the bad ones are three lines."""
    year = Year(records=50, samples=2048, days=50.0, damage=0.075, damaged=3, damage_day=35.0, seed=5)
    spec = campaign(tmp_path, year)
    records = sorted((tmp_path / "records").iterdir())
    for k, kind in ((4, "cut"), (20, "text"), (37, "columns")):
        BAD[kind][0](records[k])
    outcome = run_campaign(spec, client)
    assert sorted(one.name for one in outcome.skipped) == [f"records/{records[k].name}" for k in (4, 20, 37)]
    (one,) = series_of(make_tables(spec, outcome))
    analyse(one, spec.trend)
    assert one.watched == [1, 2, 3], one.remarks
    since = (one.time_s - one.time_s[0]) / 86400.0
    first = since[one.alarms[0][0]]
    assert 35.0 - since[0] <= first <= 41.0 + 1e-6, one.alarms


def test_group_of_bad_records_has_a_fault(tmp_path: Path, client: Any) -> None:
    spec = campaign(tmp_path, replace(SMALL, records=8, days=2.0))
    for path in sorted((tmp_path / "records").iterdir())[:4]:
        path.write_bytes(b"")
    outcome = run_campaign(spec, client)
    groups = make_tables(spec, outcome)["groups"].set_index("group")
    assert (
        groups.loc["2025-01-01", "fault"] == "no record of it could be used"
        and groups.loc["2025-01-01", "skipped"] == 4
    )
    assert groups.loc["2025-01-02", "modes"] == 3


def test_constant_record_gives_no_model(tmp_path: Path, client: Any) -> None:
    """Read and summed, but nothing can be identified: the group says so and is not tried again."""
    spec = campaign(tmp_path, replace(SMALL, records=8, days=2.0))
    for path in sorted((tmp_path / "records").iterdir())[:4]:
        np.save(path, CODES)
    outcome = run_campaign(spec, client)
    groups = make_tables(spec, outcome)["groups"].set_index("group")
    assert "no model" in groups.loc["2025-01-01", "fault"] and groups.loc["2025-01-01", "records"] == 4
    assert run_campaign(spec, client).read == 0


TRIED: list[list[str]] = []
VICTIM: list[str] = []
WHOLE = run.run_batch


def deadly_batch(spec: Any, slices: Any) -> Any:
    """As if a worker ended over the first of VICTIM, and over the second too while it had company."""
    names = [Path(ref.name).name for piece in slices for ref in piece.records]
    TRIED.append(names)
    if VICTIM[0] in names or (names == VICTIM[1:] and TRIED.count(names) == 1):
        raise KilledWorker("run_batch", SimpleNamespace(address="a worker"), 1)
    return WHOLE(spec, slices)


def test_record_no_worker_survives(tmp_path: Path, client: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    """A batch over which workers end is taken apart; records that were only with such a worker are tried alone."""
    spec = campaign(tmp_path, replace(SMALL, records=8, days=2.0))
    victim, neighbour = sorted((tmp_path / "records").iterdir())[1:3]
    TRIED[:], VICTIM[:] = [], [victim.name, neighbour.name]
    monkeypatch.setattr(run, "run_batch", deadly_batch)
    outcome = run_campaign(spec, client)
    monkeypatch.undo()
    assert [(one.name, one.reason) for one in outcome.skipped] == [
        (f"records/{victim.name}", "a worker ended over it, alone: too large for its memory?")
    ]
    assert TRIED.count([victim.name]) == TRIED.count([neighbour.name]) == 2
    victim.unlink()
    assert facts(outcome) == facts(run_campaign(replace(spec, folder=tmp_path / "without"), client))
