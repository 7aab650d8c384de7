# SPDX-License-Identifier: MIT
"""A file in the place of another, a place that cannot be written, a slip in the command line: one line that helps."""

from __future__ import annotations

import errno
import json
import os
import subprocess
from pathlib import Path
from typing import Any

import numpy as np
import okid
import pytest
import report_files
from okid import report
from okid.record.demo import demo_record
from okid.report import targets
from report_files import FS

pytestmark = pytest.mark.usefixtures("words_only")

CONFIG = '# a frame\n[acquisition]\nrate_hz = 250.0\n[[bus]]\nname = "can0"\n'
RIG = "rate_hz = 250.0\nmasses = [2.0, 1.5]\nsprings = [1.0, 2.0]\n"
WRITES = "expected an okid.result/1, as `okid identify`, `okid run` or `okid replay` writes it with --json FILE"


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A result, and one file of every other kind."""
    place = tmp_path_factory.mktemp("kinds")
    u, y = demo_record(1500)
    result = okid.identify(u, y, fs=FS, p=15, sigma_blocks=0)
    result.save(place / "result.json")
    report_files.write_csv(place / "run.csv", ["u1", "y1", "y2", "y3"], np.hstack([u, y]), FS)
    report_files.write_events(place / "events.jsonl", ["y1", "y2", "y3"], [10.0])
    whole = (place / "result.json").read_text(encoding="utf-8")
    truth = {"schema": "okid.truth/1", "frequency_hz": [1.0], "fs_hz": 1000.0}
    for name, text in {
        "truth.json": json.dumps(truth), "pretty.json": json.dumps(truth, indent=1), "list.json": "[1, 2]",
        "other.json": '{"a": 1}', "newer.json": '{"schema": "okid.result/2"}', "cut.json": whole[:2000],
        "frame.toml": CONFIG, "rig.toml": RIG, "run.log": "(1700000000.000000) vcan0 100#00009DFF\n" * 3,
        "log.csv": "(1700000000.000000) vcan0 100#00009DFF\n" * 3, "frame.dbc": 'VERSION ""\nBU_: Node\n',
        "can.csv": "timestamp,arbitration_id,extended,remote,error,dlc,data\n1.0,0x100,0,0,0,1,AA==\n",
        "page.html": "<!DOCTYPE html>\n<html></html>\n", "words.txt": "hello\n", "empty.json": "",
    }.items():  # fmt: skip
        (place / name).write_text(text, encoding="utf-8")
    for name, data in {
        "run.okj": b"\x8fOKJ\r\n\x1a\n\x01", "page.pdf": b"%PDF-1.4\n", "a.png": b"\x89PNG\r\n\x1a\n", "x.bin": b"a\0b"
    }.items():  # fmt: skip
        (place / name).write_bytes(data)
    (place / "dir").mkdir()
    return place


def refusal(folder: Path, arguments: list[str], capsys: pytest.CaptureFixture[str]) -> str:
    """What the command says: one line, exit 2, and every file as before."""
    before = {path.name: path.read_bytes() for path in folder.iterdir() if path.is_file()}
    assert report.main(arguments) == 2
    said = capsys.readouterr()
    assert said.out == ""
    assert said.err.startswith("okid-report: ")
    assert said.err.count("\n") == 1
    assert {path.name: path.read_bytes() for path in folder.iterdir() if path.is_file()} == before
    return said.err.removeprefix("okid-report: ").rstrip("\n")


@pytest.mark.parametrize(
    ("name", "words"),
    [
        (
            "truth.json",
            "is the truth of a simulation (schema 'okid.truth/1'), {}: give the file of --json, not that of",
        ),
        (
            "pretty.json",
            "is the truth of a simulation (schema 'okid.truth/1'), {}: give the file of --json, not that of",
        ),
        (
            "events.jsonl",
            "is JSON lines, the events of a run, {}: give it with --events, and the file of --json here",
        ),
        ("frame.toml", "is a CONFIG.toml, {}: `okid replay LOG -c frame.toml --json result.json` makes one"),
        ("rig.toml", "is a RIG.toml, {}: `okid simulate rig.toml --log run.log --config frame.toml`, then"),
        (
            "run.csv",
            "is a table of samples (CSV), {}: `okid identify run.csv --inputs NAMES --outputs NAMES --json res",
        ),
        ("run.log", "is a log of CAN frames (candump -L), {}: `okid replay run.log -c CONFIG.toml --json result.json`"),
        ("run.okj", "is a journal of CAN frames, {}: `okid replay run.okj --json result.json` makes one"),
        ("can.csv", "is a table of CAN frames, {}"),
        ("frame.dbc", "is a DBC, {}"),
        ("page.html", "is an HTML page, {}"),
        ("page.pdf", "is a PDF, {}"),
        ("a.png", "is a picture, {}"),
        ("x.bin", "is a binary file, {}"),
        ("dir", "is a folder, {}"),
        ("empty.json", "is empty, {}"),
        ("newer.json", "is JSON of the schema 'okid.result/2', {}"),
    ],
)
def test_what_is_no_result_is_called_by_its_name(
    folder: Path, name: str, words: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(folder)
    assert refusal(folder, [name], capsys).startswith(f"{name}: {words.format(WRITES)}")


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("absent.json", "No such file or directory; {}"),
        ("no/absent.json", "No such file or directory; {}"),
        ("words.txt", "1:1: not JSON: Expecting value; {}"),
        ("cut.json", "(cut off, or edited?); {}"),
        ("list.json", "schema is None, expected 'okid.result/1', as `okid identify`"),
        ("other.json", "schema is None, expected 'okid.result/1', as `okid identify`"),
    ],
)
def test_a_result_that_cannot_be_read(
    folder: Path, name: str, words: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(folder)
    told = refusal(folder, [name], capsys)
    assert told.startswith(f"{name}:")
    assert words.format(WRITES) in told
    assert told.endswith("writes it with --json FILE")


RECORD = "expected the record that the result is of (a table of samples)"
LINES = "expected JSON lines as `okid run` or `okid replay` writes them with --events FILE"


@pytest.mark.parametrize(
    ("option", "name", "words"),
    [
        ("--record", "result.json", f"is a result of okid, {RECORD}"),
        ("--record", "truth.json", f"is the truth of a simulation (schema 'okid.truth/1'), {RECORD}"),
        ("--record", "events.jsonl", f"is JSON lines, the events of a run, {RECORD}: give it with --events"),
        ("--record", "frame.toml", f"is a CONFIG.toml, {RECORD}: give it with --config"),
        ("--record", "run.log", f"{RECORD}: `okid convert run.log run.csv -c CONFIG.toml` makes one"),
        ("--record", "log.csv", f"is a log of CAN frames (candump -L), {RECORD}"),
        ("--record", "run.okj", f"{RECORD}: `okid convert run.okj run.csv` makes one"),
        ("--record", "can.csv", f"{RECORD}: `okid-convert can.csv run.csv --config CONFIG.toml"),
        ("--record", "dir", f"is a folder, {RECORD}"),
        ("--record", "words.txt", "no table of numbers was found"),
        ("--events", "result.json", f"is a result of okid, {LINES}"),
        ("--events", "run.csv", f"is a table of samples (CSV), {LINES}: give it with --record"),
        ("--events", "frame.toml", f"is a CONFIG.toml, {LINES}: give it with --config"),
        ("--events", "dir", f"is a folder, {LINES}"),
        ("--config", "result.json", "is a result of okid, expected a CONFIG.toml"),
        ("--config", "events.jsonl", "expected a CONFIG.toml of okid: give it with --events"),
        ("--config", "frame.dbc", "is a DBC, expected a CONFIG.toml"),
        ("--geometry", "run.csv", 'run.csv: line 2: found \'"u1","y1","y2","y3"\', expected one of node,NUM'),
        ("--geometry", "dir", "is a folder, expected a CONFIG.toml"),
        ("--geometry", "rig.toml", "no section [geometry], expected nodes, dofs and lines"),
    ],
)
def test_files_behind_the_wrong_option(
    folder: Path,
    option: str,
    name: str,
    words: str,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(folder)
    told = refusal(folder, ["result.json", option, name, "--out", "o.html"], capsys)
    assert told.startswith(f"{name}: ")
    assert words in told


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (["--out", "no/r.html"], "no/r.html: No such file or directory: the folder no is not there: make it "
         "(mkdir -p), or name another file by --out"),
        (["--out", "words.txt/r.html"], "words.txt/r.html: Not a directory: words.txt is a file: name another file by"),
        (["--out", "dir"], "dir: is a folder, expected the name of a file, say dir/report.html"),
        (["--out", "r.pdf"], "r.pdf: the page is HTML, expected a name that ends in .html; --pdf r.pdf prints it too"),
        (["--out", "o.html", "--pdf", "no/r.pdf"], "no/r.pdf: No such file or directory: the folder no is not there"),
        (["--out", "o.html", "--pdf", "dir"], "dir: is a folder, expected the name of a file, say dir/report.pdf"),
        (["--pdf", "r.html"], "r.html: would be a PDF, expected a name that ends in .pdf; --out r.html names the page"),
    ],
)  # fmt: skip
def test_places_that_cannot_be_written_are_told_before_any_work(
    folder: Path, options: list[str], words: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(folder)
    monkeypatch.setattr("okid.report.command._page", lambda *_: pytest.fail("the page was made"))
    assert refusal(folder, ["result.json", *options], capsys).startswith(words)


def test_a_folder_that_takes_no_files(
    folder: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Root may write anywhere, so the system is asked in vain here."""
    monkeypatch.chdir(folder)
    monkeypatch.setattr(targets.os, "access", lambda *_: False)
    told = refusal(folder, ["result.json", "--out", "dir/r.html"], capsys)
    assert told == (
        "dir/r.html: Permission denied: the folder dir takes no new files: open it (chmod u+w), or name another file "
        "by --out"
    )


