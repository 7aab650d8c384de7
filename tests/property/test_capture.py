# SPDX-License-Identifier: MIT
"""okid-capture on python-can's virtual bus: the log holds every frame, in candump's own form, whatever ends it."""

from __future__ import annotations

import itertools
import os
import signal
import subprocess
import sys
import threading
from collections.abc import Iterator
from pathlib import Path

import can
import pytest
from okid import capture
from waiting import until

DBC = """VERSION ""
NS_ :
BS_:
BU_: Rig
BO_ 256 Shaker: 4 Rig
 SG_ Force : 0|16@1- (0.01,0) [-300|300] "N" Rig
 SG_ Counter : 16|8@1+ (1,0) [0|255] "" Rig
"""
_numbers = itertools.count()


@pytest.fixture
def buses() -> Iterator[tuple[str, can.BusABC, can.BusABC]]:
    name = f"okid-test-{os.getpid()}-{next(_numbers)}"
    receiver = can.Bus(interface="virtual", channel=name)
    sender = can.Bus(interface="virtual", channel=name, preserve_timestamps=True)
    yield name, receiver, sender
    sender.shutdown()
    receiver.shutdown()


def frame(number: int, **options: object) -> can.Message:
    data = bytes([number & 255, number >> 8 & 255, number & 255, 0])
    given = {"arbitration_id": 0x100, "data": data, "is_extended_id": False, "timestamp": 1.7e9 + number / 1000.0}
    return can.Message(**{**given, **options})  # type: ignore[arg-type]


def test_every_kind_of_frame_in_candump_form(buses: tuple[str, can.BusABC, can.BusABC], tmp_path: Path) -> None:
    _, receiver, sender = buses
    frames = [
        (frame(1), "(1700000000.001000) can0 100#01000100"),
        (frame(2, arbitration_id=0x18F02D05, is_extended_id=True), "(1700000000.002000) can0 18F02D05#02000200"),
        (frame(3, arbitration_id=0x12, is_extended_id=True, data=b""), "(1700000000.003000) can0 00000012#"),
        (frame(4, is_remote_frame=True, data=None, dlc=8), "(1700000000.004000) can0 100#R8"),
        (frame(5, is_remote_frame=True, data=None, dlc=0), "(1700000000.005000) can0 100#R"),
        (frame(6, is_fd=True, bitrate_switch=True), "(1700000000.006000) can0 100##106000600"),
        (
            frame(7, is_fd=True, error_state_indicator=True, data=bytes(12)),
            "(1700000000.007000) can0 100##2" + "00" * 12,
        ),
        (
            frame(8, is_error_frame=True, arbitration_id=0x4, data=bytes(8)),
            "(1700000000.008000) can0 20000004#" + "00" * 8,
        ),
    ]
    for message, _ in frames:
        sender.send(message)
    summary = capture.record_bus(receiver, tmp_path / "a.log", frames=len(frames))
    assert (tmp_path / "a.log").read_text().splitlines() == [line for _, line in frames]
    assert (summary.frames, summary.errors, summary.fault) == (8, 1, None)
    assert summary.first == pytest.approx(1700000000.001)
    assert summary.identifiers["100"] == 5
    assert "8 frames" in summary.text()


def test_python_can_reads_the_log_back(buses: tuple[str, can.BusABC, can.BusABC], tmp_path: Path) -> None:
    _, receiver, sender = buses
    sent = [frame(k, is_fd=k % 3 == 0, is_extended_id=k % 2 == 0) for k in range(200)]
    for message in sent:
        sender.send(message)
    capture.record_bus(receiver, tmp_path / "a.log", frames=200)
    with can.LogReader(tmp_path / "a.log") as reader:
        back = list(reader)
    assert len(back) == 200
    for one, other in zip(sent, back, strict=True):
        assert one.equals(other, timestamp_delta=2e-6, check_direction=False, check_channel=False)


def test_appends_and_repairs_a_torn_last_line(buses: tuple[str, can.BusABC, can.BusABC], tmp_path: Path) -> None:
    _, receiver, sender = buses
    log = tmp_path / "a.log"
    log.write_text("(1.000000) can0 100#00\n(2.000000) can0 100#0")
    sender.send(frame(1))
    capture.record_bus(receiver, log, frames=1)
    lines = log.read_text().splitlines()
    assert lines[:2] == ["(1.000000) can0 100#00", "(2.000000) can0 100#0"]
    assert lines[2].endswith("can0 100#01000100")


def test_ends_by_clock_and_by_request(buses: tuple[str, can.BusABC, can.BusABC], tmp_path: Path) -> None:
    _, receiver, _ = buses
    ticks = itertools.count(0, 0.6)
    summary = capture.record_bus(receiver, tmp_path / "a.log", duration=2.0, clock=lambda: next(ticks))
    assert (summary.frames, summary.first) == (0, None)
    assert capture.record_bus(receiver, tmp_path / "a.log", stop=lambda: True).frames == 0
    assert "0 frames" in summary.text()


