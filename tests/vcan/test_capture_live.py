# SPDX-License-Identifier: MIT
"""The acquisition scripts on a real vcan: `okid-capture emulate` read by `okid-capture can`, and SYNC frames."""

from __future__ import annotations

import json
import re
import subprocess
import sys
import threading
from collections.abc import Callable
from pathlib import Path

import can
import pytest
from okid import capture
from test_vcan import OKID, interface, sh  # noqa: F401  (interface is a fixture)
from two_masses import rig_text, simulate_rig
from waiting import until

WHERE = ["--interface", "socketcan", "--channel", "vcan0"]


@pytest.fixture(scope="module")
def rig(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """300 frames a second for 6 s."""
    return simulate_rig(tmp_path_factory.mktemp("rig"), rig_text(6.0, 150.0), lags=12)


def lines_of(log: Path) -> int:
    return log.read_bytes().count(b"\n") if log.exists() else -1


def captured(rig: Path, folder: Path, meanwhile: Callable[[], None], *options: str) -> int:
    """Exit code of `okid-capture can` on vcan0; `meanwhile` runs once it listens."""

    def wait_then_act() -> None:
        until(lambda: lines_of(folder / "r.log") >= 0)
        meanwhile()

    thread = threading.Thread(target=wait_then_act, daemon=True)
    thread.start()
    outputs = ["--out", str(folder / "r.log"), "--json", str(folder / "r.json")]
    code = capture.main(["can", *WHERE, "--config", str(rig / "a.toml"), *outputs, *options])
    thread.join()
    return code


def test_emulated_node_to_modes_without_a_loss(rig: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    said: list[str] = []

    def emulate() -> None:
        command = [sys.executable, "-m", "okid.capture", "emulate", str(rig / "rig.toml"), *WHERE]
        done = subprocess.run(command, capture_output=True, text=True, timeout=1800, check=False)
        said.append(done.stdout + done.stderr)

    assert captured(rig, tmp_path, emulate, "--frames", "1800") == 0
    assert re.search(r"1800 frames in .* deadlines, late by ", said[0]), said
    assert "can0: 1800 received, 0 lost" in capsys.readouterr().out
    result, truth = json.loads((tmp_path / "r.json").read_text()), json.loads((rig / "t.json").read_text())
    assert (result["samples"], result["gaps"]) == (900, 0)
    assert len(result["modes"]) == len(truth["frequency_hz"])
    for mode, frequency in zip(result["modes"], truth["frequency_hz"], strict=True):
        assert abs(mode["frequency_hz"] / frequency - 1) < 2e-3
        assert abs(mode["frequency_hz"] - frequency) < 5 * mode["frequency_std_hz"]
    again = tmp_path / "again.json"
    sh(OKID, "replay", str(tmp_path / "r.log"), "-c", str(rig / "a.toml"), "--json", str(again))
    for mode, replayed in zip(result["modes"], json.loads(again.read_text())["modes"], strict=True):
        assert abs(mode["frequency_hz"] / replayed["frequency_hz"] - 1) < 1e-9


def test_link_down_keeps_everything(rig: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    def play_then_down() -> None:
        sh(OKID, "replay", str(rig / "a.log"), "--to", "vcan0", "--speed", "4")
        until(lambda: lines_of(tmp_path / "r.log") == 1800)
        sh("ip", "link", "set", "vcan0", "down")

    assert captured(rig, tmp_path, play_then_down) == 4
    shown = capsys.readouterr().err
    assert "Network is down" in shown
    assert "what came before is in the result" in shown
    assert json.loads((tmp_path / "r.json").read_text())["samples"] == 900


def test_sync_frames_with_a_counter(capsys: pytest.CaptureFixture[str]) -> None:
    with can.Bus(interface="socketcan", channel="vcan0") as bus:
        assert capture.main(["sync", *WHERE, "--rate", "100", "--count", "100", "--counter", "7"]) == 0
        got = [message for _ in range(100) if (message := bus.recv(0.2))]
    sent, missed = (int(number) for number in re.findall(r"(\d+) (?:sent|missed)", capsys.readouterr().out))
    assert sent + missed == 100
    assert len(got) == sent
    assert {message.arbitration_id for message in got} == {0x80}
    counters = [message.data[0] for message in got]
    assert set(counters) <= set(range(1, 8))
    assert missed or counters == [k % 7 + 1 for k in range(100)]
