# SPDX-License-Identifier: MIT
"""okid run as a service: what the manager hears, the watchdog, SIGHUP, the command at an alarm, and the unit."""

from __future__ import annotations

import contextlib
import json
import os
import shutil
import signal
import socket
import subprocess
import threading
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import program
import pytest
from lines import Line, line, packet
from two_masses import rig_text
from waiting import VIRTUAL, until

ROOT = Path(__file__).resolve().parents[2]
RATE_HZ = 250
RIG = (
    rig_text(120.0, seed=5)
    + """[[change]]
at_s = 60.0
springs = [3e4, 1.8e4]
"""
)


class Manager:
    """The end of $NOTIFY_SOCKET that a service manager holds."""

    def __init__(self, path: str) -> None:
        self.address = "\0" + path[1:] if path[0] == "@" else path
        self.wire = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
        self.wire.bind(self.address)
        self.told: list[tuple[float, str]] = []
        threading.Thread(target=self._listen, daemon=True).start()

    def _listen(self) -> None:
        while True:
            text = self.wire.recv(4096).decode()
            self.told.append((time.monotonic(), text))

    def texts(self) -> list[str]:
        return [text for _, text in self.told]


@pytest.fixture(scope="module")
def codes(tmp_path_factory: pytest.TempPathFactory) -> list[list[int]]:
    folder = tmp_path_factory.mktemp("service")
    (folder / "rig.toml").write_text(RIG)
    done = program.okid("simulate", folder / "rig.toml", "--quiet", "--csv", folder / "a.csv", "--truth", folder / "t")
    assert done.returncode == 0, done.stderr
    rows = [[float(cell) for cell in row.split(",")] for row in (folder / "a.csv").read_text().splitlines()[3:]]
    largest = [max(abs(row[c]) for row in rows) for c in range(3)]
    return [[round(30000 * v / most) for v, most in zip(row, largest, strict=True)] for row in rows]


def write_config(folder: Path, more: str = "") -> Path:
    text = f'[acquisition]\nrate_hz = {RATE_HZ}\n[[bus]]\nname = "node"\ntype = "serial"\n'
    text += f'device = "{folder / "far-end"}"\nframing = "cobs"\nbaud = 921600\n'
    for i, role in enumerate(["force", "acceleration", "acceleration"]):
        text += f'[[channel]]\nname = "c{i}"\nrole = "{role}"\nfield = {i}\n'
    text += "[identification]\np = 12\nrows = 24\nwindow_s = 8.0\nupdate_s = 0.5\n" + more
    (folder / "live.toml").write_text(text)
    return folder / "live.toml"


@contextlib.contextmanager
def running(folder: Path, more: str = "", **environment: str) -> Iterator[subprocess.Popen[str]]:
    command = [program.PROGRAM, "run", write_config(folder, more), "--events", folder / "e.jsonl"]
    with subprocess.Popen(
        command,
        env=os.environ | environment,
        stdin=subprocess.DEVNULL,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        text=True,
    ) as run:
        try:
            yield run
        finally:
            run.kill()


class Stream:
    """Samples onto the line, so many times faster than they were taken."""

    def __init__(self, to: Line, codes: list[list[int]], speed: float) -> None:
        self.to, self.codes, self.speed, self.stop = to, codes, speed, threading.Event()
        self.thread = threading.Thread(target=self._run, daemon=True)
        self.thread.start()

    def _run(self) -> None:
        begun = time.monotonic()
        for n in range(0, len(self.codes), 10):
            if self.stop.wait(max(0.0, begun + n / RATE_HZ / self.speed - time.monotonic())):
                return
            self.to.write(packet(n, self.codes[n : n + 10], time_us=n * 4000))

    def end(self) -> None:
        self.stop.set()
        self.thread.join()


def events(path: Path) -> list[dict[str, Any]]:
    if not path.exists():
        return []
    return [json.loads(text) for text in path.read_text().rpartition("\n")[0].splitlines()]


@pytest.mark.parametrize("abstract", [False, True])
def test_what_the_manager_hears(tmp_path: Path, codes: list[list[int]], abstract: bool) -> None:
    path = f"@okid-test-{os.getpid()}" if abstract else str(tmp_path / "notify")
    manager = Manager(path)
    with line(tmp_path / "far-end") as ours, running(tmp_path, NOTIFY_SOCKET=path) as run:
        until(lambda: "READY=1" in manager.texts())
        assert manager.texts() == ["READY=1"]
        stream = Stream(ours, codes, 4)
        status = until(lambda: [text for text in manager.texts() if text.startswith("STATUS=")])
        assert "modes" in status[0]
        run.send_signal(signal.SIGTERM)
        assert run.wait(1800) == 0
        stream.end()
    assert manager.texts()[-1] == "STOPPING=1"
    assert not any(text == "WATCHDOG=1" for text in manager.texts())


def test_watchdog_only_while_it_lives(tmp_path: Path) -> None:
    """Twice in the time that is given, with or without samples; a stopped process says nothing."""
    path = str(tmp_path / "notify")
    manager = Manager(path)
    with line(tmp_path / "far-end"), running(tmp_path, NOTIFY_SOCKET=path, WATCHDOG_USEC="1000000") as run:
        beats = until(lambda: (b := [at for at, text in manager.told if text == "WATCHDOG=1"])[4:] and b)
        gaps = [b - a for a, b in zip(beats, beats[1:], strict=False)]
        assert max(gaps) < 0.9 or not VIRTUAL
        run.send_signal(signal.SIGSTOP)
        time.sleep(0.3)
        before = len(manager.told)
        time.sleep(1.5)
        assert len(manager.told) == before
        run.send_signal(signal.SIGCONT)
        until(lambda: len(manager.told) > before)
        run.send_signal(signal.SIGINT)
        assert run.wait(1800) == 3  # nothing was received
    assert manager.texts()[-1] == "STOPPING=1"


