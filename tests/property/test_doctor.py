# SPDX-License-Identifier: MIT
"""okid doctor on what a run writes to and starts; of devices: tests/vcan, tests/gpio and tests/io."""

from __future__ import annotations

import os
from pathlib import Path

import pytest
from program import okid
from two_masses import rig_text, simulate_rig


@pytest.fixture(scope="module")
def rig(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The config reads its own log, so that no bus is missing."""
    folder = simulate_rig(tmp_path_factory.mktemp("doctor"), rig_text(2.0))
    text = (folder / "a.toml").read_text()
    text = text.replace('type = "socketcan"', 'type = "replay"\nfile = "a.log"').replace("bitrate = 1000000\n", "")
    (folder / "a.toml").write_text(text)
    return folder


def doctor(rig: Path, sections: str) -> tuple[int, str]:
    (rig / "d.toml").write_text((rig / "a.toml").read_text() + sections)
    done = okid("doctor", rig / "d.toml")
    return done.returncode, done.stdout


def test_recording(rig: Path) -> None:
    code, text = doctor(rig, '[record]\ndirectory = "runs/a/b"\nsegment_mb = 1\nmax_mb = 4\n')
    assert code == 0 and "ok       recording" in text and "are deleted at 4 MB" in text, text
    assert not (rig / "runs").exists()
    code, text = doctor(rig, '[record]\ndirectory = "runs"\nsegment_mb = 64\nmax_mb = 1e9\n')
    assert code == 0 and "note     recording" in text and "lower [record] max_mb" in text, text
    code, text = doctor(rig, '[record]\ndirectory = "a.log"\n')
    assert code == 4 and "missing  recording" in text and "a.log is no folder" in text, text


def test_alarm_command(rig: Path) -> None:
    command = rig / "call.sh"
    command.write_text("#!/bin/sh\n")
    command.chmod(0o644)
    code, text = doctor(rig, '[alarm]\ncommand = "call.sh"\n')
    assert code == 4 and "missing  alarm command" in text and f"chmod +x {command}" in text, text
    command.chmod(0o755)
    code, text = doctor(rig, '[alarm]\ncommand = "call.sh"\n')
    assert code == 0 and f"ok       alarm command          {command}" in text, text


def test_publish_socket(rig: Path) -> None:
    code, text = doctor(rig, '[publish]\nsocket = "okid.sock"\n')
    assert code == 0 and "ok       publish socket" in text, text
    code, text = doctor(rig, '[publish]\nsocket = "none/okid.sock"\n')
    assert code == 4 and "No such file or directory" in text and f"mkdir -p {rig / 'none'}" in text, text
    code, text = doctor(rig, '[publish]\nsocket = "a.log"\n')
    assert code == 4 and "another file has this name" in text, text


def test_processors(rig: Path) -> None:
    mine = min(os.sched_getaffinity(0))
    code, text = doctor(rig, f"[realtime]\ncpus = [{mine}]\n")
    assert code == 0 and "ok       processors" in text, text
    code, text = doctor(rig, f"[realtime]\ncpus = [{mine}, 1000]\n")
    assert code == 4 and "missing  processors" in text and "cpus: 1000 not here" in text, text


@pytest.mark.parametrize("option", ["--json", "--events", "--speed"])
def test_an_empty_value_is_refused(rig: Path, option: str) -> None:
    """A variable of a script that was not set."""
    done = okid("replay", rig / "a.log", "-c", rig / "a.toml", option, "")
    assert done.returncode == 2
    assert f"{option}: found an empty value" in done.stderr, done.stderr


def test_support_bundle(rig: Path) -> None:
    text = (rig / "a.toml").read_text() + '\n[publish]\nmqtt = "mqtt://me:hush hush@localhost/lab"\n'
    (rig / "b.toml").write_text(text)
    lines = [f'{{"type":"modes","t":{k}}}' for k in range(100)] + ['{"type":"result","long":"' + "x" * 5000 + '"}']
    (rig / "e.jsonl").write_text("\n".join(lines) + "\n")
    done = okid("support-bundle", rig / "b.toml", "--events", rig / "e.jsonl", "--lines", "3", "--out", rig / "s.txt")
    assert done.returncode == 0, done.stderr
    told = (rig / "s.txt").read_text()
    version = okid("--version").stdout.strip()
    for wanted in (version, os.uname().release, "## okid doctor", "[publish]", lines[98], lines[99], "3027 more bytes"):
        assert wanted in told, (wanted, told)
    assert "hush" not in told and lines[97] not in told
    (rig / "c.toml").write_text("[acquisition]\nrate_hz = -5\n")
    told = okid("support-bundle", rig / "c.toml").stdout
    assert "c.toml" in told and "rate_hz" in told.split("## okid doctor")[0] and "rate_hz = -5" in told
    assert okid("support-bundle", "--events", rig / "none").returncode == 2


def test_kernels_of_openblas(monkeypatch: pytest.MonkeyPatch) -> None:
    """Those in use have their name; kernels without AVX2 on a processor that has it are called a fallback."""
    flags = Path("/proc/cpuinfo").read_text().split()
    monkeypatch.delenv("OPENBLAS_CORETYPE", raising=False)
    text = okid("doctor").stdout
    line = next(line for line in text.splitlines() if "linear algebra" in line)
    assert "OpenBLAS 0." in line and "kernels for " in line, text
    if "avx2" not in flags:
        return
    monkeypatch.setenv("OPENBLAS_CORETYPE", "Haswell")
    assert "ok       linear algebra" in okid("doctor").stdout
    monkeypatch.setenv("OPENBLAS_CORETYPE", "Prescott")
    text = okid("doctor").stdout
    assert "note     linear algebra" in text and "kernels for Prescott: a fallback" in text, text
    assert "-> unset OPENBLAS_CORETYPE" in text, text