def test_a_failing_bus_keeps_what_came_before(tmp_path: Path) -> None:
    class Failing:
        def __init__(self) -> None:
            self.left = 3

        def recv(self, timeout: float | None = None) -> can.Message:
            if self.left == 0:
                raise can.CanOperationError("Network is down")
            self.left -= 1
            return frame(self.left)

    summary = capture.record_bus(Failing(), tmp_path / "a.log")  # type: ignore[arg-type]
    assert (summary.frames, summary.fault) == (3, "Network is down")
    assert len((tmp_path / "a.log").read_text().splitlines()) == 3


def test_decoding_beside_the_log(buses: tuple[str, can.BusABC, can.BusABC], tmp_path: Path) -> None:
    name, _, sender = buses
    (tmp_path / "rig.dbc").write_text(DBC, encoding="utf-8")
    arguments = ["can", "--interface", "virtual", "--channel", name, "--out", str(tmp_path / "a.log"), "--frames", "3"]
    arguments += ["--dbc", str(tmp_path / "rig.dbc"), "--csv", str(tmp_path / "a.csv")]
    sending = threading.Thread(target=repeat, args=(sender, [frame(1000), frame(2, arbitration_id=0x7FF), frame(3)]))
    sending.start()
    assert capture.main(arguments) == 0
    sending.join()
    lines = (tmp_path / "a.csv").read_text().splitlines()
    assert lines[0] == "time_s,Shaker.Force,Shaker.Counter"
    assert lines[1] == "1700000001.000000,10.0,232"
    assert len(lines) == 3


def repeat(sender: can.BusABC, messages: list[can.Message]) -> None:
    """Send once the other end has been opened (a virtual bus drops what nobody hears)."""
    from can.interfaces.virtual import channels

    until(lambda: any(len(queues) >= 3 for queues in channels.values()))
    for message in messages:
        sender.send(message)


def test_command_prints_a_summary(
    buses: tuple[str, can.BusABC, can.BusABC], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    name, _, sender = buses
    sending = threading.Thread(target=repeat, args=(sender, [frame(k) for k in range(50)]))
    sending.start()
    out = ["--out", str(tmp_path / "a.log")]
    assert capture.main(["can", "--interface", "virtual", "--channel", name, *out, "--frames", "50"]) == 0
    sending.join()
    assert "50 frames" in capsys.readouterr().out


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_signals_end_a_recording_in_order(tmp_path: Path, number: signal.Signals) -> None:
    program = (
        "import sys, threading, time, can\n"
        "from okid import capture\n"
        "bus = can.Bus(interface='virtual', channel='s')\n"
        "def send():\n"
        "    for _ in range(4000):\n"
        "        bus.send(can.Message(arbitration_id=1, data=[1]))\n"
        "        time.sleep(0.005)\n"
        "threading.Thread(target=send, daemon=True).start()\n"
        "sys.exit(capture.main(['can', '--interface', 'virtual', '--channel', 's', '--out', sys.argv[1]]))\n"
    )
    log = tmp_path / "a.log"
    child = subprocess.Popen([sys.executable, "-c", program, str(log)], stdout=subprocess.PIPE, text=True)
    until(lambda: log.exists() and log.stat().st_size > 0, child)
    child.send_signal(number)
    shown, _ = child.communicate(timeout=1800)
    assert child.returncode == 0
    lines = log.read_text().splitlines()
    assert f"{len(lines)} frames" in shown
    assert all(line.endswith("s 00000001#01") for line in lines)


@pytest.mark.parametrize(
    ("change", "code", "words"),
    [
        ({"--interface": "telepathy"}, 2, "no python-can interface 'telepathy'"),
        ({"--duration": "-1"}, 2, "--duration"),
        ({"--frames": "0"}, 2, "--frames"),
        ({"--dbc": "x.dbc"}, 2, "belong together"),
        ({"--dbc": "/nowhere/x.dbc", "--csv": "x.csv"}, 2, "/nowhere/x.dbc"),
        ({"--interface": "socketcan", "--channel": "nosuchcan9"}, 4, "nosuchcan9"),
        ({"--out": "/nowhere/a.log"}, 2, "/nowhere/a.log"),
    ],
)
def test_refusals(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], change: dict[str, str], code: int, words: str
) -> None:
    given = {"--interface": "virtual", "--channel": "r", "--out": str(tmp_path / "a.log"), **change}
    assert capture.main(["can", *itertools.chain.from_iterable(given.items())]) == code
    message = capsys.readouterr().err
    assert words in message
    assert message.startswith("okid-capture: ")


def test_usage_and_help(capsys: pytest.CaptureFixture[str]) -> None:
    for arguments, code in (([], 2), (["--help"], 0), (["can", "--help"], 0)):
        with pytest.raises(SystemExit) as ended:
            capture.main(arguments)
        assert ended.value.code == code
    assert "example:" in capsys.readouterr().out
