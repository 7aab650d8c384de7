# SPDX-License-Identifier: MIT
"""Groups refined from merged correlation sums: those of one stream, however they came together, and nearer the truth.

The frame of the records is the campaign's own (virtual_year.py); the modes it should have are those of its matrices,
and the sums beside which the merged ones stand are those of one session that is fed all records.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import okid
import pytest
from okid.campaign.run import run_campaign
from okid.campaign.spec import load_spec
from okid.campaign.tables import make_tables
from okid.campaign.virtual_year import COLUMNS, Year, structure
from rig_records import campaign, facts

YEAR = Year(records=8, samples=5000, days=2.0, damage=0.0, softening=0.0)
ONE = {'by = ["day"]': "by = []", "[identification]": '[identification]\nrefine = "yes"'}


def table(modes: list[dict[str, Any]]) -> np.ndarray:
    best = sorted(sorted(modes, key=lambda mode: -mode["emac"])[:3], key=lambda mode: mode["frequency_hz"])
    return np.array([[mode["frequency_hz"], mode["damping_ratio"]] for mode in best])


@pytest.fixture(scope="module")
def spec(tmp_path_factory: pytest.TempPathFactory) -> Any:
    return campaign(tmp_path_factory.mktemp("refine"), YEAR, ONE)


def test_merged_sums_refine_as_one_stream_does(spec: Any, client: Any) -> None:
    """Cut into batches of one record (two levels of merges) or all at once; run again; one session: to 1e-9."""
    found = []
    for k, size in enumerate((10_000, 10**9)):
        other = replace(spec, folder=spec.base / f"b{k}", batch_bytes=size)
        outcome = run_campaign(other, client)
        group = outcome.done[outcome.groups[0].ident].result
        assert group["refined"] > 20_000 and group["fault"] is None
        assert make_tables(other, outcome)["groups"]["refined"].tolist() == [group["refined"]]
        found.append(table(group["modes"]))
        assert facts(run_campaign(other, client)) == facts(outcome)
    np.testing.assert_allclose(found[0], found[1], rtol=1e-9)

    names = sorted((spec.base / "records").glob("*.npy"))
    i, c = spec.identification, spec.channels
    with okid.Session(1, 3, fs=c.fs_hz, method=i.method, p=i.p, refine=True, sigma="none") as session:
        first = True
        for name in sorted(names, key=lambda name: order_of(spec, name)):
            rows = np.load(name)[:, :4] * np.array(c.scale) + np.array(c.offset)
            session.feed(rows - rows.mean(axis=0))
            session.gap()
            if first:
                session.restore(session.to_bytes())
                first = False
        whole = session.identify()
    assert whole.refinement is not None and whole.refinement.samples == group["refined"]
    np.testing.assert_allclose(table([mode._asdict() for mode in whole.modes]), found[0], rtol=2e-3)

    truth = np.array([[mode.frequency_hz, mode.damping_ratio] for mode in structure(COLUMNS).modes()])
    plain = run_campaign(replace(spec, folder=spec.base / "plain", identification=replace(i, refine="no")), client)
    unrefined = table(plain.done[plain.groups[0].ident].result["modes"])
    assert np.all(abs(found[0] / truth - 1)[:, 1] < abs(unrefined / truth - 1)[:, 1].max())
    assert np.max(abs(found[0] / truth - 1)[:, 1]) < 0.01


def order_of(spec: Any, name: Path) -> Any:
    from okid.campaign.pieces import part_of

    ref = f"records/{name.name}"
    return part_of(ref, 0), ref


def test_a_group_that_grows_keeps_its_sums(tmp_path: Path, client: Any) -> None:
    """Four records, then four more: what was read is not read again, the result is that of eight."""
    made = campaign(tmp_path, YEAR, {**ONE, "[output]": '[output]\nkeep = "parts"'})
    names = sorted((tmp_path / "records").glob("*.npy"))
    aside = [name.rename(name.with_suffix(".later")) for name in names[4:]]
    first = run_campaign(made, client)
    for name in aside:
        name.rename(name.with_suffix(".npy"))
    second = run_campaign(made, client)
    assert (first.read, second.read) == (4, 4)
    whole = run_campaign(replace(made, folder=tmp_path / "whole"), client)
    groups = [out.done[out.groups[0].ident].result for out in (second, whole)]
    assert groups[0]["refined"] > 1.9 * first.done[first.groups[0].ident].result["refined"]
    np.testing.assert_allclose(table(groups[0]["modes"]), table(groups[1]["modes"]), rtol=1e-3)


def test_ambient_records_cannot_be_refined(tmp_path: Path) -> None:
    made = campaign(tmp_path, replace(YEAR, records=2, samples=300))
    text = (tmp_path / "SPEC.toml").read_text().replace('inputs = ["force"]', "inputs = []")
    made.path.write_text(text.replace("[identification]", '[identification]\nrefine = "auto"'))
    with pytest.raises(okid.InputError, match='"refine": a refinement needs a measured force'):
        load_spec(made.path)
