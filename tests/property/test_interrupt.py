# SPDX-License-Identifier: MIT
"""Ctrl-C at any moment of a batch command, once and twice: exit 130, what was there stays, no half file is left."""

from __future__ import annotations

import random
import signal
import subprocess
import time
from pathlib import Path

import pytest
from program import PROGRAM
from two_masses import rig_text, simulate_rig

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


@pytest.mark.parametrize("times", [1, 2])
@pytest.mark.parametrize("name", ["identify", "simulate", "convert"])
def test_nothing_is_left(rig: Path, tmp_path: Path, name: str, times: int) -> None:
    draw = random.Random(name)
    command = [PROGRAM, *map(str, commands(rig, tmp_path)[name])]
    target = tmp_path / ("out.csv" if name == "convert" else "out")
    target.write_text(OLD)
    began = time.monotonic()
    subprocess.run(command, capture_output=True, check=True)
    whole_s, whole = time.monotonic() - began, target.read_bytes()
    interrupted = 0
    for _ in range(8):
        target.write_text(OLD)
        with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE) as run:
            time.sleep(draw.uniform(0.1, 0.9) * whole_s)
            for _ in range(times):
                run.send_signal(signal.SIGINT)
            said, told = run.communicate(timeout=60)
        # a shell calls the signal's own end 130 too: it came before main(), or it is the second
        assert run.returncode in (0, 130, -signal.SIGINT), told
        interrupted += run.returncode != 0
        assert target.read_bytes() in ([OLD.encode(), whole] if run.returncode else [whole])
        assert [path.name for path in tmp_path.iterdir()] == [target.name], "a half-written file was left"
        assert b"Traceback" not in told and (run.returncode == 0 or said == b"")
    assert interrupted > 0
