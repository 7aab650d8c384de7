# SPDX-License-Identifier: MIT
"""The same sums to the last bit and the same modes, whoever reads which record when."""

from __future__ import annotations

import hashlib
import os
import signal
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import okid
import pytest
from distributed import Client, LocalCluster
from okid.campaign.cluster import connected
from okid.campaign.pieces import make_identifier
from okid.campaign.run import run_campaign
from okid.campaign.spec import CampaignSpec
from rig_records import SMALL, campaign, facts


@pytest.fixture(scope="module")
def spec(tmp_path_factory: pytest.TempPathFactory) -> CampaignSpec:
    """Two groups of 10 and 14 records, each read in several slices."""
    made = campaign(
        tmp_path_factory.mktemp("exact"),
        replace(SMALL, days=12.0),
        {'by = ["day"]': 'by = ["week"]'},
        batch_bytes=40_000,
    )
    assert made.by == ("week",) and made.identification.pieces == 10
    return made


@pytest.fixture(scope="module")
def truth(spec: CampaignSpec, client: Any) -> dict[str, Any]:
    return facts(run_campaign(replace(spec, folder=spec.base / "one"), client))


@pytest.fixture(scope="module")
def two() -> Iterator[Any]:
    """Two worker processes; who dies is replaced."""
    with (
        LocalCluster(n_workers=2, threads_per_worker=1, processes=True, dashboard_address="127.0.0.1:0") as cluster,
        Client(cluster, set_as_default=False) as made,
    ):
        yield made


def test_sums_are_those_of_the_library(spec: CampaignSpec, truth: dict[str, Any]) -> None:
    """A group is what one accumulator per piece and merge() give, without anything of the campaign in between."""
    i, lags = spec.identification, make_identifier(spec).lags
    names = sorted((spec.base / "records").glob("*.npy"))
    weeks = {"2025-W01": names[:10], "2025-W02": names[10:]}
    assert list(truth) == list(weeks)
    for week, (digest, modes) in truth.items():
        whole = okid.Accumulator(1, 3, lags, codes=16)
        whole.set_units(spec.channels.scale, spec.channels.offset)
        for name in weeks[week]:
            codes = np.load(name)
            cuts = [round(k * len(codes) / i.pieces) for k in range(i.pieces + 1)]
            for low, high in zip(cuts[:-1], cuts[1:], strict=True):
                piece = okid.Accumulator(1, 3, lags, codes=16)
                piece.add(codes[max(0, low - lags) : high])
                piece.centre()
                whole.merge(piece)
        assert hashlib.sha256(whole.to_bytes()).hexdigest() == digest
        found = make_identifier(spec).run(whole)
        assert [mode["frequency_hz"] for mode in modes] == found.frequency_hz.tolist()


@pytest.mark.parametrize("batch_bytes", [15_000, 10**9])
def test_slices_do_not_matter(spec: CampaignSpec, truth: dict[str, Any], client: Any, batch_bytes: int) -> None:
    """Each record by itself through two levels of merges, or all at once."""
    other = replace(spec, folder=spec.base / f"batch{batch_bytes}", batch_bytes=batch_bytes)
    assert facts(run_campaign(other, client)) == truth


def test_two_workers_give_the_same(spec: CampaignSpec, truth: dict[str, Any], two: Any) -> None:
    assert facts(run_campaign(replace(spec, folder=spec.base / "two"), two)) == truth


class _Killer:
    """Ends a worker process (kill -9) after so many steps of the run."""

    def __init__(self, client: Any, after: int) -> None:
        self._client, self._left, self.killed = client, after, 0

    def __call__(self, *_counts: int) -> None:
        self._left -= 1
        if not self.killed and self._left < 0:
            self.killed = min(self._client.run(os.getpid).values())
            os.kill(self.killed, signal.SIGKILL)


@pytest.mark.parametrize("after", range(20) if os.environ.get("OKID_SLOW") == "1" else [0])
def test_killed_worker_changes_nothing(spec: CampaignSpec, truth: dict[str, Any], after: int) -> None:
    with connected(2, None, 1000.0) as client:
        killer = _Killer(client, after)
        outcome = run_campaign(replace(spec, folder=spec.base / f"killed{after}", batch_bytes=15_000), client, killer)
        assert killer.killed > 0
        assert facts(outcome) == truth and not outcome.skipped


def test_order_of_patterns_does_not_matter(tmp_path: Path, client: Any) -> None:
    """The same files by other patterns in another order, some of them twice."""
    spec = campaign(tmp_path, replace(SMALL, records=8, days=2.0))
    first = facts(run_campaign(replace(spec, folder=tmp_path / "a"), client))
    files = ("records/*T2*.npy", "records/frame_*.npy", "records/*T0*.npy")
    other = replace(spec, folder=tmp_path / "b", records=replace(spec.records, files=files))
    assert facts(run_campaign(other, client)) == first


def test_real_numbers_repeat(tmp_path: Path, client: Any) -> None:
    """Double sums round, but a fixed tree of merges makes them repeat; other slices stay within rounding."""
    spec = campaign(
        tmp_path, replace(SMALL, records=16, days=8.0), {"scale =": "codes = 0\nscale =", 'by = ["day"]': "by = []"}
    )
    runs = [
        facts(run_campaign(replace(spec, folder=tmp_path / str(k), batch_bytes=size), client))["all records"]
        for k, size in enumerate((30_000, 30_000, 10**9))
    ]
    assert runs[0] == runs[1]
    for a, b in zip(runs[0][1], runs[2][1], strict=True):
        assert a["frequency_hz"] == pytest.approx(b["frequency_hz"], rel=1e-9)