def test_a_full_disk(folder: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    def full(self: Path, *_: Any, **__: Any) -> None:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC), str(self))

    monkeypatch.chdir(folder)
    monkeypatch.setattr(Path, "write_text", full)
    told = refusal(folder, ["result.json", "--out", "dir/r.html"], capsys)
    assert told == (
        "dir/r.html: No space left on device: the report cannot be written there, name another file by --out"
    )


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ([], f"RESULT.json is missing: {WRITES.removeprefix('expected ')}"),
        (["--out", "o.html"], "RESULT.json is missing"),
        (
            ["result.json", "run.csv"],
            "run.csv: found after RESULT.json, expected one result; a record goes after --re",
        ),
        (["result.json", "--titel", "x"], "--titel is no option: did you mean --title?"),
        (["result.json", "--events-file=e.jsonl"], "--events-file=e.jsonl is no option: did you mean --events?"),
        (["result.json", "--frobnicate"], "--frobnicate is no option ("),
        (["result.json", "-x"], "-x is no option"),
        (["result.json", "--record"], "--record needs FILE after it"),
        (["result.json", "--config", "--pdf"], "--config needs CONFIG.toml after it"),
    ],
)
def test_slips_in_the_command_line(arguments: list[str], words: str, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as ended:
        report.main(arguments)
    assert ended.value.code == 2
    said = capsys.readouterr().err
    assert said.startswith(f"okid-report: {words}")
    assert said.endswith("(example and all options: okid-report --help)\n")
    assert said.count("\n") == 1


def test_a_result_through_a_pipe_is_not_looked_at_twice(folder: Path) -> None:
    """As a shell gives it: <(command). A named pipe is refused (tests/hostile/test_inputs.py)."""
    with subprocess.Popen(["cat", folder / "result.json"], stdout=subprocess.PIPE) as writer:
        assert writer.stdout is not None
        assert len(report.load_result(f"/dev/fd/{writer.stdout.fileno()}").shapes) > 0
        assert writer.wait(timeout=1800) == 0
