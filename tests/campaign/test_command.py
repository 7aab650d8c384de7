# SPDX-License-Identifier: MIT
"""okid-campaign as people run it: simulate, check, run, report; exit codes; a page that holds everything itself."""

from __future__ import annotations

import json
import os
import re
import signal
import subprocess
import sys
from contextlib import nullcontext
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
from okid.campaign.command import main
from okid.campaign.spec import load_spec
from okid.campaign.state_folder import StateFolder
from waiting import until


def command(*arguments: object) -> subprocess.CompletedProcess[str]:
    """The command that is on the PATH, whose worker processes import it anew."""
    return subprocess.run(
        [Path(sys.executable).parent / "okid-campaign", *map(str, arguments)],
        capture_output=True,
        text=True,
        timeout=1800,
        check=False,
    )


@pytest.fixture(scope="module")
def year(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """100 days, two records a day, a column loses 1 % on day 70."""
    folder = tmp_path_factory.mktemp("command") / "year"
    options = ["--records", 200, "--days", 100, "--samples", 1024, "--damage", 0.01, "--damage-day", 70]
    done = command("simulate", folder, *options)
    assert done.returncode == 0, done.stderr
    spec = folder / "SPEC.toml"
    text = spec.read_text().replace('title = "3-storey frame', 'title = "<b>&amp; frame').replace("p = 20", "p = 12")
    text = re.sub(r"pieces = \d+", "pieces = 4", text)
    spec.write_text(text.replace("training_share = 0.4", "training_share = 0.5"))
    (folder / "records" / "frame_20250103T060000.npy").write_bytes(b"broken <script>")
    return folder


@pytest.fixture(scope="module")
def done(year: Path) -> subprocess.CompletedProcess[str]:
    return command("run", year / "SPEC.toml", "--workers", 1)


def test_run_finds_the_damage(year: Path, done: subprocess.CompletedProcess[str]) -> None:
    assert done.returncode == 0, done.stderr
    assert "199 records summed (200 read now), 1 left out; 100 of 100 groups with modes" in done.stdout
    assert "left out: records/frame_20250103T060000.npy: not a record, or damaged" in done.stderr
    found = re.search(r"frame: alarm since (\S+)", done.stdout)
    truth = json.loads((year / "truth.json").read_text())
    assert found is not None
    late = pd.Timestamp(found[1], tz="UTC") - pd.Timestamp(truth["damage_time"])
    assert -pd.Timedelta(days=1) <= late <= pd.Timedelta(days=2)
    assert "Traceback" not in done.stderr


def test_tables_hold_the_truth(year: Path, done: subprocess.CompletedProcess[str]) -> None:
    tables = {name: pd.read_parquet(year / "out" / f"{name}.parquet") for name in ("records", "groups", "modes")}
    assert len(tables["records"]) == 200 and (tables["records"]["status"] == "summed").sum() == 199
    assert len(tables["groups"]) == 100 and tables["groups"]["sums_sha256"].nunique() == 100
    modes = tables["modes"]
    assert set(modes["track"].dropna()) == {1, 2, 3}
    truth = json.loads((year / "truth.json").read_text())
    before = modes[modes["time"] < truth["damage_time"]]
    for track, f in zip((1, 2, 3), truth["frequency_hz_at_15_c"], strict=True):
        own = before[before["track"] == track]
        expected = f * (1.0 + truth["relative_change_per_c"] * (own["temperature_c"] - 15.0))
        assert (own["frequency_hz"] / expected - 1.0).abs().max() < 2e-3
        assert own["frequency_std_hz"].notna().mean() > 0.8


def test_page_is_self_contained_and_escaped(year: Path, done: subprocess.CompletedProcess[str]) -> None:
    html = (year / "out" / "report.html").read_text()
    assert "<h1>&lt;b&gt;&amp;amp; frame" in html and "<script>" not in html
    assert not re.search(r"(?:src|href)\s*=\s*[\"'](?!#)", html) and "http://" not in html.replace(
        "http://www.w3.org", ""
    )
    for words in (
        "Trend of frame",
        "Control charts",
        "temperature [°C]",
        "time (UTC)",
        "f1 [Hz]",
        "ζ1 [%]",
        "5 %, half of it",
    ):
        assert words in html, words
    assert "prefers-color-scheme: dark" in html


def test_report_again_is_the_same(
    year: Path, done: subprocess.CompletedProcess[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """But for the last line, which names the command and the time."""
    monkeypatch.setenv("SOURCE_DATE_EPOCH", "0")
    assert main(["report", str(year / "out"), "--html", str(year / "again.html")]) == 0
    first, again = ((year / name).read_text() for name in ("out/report.html", "again.html"))
    foot = re.compile(r"<footer>.*?</footer>")
    assert foot.sub("", first) == foot.sub("", again) and "1970-01-01 00:00:00 UTC by: okid-campaign report" in again


@pytest.fixture
def inside(client: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    """The command's cluster is the one of this process."""
    monkeypatch.setattr("okid.campaign.run.connected", lambda *_: nullcontext(client))


def test_second_run_reads_nothing(
    year: Path, done: subprocess.CompletedProcess[str], inside: None, capsys: pytest.CaptureFixture[str]
) -> None:
    """Not even the broken record again: its reason is known."""
    assert main(["run", str(year / "SPEC.toml")]) == 0
    said = capsys.readouterr()
    assert "199 records summed (0 read now), 1 left out" in said.out and "not a record, or damaged" in said.err


def test_check_tells_what_there_is(year: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["check", str(year / "SPEC.toml")]) == 0
    told = capsys.readouterr().out
    assert "200 records" in told and "100 groups by day" in told


def test_interrupt_ends_with_130_and_is_resumed(
    tmp_path: Path, inside: None, capsys: pytest.CaptureFixture[str]
) -> None:
    """SIGINT while batches are under way: what is finished counts in the next run."""
    assert main(["simulate", str(tmp_path), "--records", "60", "--days", "60", "--samples", "4096"]) == 0
    spec = load_spec(tmp_path / "SPEC.toml")
    text = (tmp_path / "SPEC.toml").read_text()
    (tmp_path / "SPEC.toml").write_text(text.replace("[output]", "[output]\nbatch_mb = 1"))
    process = subprocess.Popen(
        [sys.executable, "-m", "okid.campaign", "run", tmp_path / "SPEC.toml", "--workers", "1"],
        stdout=subprocess.PIPE, stderr=subprocess.PIPE, start_new_session=True, text=True,
    )  # fmt: skip
    state = spec.folder / "state" / spec.sums_key
    until(lambda: list(state.glob("*.sums")))
    os.killpg(process.pid, signal.SIGINT)  # as a terminal does: the workers get it too
    _, said = process.communicate(timeout=1800)
    assert process.returncode == 130 and "run again to go on" in said and "Traceback" not in said, said
    kept = sum(len(files) for files in StateFolder(spec.folder, spec.sums_key).load().values())
    assert 0 < kept < 60
    assert main(["run", str(tmp_path / "SPEC.toml")]) == 0
    assert f"60 records summed ({60 - kept} read now)" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("run", "none.toml"), "none.toml: No such file"),
        (("check", "none.toml"), "none.toml: No such file"),
        (("report", "none"), "campaign.json: No such file or directory; expected the output folder"),
        (("simulate", "x", "--records", "0"), "records is 0, expected 1 to 1000000"),
        (("run", "x", "--workers", "0"), "'0' is no number from 1 to 4096"),
    ],
)
def test_wrong_use_is_exit_2(
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    arguments: tuple[str, ...],
    words: str,
) -> None:
    monkeypatch.chdir(tmp_path)
    try:
        code: object = main(arguments)
    except SystemExit as end:
        code = end.code
    assert code == 2 and words in capsys.readouterr().err
    assert not list(tmp_path.iterdir())


def test_no_scheduler_at_the_address(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("okid.campaign.cluster._CONNECT_S", 1)
    assert main(["simulate", str(tmp_path), "--records", "1", "--samples", "256"]) == 0
    assert main(["run", str(tmp_path / "SPEC.toml"), "--cluster", "tcp://127.0.0.1:9"]) == 2


def test_no_model_is_exit_3(
    tmp_path: Path, client: object, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr("okid.campaign.run.connected", lambda *_: nullcontext(client))
    assert main(["simulate", str(tmp_path), "--records", "2", "--samples", "1000"]) == 0
    for path in (tmp_path / "records").iterdir():
        np.save(path, np.zeros((1000, 4), np.int16))
    assert main(["run", str(tmp_path / "SPEC.toml")]) == 3
    assert "no group gives a model: no model:" in capsys.readouterr().err
