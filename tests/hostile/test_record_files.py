# SPDX-License-Identifier: MIT
"""Records of other formats: okid identify starts okid-convert. Whatever ends it, no folder and no process stays behind;
a name is a name; a converter that a stranger put beside the program is not started."""

from __future__ import annotations

import os
import shutil
import signal
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
from okid.formats.command import main as convert
from program import PROGRAM
from waiting import until

PATIENCE = 1800.0
TABLE = "time_s,f,a\n" + "".join(f"{k / 100},{k % 7},{k % 5}\n" for k in range(50))


class Bench:
    """A copy of the program with a converter of our own beside it."""

    def __init__(self, folder: Path) -> None:
        self.folder, self.temporary = folder, folder / "temporary"
        self.temporary.mkdir()
        (folder / "bin").mkdir()
        self.program = shutil.copy(PROGRAM, folder / "bin" / "okid")
        self.record = folder / "r.mat"
        self.record.write_bytes(b"x")

    def converter(self, text: str, place: str = "bin") -> Path:
        path = self.folder / place / "okid-convert"
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(f"#!/bin/sh\n{text}\n")
        path.chmod(0o755)
        return path

    def start(self, **more: Any) -> subprocess.Popen[str]:
        return subprocess.Popen(
            [self.program, "identify", self.record, "--inputs", "f", "--outputs", "b"],
            stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True,
            env={"PATH": os.defpath, "TMPDIR": str(self.temporary)}, **more,
        )  # fmt: skip

    def said(self, **more: Any) -> str:
        run = self.start(**more)
        text = run.communicate(timeout=PATIENCE)[1]
        assert run.returncode == 2 and list(self.temporary.iterdir()) == [], (run.returncode, text)
        return text


@pytest.fixture
def bench(tmp_path: Path) -> Bench:
    return Bench(tmp_path)


def gone(pid: int) -> bool:
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return True
    return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] == "Z"


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_a_conversion_that_is_stopped(bench: Bench, number: signal.Signals) -> None:
    """Release 0.2 left the folder, and the converter at work."""
    note = f"{bench.folder}/started"
    bench.converter(f'echo part >"$4.part"; echo $$ >{note}.new; mv {note}.new {note}; exec sleep 1800')
    run = bench.start()
    until((bench.folder / "started").exists, run)
    assert list(bench.temporary.iterdir())
    run.send_signal(number)
    text = run.communicate(timeout=PATIENCE)[1]
    assert run.returncode == 130 and text == "okid: interrupted; no file is left half-written\n"
    assert list(bench.temporary.iterdir()) == []
    pid = int((bench.folder / "started").read_text())
    until(lambda: gone(pid))


def test_the_table_has_no_name(bench: Bench) -> None:
    """Nothing is left however the program ends, and messages name the file of the user."""
    (bench.folder / "t.csv").write_text(TABLE)
    bench.converter(f'cp {bench.folder}/t.csv "$4"')
    text = bench.said()
    assert text.startswith(f"okid: {bench.record}") and 'no column "b"' in text and "/proc/" not in text, text


def test_who_started_the_program_does_not_wait_for_children(bench: Bench) -> None:
    """Then a child leaves no exit code: it was taken for a success."""
    bench.converter('echo "okid-convert: $3: is torn" >&2\nexit 2')
    text = bench.said(preexec_fn=lambda: signal.signal(signal.SIGCHLD, signal.SIG_IGN))
    assert text == f"okid: {bench.record}: is torn\n"


def test_a_message_stays_one_line(bench: Bench) -> None:
    bench.record = bench.folder / "a\nokid: all is well \x1b[31m.mat"
    bench.record.write_bytes(b"x")
    bench.converter('echo "okid-convert: $3: is torn" >&2\nexit 2')
    text = bench.said()
    assert text == f"okid: {bench.folder}/a\\nokid: all is well \\x1b[31m.mat: is torn\n"
    bench.record = bench.folder / "no\nfile.csv"
    assert len(bench.said().splitlines()) == 1


@pytest.mark.skipif(os.geteuid() != 0, reason="makes a file of another user")
def test_a_converter_of_a_stranger(bench: Bench) -> None:
    """Beside a program in a folder for all, as /tmp/okid, and in .venv/bin beside that folder."""
    for place in ("bin", ".venv/bin"):
        path = bench.converter(f"touch {bench.folder}/ran", place)
        os.chown(path, 65534, 65534)
        assert "neither beside okid nor in PATH" in bench.said(), place
        os.chown(path, 0, 0)
        os.chown(path.parent, 65534, 65534)
        assert "neither beside okid nor in PATH" in bench.said(), place
        path.unlink()
        os.chown(path.parent, 0, 0)
    assert not (bench.folder / "ran").exists()


def test_names_on_their_way_to_a_terminal(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "a\x1b[31mb.csv").write_text(TABLE)
    (tmp_path / "tables").mkdir()
    assert convert([str(tmp_path / "a\x1b[31mb.csv"), f"{tmp_path}/tables/", "--to", "mat"]) == 0
    assert convert([str(tmp_path / "no\nfile.csv"), f"{tmp_path}/tables/"]) == 2
    said = capsys.readouterr()
    assert "\x1b" not in said.out and "a\\x1b[31mb.mat: 50 samples" in said.out
    assert said.err.count("\n") == 1 and "no\\nfile.csv" in said.err


SLOW = """
import signal, sys
from okid.data.whole_file import safe_part
from okid.formats import command, conversion

def slow(args, source, target):
    with safe_part(target) as part:
        part.write_text("half")
        print("there", flush=True)
        signal.pause()

conversion._run = slow
sys.exit(command.main())
"""


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_okid_convert_is_ended(tmp_path: Path, number: signal.Signals) -> None:
    run = subprocess.Popen(
        [sys.executable, "-c", SLOW, "in.mat", str(tmp_path / "out.csv")], stdout=subprocess.PIPE,
        stderr=subprocess.PIPE, text=True,
    )  # fmt: skip
    assert run.stdout is not None and run.stdout.readline() == "there\n"
    run.send_signal(number)
    text = run.communicate(timeout=PATIENCE)[1]
    assert run.returncode == 130 and text == "okid-convert: interrupted, the file in work was not written\n"
    assert list(tmp_path.iterdir()) == []
