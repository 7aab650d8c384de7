# SPDX-License-Identifier: MIT
"""What release 0.1.0 wrote is read for ever, and gives the numbers it gave then: see README.md."""

from __future__ import annotations

import json
import shutil
import subprocess
from pathlib import Path
from typing import Any

import numpy as np
import okid
import pytest
from methods import METHODS
from okid import report
from program import okid as run_okid
from words_only import leave_pictures_out

HERE = Path(__file__).resolve().parent
OLD = HERE / "0.1.0"

# Relative; another processor or BLAS adds in another order. A small difference of large numbers has fewer digits.
LOOSE = {"std": 1e-4, "damping_ratio": 1e-6, "R": 1e-5, "mkr": 1e-6, "Y": 1e-7, "percent": 1e-6, "doubtful": 1e-4}
# Depend on the signs and order that the SVD happens to choose, or say which release wrote them.
REWORDED = {  # texts that say the same in better words
    "start anew after": "restart after",
    "bear no more unknowns": "support no more unknowns",
    "it is the hardest of the three (a channel late by 1 % of a sample spoils it); R_normal_modes and R of pdc are the "
    "better ones": "it is the least certain of the three (a channel late by 1 % of a sample distorts it); use "
    "R_normal_modes or R of pdc",
    "every mode that holds over the orders": "every stable mode",
}
SKIPPED = {"A", "B", "C", "D", "K", "x0", "version", "wall_time", "config"}


def tolerance(path: str) -> float:
    return max((loose for part, loose in LOOSE.items() if part in path), default=1e-8)


def compare(now: Any, then: Any, path: str = "") -> None:
    """Everything that was there then is there now: words equal, numbers equal to rounding. Keys may have been added."""
    if isinstance(then, dict):
        assert isinstance(now, dict), path
        for key, value in then.items():
            if key in SKIPPED and "mkr" not in path:
                continue
            assert key in now, f"{path}.{key}"
            compare(now[key], value, f"{path}.{key}")
    elif isinstance(then, list) and then and isinstance(then[0], list | dict):
        assert len(now) == len(then), path
        for k, (one, other) in enumerate(zip(now, then, strict=True)):
            compare(one, other, f"{path}[{k}]")
    elif isinstance(then, list) and then and isinstance(then[0], float):
        scale = max(abs(one) for one in then if one is not None)
        assert [one is None for one in now] == [one is None for one in then], path
        a, b = ([np.nan if one is None else one for one in each] for each in (now, then))
        np.testing.assert_allclose(a, b, rtol=tolerance(path), atol=tolerance(path) * scale, err_msg=path)
    elif isinstance(then, float):
        assert now == pytest.approx(then, rel=tolerance(path), abs=1e-9), path
    else:
        for old, new in REWORDED.items() if isinstance(then, str) else ():
            then = then.replace(old, new)
        assert now == then, path


def events(path: Path) -> list[dict[str, Any]]:
    return [json.loads(line) for line in path.read_text().splitlines()]


def done(*arguments: object) -> subprocess.CompletedProcess[str]:
    out = run_okid(*arguments)
    assert out.returncode == 0, out.stderr
    return out


@pytest.mark.parametrize("source", [["run.log", "-c", OLD / "run.toml"], ["run.okj"]], ids=["log", "journal"])
def test_replay(source: list[Any], tmp_path: Path) -> None:
    """A candump log with its configuration, and a journal that carries it: the events of then, word for word."""
    done("replay", OLD / source[0], *source[1:], "--events", tmp_path / "e.jsonl")
    now, then = events(tmp_path / "e.jsonl"), events(OLD / "run.events.jsonl")
    assert [one["type"] for one in now] == [one["type"] for one in then]
    compare(now, then)


def test_journal_is_the_log(tmp_path: Path) -> None:
    done("convert", OLD / "run.okj", tmp_path / "again.log")
    assert (tmp_path / "again.log").read_text() == (OLD / "run.log").read_text()


def test_decoded_samples(tmp_path: Path) -> None:
    done("convert", OLD / "run.log", tmp_path / "r.csv", "-c", OLD / "run.toml")
    assert (tmp_path / "r.csv").read_text() == (OLD / "record.csv").read_text()


