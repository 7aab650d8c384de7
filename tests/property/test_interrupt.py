# SPDX-License-Identifier: MIT
"""Ctrl-C at any moment of a batch command, once and twice: exit 130, what was there stays, no half file is left."""

from __future__ import annotations

import os
import random
import signal
import subprocess
from pathlib import Path

import pytest
from program import PROGRAM
from two_masses import rig_text, simulate_rig
from waiting import until

OLD = '{"the result": "of the run before"}'


@pytest.fixture(scope="module")
def rig(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = simulate_rig(tmp_path_factory.mktemp("interrupt"), rig_text(120.0))
    (folder / "long.toml").write_text(rig_text(200.0, 1000.0))
    return folder


def commands(rig: Path, out: Path) -> dict[str, list[object]]:
    columns = ["--inputs", "force1", "--outputs", "acc1,acc2"]
    return {
        "identify": ["identify", rig / "a.csv", *columns, "--json", out / "out"],
        "simulate": ["simulate", rig / "long.toml", "--log", out / "out", "--quiet"],
        "convert": ["convert", rig / "a.log", out / "out.csv", "-c", rig / "a.toml"],
    }


def worked_s(pid: int | str, of: int = 0) -> float:
    """Processor time of a process; of = 2: of those that it has waited for."""
    fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11 + of]) + int(fields[12 + of])) / os.sysconf("SC_CLK_TCK")


@pytest.mark.parametrize("times", [1, 2])
@pytest.mark.parametrize("name", ["identify", "simulate", "convert"])
def test_nothing_is_left(rig: Path, tmp_path: Path, name: str, times: int) -> None:
    draw = random.Random(name)
    command = [PROGRAM, *map(str, commands(rig, tmp_path)[name])]
    target = tmp_path / ("out.csv" if name == "convert" else "out")
    target.write_text(OLD)
    before = worked_s("self", 2)
    answer = subprocess.run(command, capture_output=True, check=True).stdout
    whole_s, whole = worked_s("self", 2) - before, target.read_bytes()
    interrupted = 0
    for part in (0.0, *(draw.uniform(0.1, 0.9) for _ in range(7))):  # of the work, however long the processor takes
        target.write_text(OLD)
        with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE) as run:
            until(lambda run=run, at=part * whole_s: worked_s(run.pid) >= at or run.poll() is not None)
            for _ in range(times):
                run.send_signal(signal.SIGINT)
            said, told = run.communicate(timeout=1800)
        # a shell calls the signal's own end 130 too: it came before main(), or it is the second
        assert run.returncode in (0, 130, -signal.SIGINT), told
        interrupted += run.returncode != 0
        complete = target.read_bytes() == whole
        assert complete or (run.returncode and target.read_bytes() == OLD.encode())
        assert [path.name for path in tmp_path.iterdir()] == [target.name], "a half-written file was left"
        assert b"Traceback" not in told
        # a signal between the last byte of the answer and the end of the process finds both complete
        assert said == answer or (run.returncode and said == b""), told
        assert complete or said == b""
    assert interrupted > 0
