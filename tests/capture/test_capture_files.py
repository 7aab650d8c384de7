# SPDX-License-Identifier: MIT
"""okid-capture and the files it is given: none that is read is written over, older logs are appended to and that is
said, damaged ones are refused as by okid-convert."""

from __future__ import annotations

import os
import shutil
from pathlib import Path

import can
import pytest
from captured import frames
from okid import capture


@pytest.fixture
def own(rig: Path, tmp_path: Path) -> Path:
    """A folder of its own with a.log, a.toml, a.dbc, rig.toml, and hard.log, another name of a.log."""
    for name in ("a.log", "a.toml", "a.dbc", "rig.toml"):
        shutil.copy(rig / name, tmp_path / name)
    os.link(tmp_path / "a.log", tmp_path / "hard.log")
    (tmp_path / "soft.log").symlink_to("a.log")
    (tmp_path / "b.csv").write_text("time_s,f\n0.0,1.0\n")
    return tmp_path


def run(folder: Path, line: str) -> int:
    """The command with every file name put into the folder."""
    words = [str(folder / word) if Path(word).suffix and not word.startswith("-") else word for word in line.split()]
    return capture.main(words)


@pytest.mark.parametrize(
    ("line", "words"),
    [
        ("can --log a.log --out a.log", "a.log: is --log, a file to be read; --out does not overwrite it"),
        ("can --log a.log --out hard.log", "hard.log: is --log"),
        ("can --log a.log --out soft.log", "soft.log: is --log"),
        ("can --interface file --channel a.log --out a.log", "a.log: is --log"),
        ("can --log a.log --config a.toml --json a.log", "a.log: is --log"),
        ("can --log a.log --config a.toml --json a.toml", "a.toml: is --config"),
        ("can --log a.log --config a.toml --json a.dbc", "a.dbc: is the DBC of --config"),
        ("can --log a.log --config a.toml --out new.log --json new.log", "new.log: --out and --json are the same file"),
        ("can --log a.log --out new.log --dbc a.dbc --csv a.dbc", "a.dbc: is --dbc"),
        ("can --log a.log --out new.log --dbc a.dbc --csv new.log", "new.log: --out and --csv are the same file"),
        ("serial --from a.log --config a.toml --json a.log", "a.log: is --from"),
        ("serial --port loop:// --config a.toml --out a.toml", "a.toml: is --config"),
        ("emulate rig.toml --interface virtual --channel x --write-config rig.toml", "rig.toml: is the RIG.toml"),
        ("emulate rig.toml --interface virtual --channel x --truth rig.toml", "rig.toml: is the RIG.toml"),
        ("emulate rig.toml --interface virtual --channel x --write-config n.toml --truth n.toml", "the same file"),
        ("emulate rig.toml --interface virtual --channel x --write-config n.toml --truth n.dbc", "the same file"),
    ],
)
def test_no_file_is_written_over(own: Path, capsys: pytest.CaptureFixture[str], line: str, words: str) -> None:
    before = {path.name: path.read_bytes() for path in own.iterdir()}
    assert run(own, line) == 2
    shown = capsys.readouterr().err
    assert words in shown and shown.startswith("okid-capture: ") and shown.count("\n") == 1
    assert {path.name: path.read_bytes() for path in own.iterdir()} == before


def test_what_is_appended_to_is_said(own: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(own, "can --log a.log --out new.log") == 0
    assert capsys.readouterr().err == ""
    assert run(own, "can --log a.log --out new.log --frames 10") == 0
    assert f"{own / 'new.log'}: holds 3000 frames already: appended\n" in capsys.readouterr().err
    assert len(frames(own / "new.log")) == 3010


@pytest.mark.parametrize(
    ("line", "words"),
    [
        ("can --log a.log --out a.toml", "a.toml: is there and is no `candump -L` log: nothing is appended to it"),
        ("can --log a.log --out new.blf", "new.blf: --out is `candump -L` text: name it "),
        ("can --log b.csv --out new.log", "b.csv: holds samples, expected CAN frames; identify samples with okid iden"),
        ("can --log b.csv --config a.toml", "holds samples"),
        ("emulate b.csv --interface virtual --channel x", "holds samples"),
    ],
)
def test_files_of_another_kind(own: Path, capsys: pytest.CaptureFixture[str], line: str, words: str) -> None:
    before = (own / "a.toml").read_bytes()
    assert run(own, line) == 2
    shown = capsys.readouterr().err
    assert words in shown and shown.count("\n") == 1
    assert (own / "a.toml").read_bytes() == before and not (own / "new.blf").exists()


def test_a_log_that_is_cut_off_is_refused(own: Path, capsys: pytest.CaptureFixture[str]) -> None:
    with can.Logger(own / "whole.blf") as logger:
        for message in frames(own / "a.log"):
            message.channel = 0
            logger(message)
    data = (own / "whole.blf").read_bytes()
    (own / "cut.blf").write_bytes(data[: len(data) * 2 // 3])
    for line in ("can --log cut.blf --config a.toml", "can --log cut.blf --out new.log"):
        assert run(own, line) == 2
        assert f"{own / 'cut.blf'}: has " in (shown := capsys.readouterr().err) and "the file is cut off" in shown
    assert not (own / "new.log").exists()


def test_error_frames_and_times_of_a_log_are_kept(own: Path, capsys: pytest.CaptureFixture[str]) -> None:
    lines = (own / "a.log").read_text().splitlines(keepends=True)[:20]
    (own / "e.log").write_text("".join(lines) + "(1700000009.000000) can0 20000004#0000000000000000\n")
    assert run(own, "can --log e.log --out new.log") == 0
    assert "21 frames over" in (shown := capsys.readouterr().out) and "1 error frames" in shown
    with can.Logger(own / "t.asc") as logger:
        for message in frames(own / "e.log")[:20]:
            message.channel = 0
            logger(message)
    first = frames(own / "t.asc")[0].timestamp
    assert first == pytest.approx(frames(own / "e.log")[0].timestamp, abs=1e-2)