@pytest.mark.parametrize("name", [*METHODS, "ambient", "refined"])
def test_identify(name: str, tmp_path: Path) -> None:
    given: list[Any] = ["--outputs", "acc1,acc2", "--hold", "zoh", "--p", 10, "--rows", 20, "--order", 4, "--quiet"]
    given += ["--method", name if name in METHODS else "okid-era"]
    given += ["--detrend", "none" if name == "refined" else "mean", "--sigma-blocks", 0 if name == "refined" else 8]
    given += [] if name == "ambient" else ["--inputs", "force1"]
    given += ["--input-dofs", "1", "--output-dofs", "1,2"] if name in METHODS else []
    given += ["--refine", "--stabilization"] if name == "refined" else []
    done("identify", OLD / "record.csv", *given, "--json", tmp_path / "r.json")
    compare(json.loads((tmp_path / "r.json").read_text()), json.loads((OLD / "results" / f"{name}.json").read_text()))


def test_records_merged(tmp_path: Path) -> None:
    """Two records from rest under a linear force, order and warnings found by itself."""
    given: list[Any] = [
        "--inputs",
        "force1",
        "--outputs",
        "acc1,acc2",
        "--hold",
        "foh",
        "--start",
        "rest",
        "--rows",
        10,
    ]
    given += ["--method", "n4sid-moesp", "--sigma-blocks", 8, "--input-dofs", "1", "--output-dofs", "1,2", "--quiet"]
    done("identify", OLD / "record.csv", OLD / "record.csv", *given, "--json", tmp_path / "r.json")
    now = json.loads((tmp_path / "r.json").read_text())
    new = [warning for warning in now["warnings"] if warning["code"] == "records_repeated"]  # 0.1 did not say so
    assert len(new) == 1
    now["warnings"].remove(new[0])
    compare(now, json.loads((OLD / "results" / "merged.json").read_text()))


@pytest.mark.parametrize("name", [*METHODS, "ambient", "refined", "merged"])
def test_result_is_reported(name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """okid-report reads an old result and shows its modes; pictures are those of one kind of result each."""
    if name not in ("okid-era", "ambient", "merged"):
        leave_pictures_out(monkeypatch)
    path = OLD / "results" / f"{name}.json"
    assert report.main([str(path), "--out", str(tmp_path / "r.html")]) == 0
    page = (tmp_path / "r.html").read_text()
    modes = json.loads(path.read_text())["modes"]
    assert len(modes) == 2 and all(f"{mode['frequency_hz']:.2f}" in page for mode in modes)


STATES = json.loads((OLD / "states.json").read_text())


@pytest.mark.parametrize("name", list(STATES))
def test_state(name: str) -> None:
    """A state is restored to the last bit, and identified from; it goes on taking samples."""
    data, then = (OLD / f"{name}.state").read_bytes(), STATES[name]
    sums = okid.Accumulator.from_bytes(data)
    assert sums.to_bytes() == data
    assert sums.stats._asdict() == then["stats"] and sums.rows == then["rows"]
    assert float(np.trace(sums.gram()[0])) == pytest.approx(then["gram_trace"], rel=1e-12)
    found = okid.Identifier(1, 2, fs=100.0, p=4, rows=8, order=4).run(sums)
    np.testing.assert_allclose(found.frequency_hz, then["frequency_hz"], rtol=1e-9)
    np.testing.assert_allclose(found.damping_ratio, then["damping_ratio"], rtol=1e-7)
    more = np.arange(30).reshape(10, 3) % 7
    sums.add(more.astype(np.int16 if sums.codes else np.float64))
    assert sums.stats.samples == then["stats"]["samples"] + 10


def test_campaign(tmp_path: Path) -> None:
    """The state of a campaign is taken over: no record is read again, neither for the same model nor for another."""
    from dask.distributed import Client, LocalCluster
    from okid.campaign.run import run_campaign
    from okid.campaign.spec import load_spec

    shutil.copytree(OLD / "campaign", tmp_path / "campaign")
    path = tmp_path / "campaign" / "SPEC.toml"
    then = json.loads((OLD / "campaign.modes.json").read_text())
    with (
        LocalCluster(n_workers=1, threads_per_worker=1, processes=False, dashboard_address="127.0.0.1:0") as cluster,
        Client(cluster, set_as_default=False) as client,
    ):
        for order in ("order 6", "order 5"):
            path.write_text(path.read_text().replace("order = 6", order.replace(" ", " = ")))
            outcome = run_campaign(load_spec(path), client)
            assert outcome.read == 0
            modes = {group.label: outcome.done[group.ident].result["modes"] for group in outcome.groups}
            compare(modes, then[order], order)