def test_another_process_is_meant(tmp_path: Path) -> None:
    path = str(tmp_path / "notify")
    manager = Manager(path)
    with (
        line(tmp_path / "far-end"),
        running(tmp_path, NOTIFY_SOCKET=path, WATCHDOG_USEC="200000", WATCHDOG_PID="1") as run,
    ):
        until(lambda: "READY=1" in manager.texts())
        time.sleep(0.6)
        run.send_signal(signal.SIGINT)
        run.wait(1800)
    assert "WATCHDOG=1" not in manager.texts()


def test_rotation_while_it_runs(tmp_path: Path, codes: list[list[int]]) -> None:
    now, old = tmp_path / "e.jsonl", tmp_path / "e.jsonl.1"
    with line(tmp_path / "far-end") as ours, running(tmp_path) as run:
        stream = Stream(ours, codes, 4)
        until(lambda: len(events(now)) > 4)
        now.rename(old)
        run.send_signal(signal.SIGHUP)
        until(lambda: len(events(now)) > 4)
        run.send_signal(signal.SIGHUP)  # without a rotation nothing is lost
        count = len(events(now))
        until(lambda: len(events(now)) > count + 2)
        run.send_signal(signal.SIGINT)
        assert run.wait(1800) == 0
        stream.end()
    whole = events(old) + events(now)
    assert [event["type"] for event in whole].count("start") == 1 and whole[-1]["type"] == "result"
    times = [event["t"] for event in whole if event["type"] == "modes"]
    left_out = [event for event in whole if event["type"] == "stats"][-1]["updates"]["skipped"]
    due = round((times[-1] - times[0]) / 0.5) + 1
    assert times == sorted(set(times)) and due - left_out <= len(times) <= due  # a busy machine leaves some out


def test_command_at_an_alarm(tmp_path: Path, codes: list[list[int]]) -> None:
    hook = tmp_path / "hook.sh"
    hook.write_text(f'#!/bin/sh\ncat > "{tmp_path}/told.tmp"\nmv "{tmp_path}/told.tmp" "{tmp_path}/told"\nexit 5\n')
    hook.chmod(0o755)
    more = '[alarm]\nbaseline_updates = 10\ncommand = "hook.sh"\n'
    with line(tmp_path / "far-end") as ours, running(tmp_path, more) as run:
        stream = Stream(ours, codes, 8)
        until(lambda: [event for event in events(tmp_path / "e.jsonl") if event["type"] == "alarm"])
        told = json.loads(until(lambda: (tmp_path / "told").exists() and (tmp_path / "told").read_text()))
        time.sleep(0.5)
        run.send_signal(signal.SIGINT)
        assert run.wait(1800) == 0
        stream.end()
        assert run.stderr is not None and "ended with exit code 5" in run.stderr.read()
    alarm = [event for event in events(tmp_path / "e.jsonl") if event["type"] == "alarm"]
    assert alarm == [told]
    assert 60 < told["t"] < 70


def test_a_command_that_hangs_delays_nothing(tmp_path: Path, codes: list[list[int]]) -> None:
    hook = tmp_path / "hook.sh"
    hook.write_text(f'#!/bin/sh\necho $$ > "{tmp_path}/pid"\nexec sleep 60\n')
    hook.chmod(0o755)
    more = '[alarm]\nbaseline_updates = 10\ncommand = "hook.sh"\n'
    with line(tmp_path / "far-end") as ours, running(tmp_path, more) as run:
        stream = Stream(ours, codes, 8)
        until(lambda: (tmp_path / "pid").exists() and (tmp_path / "pid").read_text().strip())
        count = len(events(tmp_path / "e.jsonl"))
        until(lambda: len(events(tmp_path / "e.jsonl")) > count + 5)
        assert run.stderr is not None
        assert "killed after 10 s" in run.stderr.readline()
        stream.end()
        run.send_signal(signal.SIGINT)
        assert run.wait(1800) == 0
    with pytest.raises(ProcessLookupError):
        os.kill(int((tmp_path / "pid").read_text()), 0)


def test_a_command_that_is_not_there(tmp_path: Path) -> None:
    with line(tmp_path / "far-end"), running(tmp_path, '[alarm]\ncommand = "nowhere.sh"\n') as run:
        assert run.wait(1800) == 2
        assert run.stderr is not None and "nowhere.sh" in run.stderr.read()


@pytest.mark.programs
def test_unit_file() -> None:
    """The unit as systemd reads it: every line known, and little is left that it may do."""
    unit = ROOT / "packaging" / "okid.service"
    analyse = shutil.which("systemd-analyze")
    assert analyse is not None, "systemd-analyze is missing: apt-get install systemd"
    done = subprocess.run([analyse, "verify", unit], capture_output=True, text=True, timeout=1800, check=False)
    complaints = [text for text in done.stderr.splitlines() if "is not executable" not in text and "okid" in text]
    assert not complaints
    done = subprocess.run(
        [analyse, "security", "--offline=true", "--threshold=20", unit],
        capture_output=True,
        text=True,
        timeout=1800,
        check=False,
    )
    assert done.returncode == 0, done.stdout
