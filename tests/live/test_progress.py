# SPDX-License-Identifier: MIT
"""Progress on stderr: what is done, how much of it, how long it goes on; on a terminal, off it, and quiet."""

from __future__ import annotations

import contextlib
import io
import os
import pty
import re
import subprocess
import sys
import threading
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import okid as okid_package
import pytest
from lines import line, node_config, packet
from okid.data import notebook_progress, progress
from okid.data.progress import Progress, progress_text
from program import PROGRAM, okid
from two_masses import rig_text, simulate_rig

LINE = re.compile(r"okid: (\d+) s, replaying \S+a\.log, (\d+) %(?:, (\d+) s left)?\s*")


@pytest.fixture(autouse=True)
def wanted(monkeypatch: pytest.MonkeyPatch) -> None:
    """The other tests are without."""
    monkeypatch.delenv("OKID_PROGRESS")


@pytest.fixture(scope="module")
def rig(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return simulate_rig(tmp_path_factory.mktemp("rig"), rig_text(14.0, 500.0), lags=20)


def on_terminal(command: list[str], folder: Path) -> tuple[int, str, str]:
    """Exit code, what came to stdout (a file) and to the terminal of stderr."""
    shown, inside = pty.openpty()
    said = b""
    with (
        (folder / "out").open("wb") as out,
        subprocess.Popen(command, stdout=out, stderr=inside, stdin=subprocess.DEVNULL) as process,
        contextlib.suppress(OSError),  # the end of a terminal
    ):
        os.close(inside)
        while piece := os.read(shown, 4096):
            said += piece
    os.close(shown)
    return process.returncode, (folder / "out").read_text(), said.decode()


@pytest.mark.realtime
def test_a_replay_off_a_terminal_says_one_line_every_ten_seconds(rig: Path) -> None:
    """A log of 14 s at its own speed: one line, at 10 s, with a time that is left; stdout has none of it."""
    slow = [rig / "a.log", "-c", rig / "a.toml", "--speed", "1", "--json", rig / "slow.json"]
    done = subprocess.run([PROGRAM, "replay", *map(str, slow)], capture_output=True, text=True, check=True)
    lines = [LINE.fullmatch(line) for line in done.stderr.splitlines()]
    told = [line for line in lines if line]
    assert 1 <= len(told) <= 1 + int(told[-1][1]) // 10 and abs(int(told[0][1]) - 10) <= 1
    assert 40 <= int(told[0][2]) <= 100 and (told[0][3] is None or int(told[0][3]) < 14)
    fast = okid("replay", rig / "a.log", "-c", rig / "a.toml", "--json", rig / "fast.json", status=0)
    assert done.stdout == fast.stdout and (rig / "slow.json").read_bytes() == (rig / "fast.json").read_bytes()


@pytest.mark.realtime
def test_a_terminal_has_one_line_that_goes_away_again(rig: Path, tmp_path: Path) -> None:
    command = [PROGRAM, "replay", str(rig / "a.log"), "-c", str(rig / "a.toml"), "--speed", "3"]
    code, out, said = on_terminal(command, tmp_path)
    told = [found for piece in said.split("\r") if (found := LINE.match(piece))]
    assert code == 0 and len(told) >= 2 and "replaying" not in out
    assert [int(one[2]) for one in told] == sorted(int(one[2]) for one in told) and any(one[3] for one in told)
    assert said.endswith("\r" + " " * 78 + "\r")
    code, _, said = on_terminal([*command, "--quiet"], tmp_path)
    assert code == 0 and said == ""


@pytest.mark.realtime
def test_python_says_the_same(tmp_path: Path) -> None:
    """okid-convert of several files, on a terminal: which one, how many are done."""
    for k in range(3):
        (tmp_path / f"{k}.csv").write_text("# fs_hz: 10\na,b\n1,2\n3,4\n")
    script = (
        "import sys, time; from okid.formats import conversion as c; from okid.data import progress\n"
        "progress.FIRST_S = 0.2; progress.REDRAW_S = 0.1; real = c._run\n"
        "c._run = lambda *a: (time.sleep(0.5), real(*a))[1]\n"
        "sys.exit(c.convert(sys.argv[1:]))"
    )
    files = [str(tmp_path / f"{k}.csv") for k in range(3)]
    for quiet in ([], ["--quiet"]):
        target = tmp_path / f"out{len(quiet)}"
        code, out, said = on_terminal(
            [sys.executable, "-c", script, *files, f"{target}/", "--to", "mat", *quiet], tmp_path
        )
        assert code == 0, said
        assert len(list(target.iterdir())) == 3
        told = re.findall(r"okid-convert: \d+ s, converting \S+\.csv, (\d+) %", said)
        assert bool(told) == (out.count("samples x") == 3) == (not quiet) and set(told) <= {"0", "33", "67"}


@pytest.mark.realtime
def test_a_recording_says_how_many_frames_came(tmp_path: Path) -> None:
    """On a terminal, of a node that sends a packet of one sample a hundredth of a second."""
    config = node_config(tmp_path, f'[record]\ndirectory = "{tmp_path}"\n')
    with line(tmp_path / "tty") as ours:
        over = threading.Event()

        def send() -> None:
            sequence = 0
            while not over.wait(0.01):
                ours.write(packet(sequence, [[sequence % 100, 1]], time_us=10000 * sequence))
                sequence += 1

        sender = threading.Thread(target=send)
        sender.start()
        code, _, said = on_terminal([PROGRAM, "record", str(config), "--duration", "5"], tmp_path)
        over.set()
        sender.join()
    told = re.findall(r"okid: \d+ s, recording, (\d+) frames, (\d+) %", said)
    assert code == 0 and len(told) >= 2, said
    assert [int(frames) for frames, _ in told] == sorted(int(frames) for frames, _ in told) and int(told[-1][1]) <= 100


class _Out(io.StringIO):
    """A terminal, or none, that can be waited for."""

    def __init__(self, terminal: bool) -> None:
        super().__init__()
        self._terminal, self._more = terminal, threading.Condition()

    def isatty(self) -> bool:
        return self._terminal

    def write(self, text: str) -> int:
        with self._more:
            self._more.notify_all()
            return super().write(text)

    def wait_until(self, text: str) -> None:
        with self._more:
            assert self._more.wait_for(lambda: text in self.getvalue(), 1800), self.getvalue()


@pytest.mark.parametrize("terminal", [True, False])
def test_stage_share_and_time(terminal: bool) -> None:
    out = _Out(terminal)
    with Progress("okid-x", out=out, hurry=100.0) as shown:
        shown.stage("reading a\x1b.csv")
        out.wait_until("reading a\\x1b.csv")
        shown.stage("adding", 0.5, "5/10 records")
        out.wait_until("adding 5/10 records, 50 %")
        shown.stage("adding", 0.75, "7/10 records")
        out.wait_until("adding 7/10 records, 75 %")
    said = out.getvalue()
    assert said.startswith("\rokid-x: " if terminal else "okid-x: ")
    assert said.count("\n") == (0 if terminal else len(said.splitlines())) and (not terminal or said.endswith("\r"))


@pytest.mark.parametrize("by", ["argument", "environment"])
def test_nobody_who_does_not_want_it_has_it(by: str, monkeypatch: pytest.MonkeyPatch) -> None:
    if by == "environment":
        monkeypatch.setenv("OKID_PROGRESS", "0")
    with Progress("okid-x", wanted=by != "argument", out=_Out(False), hurry=1000.0):
        assert all(thread.name != "okid progress" for thread in threading.enumerate())
    out = _Out(False)
    with Progress("okid-x", out=out):  # over before it is worth a line
        pass
    assert out.getvalue() == ""


def test_time_that_is_left() -> None:
    assert progress_text("a", None, 5.0) == "a"
    assert progress_text("a", 0.01, 5.0) == "a, 1 %" and progress_text("a", 0.25, 5.0) == "a, 25 %, 15 s left"
    assert progress_text("a", 1.2, 5.0) == "a, 100 %" and progress_text("a", 0.99, 1.0) == "a, 99 %"
    assert progress_text("a", 0.75, 5.0, begun_at=0.5) == "a, 75 %, 5 s left"  # what an earlier run did is no speed


def test_a_notebook_has_it_below_the_cell(monkeypatch: pytest.MonkeyPatch) -> None:
    """Nothing of it is left at the end; where there is no kernel, there is no line."""
    shown: list[str] = []
    first = threading.Event()

    def display(content: dict[str, str], raw: bool, display_id: bool) -> Any:
        assert raw and display_id
        shown.append(content["text/plain"])
        first.set()
        return SimpleNamespace(update=lambda content, raw: shown.append(content["text/plain"]))

    for name in ("FIRST_S", "REDRAW_S"):
        monkeypatch.setattr(progress, name, 0.001)
    assert not notebook_progress.in_notebook()
    kernel = SimpleNamespace(get_ipython=lambda: SimpleNamespace(kernel=True))
    for module, content in (("ipykernel", SimpleNamespace()), ("IPython", kernel)):
        monkeypatch.setitem(sys.modules, module, content)
    monkeypatch.setitem(sys.modules, "IPython.display", SimpleNamespace(display=display))
    with notebook_progress.cell_progress() as line:
        line.stage("looking")
        assert first.wait(1800)
    assert shown[0].startswith("okid: 0 s, ") and shown[-1] == ""


def test_identify_names_its_stages(monkeypatch: pytest.MonkeyPatch) -> None:
    stages: list[str] = []

    class Line:
        def __enter__(self) -> Any:
            return SimpleNamespace(stage=stages.append)

        def __exit__(self, *_fault: object) -> None:
            pass

    monkeypatch.setattr(notebook_progress, "cell_progress", Line)
    u, y = okid_package.demo_record()
    okid_package.identify(u, y, fs=1000.0)
    assert stages == []  # no notebook
    monkeypatch.setitem(sys.modules, "ipykernel", SimpleNamespace())
    okid_package.identify(u, y, fs=1000.0)
    assert any("looking with several methods" in stage for stage in stages)
