# SPDX-License-Identifier: MIT
"""[realtime]: what the threads that serve devices and disk have been given, as the kernel tells it."""

from __future__ import annotations

import subprocess
import time
from pathlib import Path

import program
import pytest
from lines import Line, node_config, packet
from waiting import until

RECORD = '[record]\ndirectory = "runs"\n'


def status(pid: int, thread: str = "") -> dict[str, str]:
    place = f"/proc/{pid}/task/{thread}/status" if thread else f"/proc/{pid}/status"
    return {
        key: value.strip() for key, _, value in (row.partition(":") for row in Path(place).read_text().splitlines())
    }


def threads(pid: int) -> list[tuple[int, int, str]]:
    """(policy, priority, processors) of every thread."""
    out = []
    for each in Path(f"/proc/{pid}/task").iterdir():
        fields = (each / "stat").read_text().rpartition(")")[2].split()
        out.append((int(fields[38]), int(fields[37]), status(pid, each.name)["Cpus_allowed_list"]))
    return out


def live(folder: Path, section: str, *before: str) -> tuple[list[tuple[int, int, str]], dict[str, str], str]:
    """Threads and status of a run that has begun to record, and what it said."""
    tty = Line(folder / "tty")
    process = subprocess.Popen(
        [*before, program.PROGRAM, "run", str(node_config(folder, RECORD + section))],
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        text=True,
    )
    until(lambda: list((folder / "runs").glob("*.okj")) or process.poll() is not None)
    assert process.poll() is None, process.communicate()[1]
    tty.write(packet(0, [[1, 2]] * 20))
    time.sleep(0.3)
    seen = threads(process.pid), status(process.pid)
    process.terminate()
    said = process.communicate(timeout=1800)[1]
    tty.unplug()
    return *seen, said


def may_be_first() -> bool:
    return subprocess.run(["chrt", "-f", "1", "true"], capture_output=True, check=False).returncode == 0


def test_priority_processors_and_memory(tmp_path: Path) -> None:
    tasks, whole, said = live(tmp_path, "[realtime]\npriority = 20\nlock_memory = true\ncpus = [0]\n")
    if may_be_first():
        fifo = sorted((priority, cpus) for policy, priority, cpus in tasks if policy == 1)
        assert fifo == [(10, "0"), (20, "0")]  # the recorder, the reader
    else:
        assert "[realtime] priority" in said
    assert (int(whole["VmLck"].split()[0]) > 0) == ("[realtime] lock_memory" not in said)


def test_what_is_refused_is_said_and_the_run_goes_on(tmp_path: Path) -> None:
    poor = (
        "prlimit",
        "--rtprio=0",
        "--memlock=65536",
        "setpriv",
        "--bounding-set=-sys_nice,-ipc_lock",
        "--inh-caps=-all",
    )
    section = "[realtime]\npriority = 20\nlock_memory = true\ncpus = [1000]\n"
    tasks, whole, said = live(tmp_path, section, *poor)
    assert {policy for policy, *_ in tasks} == {0} and whole["VmLck"].split()[0] == "0"
    for key, remedy in (("priority", "rtprio"), ("lock_memory", "memlock"), ("cpus", "nproc")):
        assert said.count(f"[realtime] {key}: ") == 1 and remedy in said, said


def test_what_nobody_asked_for_is_not_complained_about(tmp_path: Path) -> None:
    poor = ("prlimit", "--rtprio=0", "setpriv", "--bounding-set=-sys_nice", "--inh-caps=-all")
    tasks, _, said = live(tmp_path, "", *poor)
    assert {policy for policy, *_ in tasks} == {0}
    assert "realtime" not in said


@pytest.mark.parametrize(
    ("section", "words"),
    [
        ("priority = 100", ["priority", "100", "0 to 99"]),
        ("cpus = []", ["cpus", "at least one"]),
        ("cpus = [0, -1]", ["cpus", "-1", "such as [1]"]),
        ("cpus = 1", ["cpus", "an array"]),
        ('lock_memory = "yes"', ["lock_memory", "true or false"]),
    ],
)
def test_wrong_values(tmp_path: Path, section: str, words: list[str]) -> None:
    (tmp_path / "tty").touch()
    done = program.okid("check", node_config(tmp_path, "[realtime]\n" + section + "\n"))
    assert done.returncode == 2
    for word in ["node.toml", "[realtime]", *words]:
        assert word in done.stderr, done.stderr
