# SPDX-License-Identifier: MIT
"""The SocketCAN front end under load, links that come and go, frames that okid sends.

OKID_SLOW=1 runs the long rows: 60 s at each rate, the same for candump and python-can, whose losses are printed and not
judged; 200 reconnections.
"""

from __future__ import annotations

import json
import os
import re
import signal
import socket
import struct
import subprocess
import sys
import time
from pathlib import Path

import pytest
from test_vcan import OKID, Run, interface, make_record, play, sh  # noqa: F401  (interface is a fixture)
from waiting import until

TOOLS = Path(OKID).parent / "tests"
SLOW = bool(os.environ.get("OKID_SLOW"))
SECONDS = 60 if SLOW else 3
PYTHON_CAN = """
import sys, can
bus = can.Bus(interface="socketcan", channel="vcan0", fd=True)
print("listening", flush=True)
got, wait = 0, 20.0
while (message := bus.recv(wait)) is not None:
    got, wait = got + 1, 3.0
    if got == int(sys.argv[1]): break
bus.shutdown()
print(got)
"""


class Receiver:
    """One program that counts frames; ready when it listens, ends by itself or at a signal."""

    def __init__(self, kind: str, count: int, folder: Path, quiet_s: float = 5) -> None:
        self.kind = kind
        self.log = folder / f"{kind}.out"
        command = {
            "okid": [str(TOOLS / "vcan_front_end"), "vcan0", str(count), str(quiet_s)],
            "candump": ["candump", "-L", "vcan0"],
            "python-can": [sys.executable, "-c", PYTHON_CAN, str(count)],
        }[kind]
        self.process = subprocess.Popen(command, stdout=self.log.open("w"), stderr=subprocess.STDOUT)
        until(lambda: Run.listening() if kind == "candump" else "listening" in self.log.read_text(), self.process)

    def received(self) -> int:
        if self.kind == "candump":
            size = -1
            while size != self.log.stat().st_size:  # until nothing more comes
                size = self.log.stat().st_size
                time.sleep(1.0)
            self.process.send_signal(signal.SIGINT)
        assert self.process.wait(1800) in (0, -2, 130)
        lines = self.log.read_text().splitlines()
        if self.kind == "candump":
            return sum(" 123#" in line for line in lines)
        return json.loads(lines[-1])["received"] if self.kind == "okid" else int(lines[-1])


LOADS = [
    ("classic", 20000, 20000 * SECONDS),
    ("fd", 8000, 8000 * SECONDS),
    ("classic", 0, 100000),
]


@pytest.mark.realtime
@pytest.mark.parametrize(("kind", "rate", "count"), LOADS)
def test_load(kind: str, rate: int, count: int, tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    row = {}
    part = max(count // 4, 1000)
    alone = json.loads(sh(str(TOOLS / "vcan_flood"), "vcan0", str(part), str(rate), kind, seconds=120).stdout)
    for program in ("okid", *(("candump", "python-can") if SLOW else ())):
        receiver = Receiver(program, count, tmp_path)
        if not rate:  # nobody reads until all is sent: what the receive buffer holds
            receiver.process.send_signal(signal.SIGSTOP)
        sent = sh(str(TOOLS / "vcan_flood"), "vcan0", str(count), str(rate), kind, seconds=SECONDS * 10 + 60)
        receiver.process.send_signal(signal.SIGCONT)
        row[program] = receiver.received()
        flood = json.loads(sent.stdout)
    okid = json.loads((tmp_path / "okid.out").read_text().splitlines()[-1])
    with capfd.disabled():
        paced = f"{rate}/s" if rate else "flat out, nobody reading"
        lost = ", ".join(f"{program} {count - got}" for program, got in row.items())
        of_alone = count / flood["seconds"] * alone["seconds"] / part
        print(
            f"\n{kind} {paced}, {count} frames in {flood['seconds']} s: lost {lost}; {of_alone:.2f} of the rate alone"
        )
    assert of_alone > 0.5 or not rate  # flat out: what a full buffer costs the sender
    assert okid == {
        "received": count,
        "missing": 0,
        "reordered": 0,
        "socket_overflow": 0,
        "ring": 0,
        "link_down": 0,
        "reopened": 0,
    }


def number_frame(number: int) -> bytes:
    return struct.pack("=IB3xI4x", 0x123, 8, number)


def wait_for_line(path: Path, text: str, count: int) -> str:
    def found() -> list[str]:
        return [line for line in path.read_text().splitlines() if line.startswith(text)]

    until(lambda: len(found()) >= count)
    return found()[count - 1]


def test_samples_again_after_the_link_is_back(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    """Down and up, and deleted and made anew: the first frame after it within 500 ms."""
    rounds, waits = 200 if SLOW else 10, []
    receiver = Receiver("okid", 1 << 40, tmp_path, quiet_s=60)  # deleting an interface can take the kernel seconds
    for turn in range(rounds):
        if turn % 2:
            sh("ip", "link", "delete", "vcan0")
            sh("ip", "link", "add", "vcan0", "type", "vcan")
        else:
            sh("ip", "link", "set", "vcan0", "down")
        sh("ip", "link", "set", "vcan0", "up")
        up = time.clock_gettime_ns(time.CLOCK_MONOTONIC)
        with socket.socket(socket.AF_CAN, socket.SOCK_RAW, socket.CAN_RAW) as sender:
            sender.bind(("vcan0",))
            for number in range(2000):
                sender.send(number_frame(number))
                if receiver.log.read_text().count("back ") > turn:
                    break
                time.sleep(0.005)
        back = int(wait_for_line(receiver.log, "back ", turn + 1).split()[1])
        waits.append((back - up) / 1e6)
    with capfd.disabled():
        median = sorted(waits)[rounds // 2]
        print(f"\n{rounds} links back: samples again after {max(waits):.0f} ms at most, {median:.0f} ms median")
    assert max(waits) <= 500
    assert receiver.process.poll() is None
    receiver.process.kill()
    receiver.process.wait()


@pytest.fixture(scope="module")
def record(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return make_record(tmp_path_factory.mktemp("sends"), 6.0)


@pytest.mark.parametrize(("key", "identifier"), [("", "080"), ("sync_id = 66051\n", "00010203")])
def test_start_frame_and_sync(
    record: Path, tmp_path: Path, capfd: pytest.CaptureFixture[str], key: str, identifier: str
) -> None:
    text = (record / "a.toml").read_text()
    keys, frame = key + 'sync_hz = 50.0\nsync_data = "07"\nstart = ["000#0100"]\n', f"{identifier}#07"
    (record / "s.toml").write_text(re.sub(r'(interface = "vcan0"\n)', r"\1" + keys, text))
    seen = tmp_path / "seen.log"
    with seen.open("w") as out:
        # Its own buffer holds 333 frames: what it drops would look as if it had not been sent.
        watch = subprocess.Popen(["candump", "-L", "-r", "4000000", "vcan0"], stdout=out)
        time.sleep(0.5)
        live = Run(record, config="s.toml")
        until(lambda: frame in seen.read_text())  # candump listens already: only the first SYNC says that okid does
        play(record / "a.log")
        events = live.stop()
        sync = [e for e in events if e["type"] == "stats"][-1]["bus"]["can0"]["sync"]
        until(lambda: seen.read_text().count(frame) >= sync["sent"])  # what candump has not read is lost when it ends
        watch.send_signal(signal.SIGINT)
        watch.wait()
    lines = [line.split() for line in seen.read_text().splitlines()]
    assert lines[0][2] == "000#0100"
    stamps = [float(line[0].strip("()")) for line in lines if line[2] == frame]
    with capfd.disabled():
        print(f"\nSYNC: {sync}")
    assert sync["sent"] == len(stamps) > 250
    whole = (stamps[-1] - stamps[0]) * 50  # periods: no drift, and what was left out was counted
    assert abs(whole - (sync["sent"] + sync["missed"] - 1)) < 2
    assert "SYNC frames sent" in live.messages()


def test_bus_off_is_an_event(record: Path) -> None:
    live = Run(record)
    play(record / "a.log", "-t")
    time.sleep(0.3)
    sh("cansend", "vcan0", "20000040#0000000000000000")
    sh("cansend", "vcan0", "20000100#0000000000000000")
    time.sleep(0.5)
    events = live.stop()
    told = [(e["event"], e["bus"]) for e in events if e["type"] == "bus"]
    assert told == [("bus_off", "can0"), ("restarted", "can0")] or told == [
        ("bus_off", "can0"),
        ("bus_off", "can0"),
        ("restarted", "can0"),
    ]
    counts = [e for e in events if e["type"] == "stats"][-1]["bus"]["can0"]["errors"]
    assert (counts["bus_off"], counts["restarted"], counts["messages"]) == (1, 1, 2)
    assert "bus-off" in live.messages() and "restarted after bus-off" in live.messages()


def test_replay_keeps_its_deadlines(record: Path, capfd: pytest.CaptureFixture[str]) -> None:
    begin = time.monotonic()
    done = sh(OKID, "replay", str(record / "a.log"), "--to", "vcan0", "--speed", "2")
    with capfd.disabled():
        print("\n" + done.stdout.strip())
    assert re.search(r"6000 frames played onto vcan0; late by \d+ us \(mean\)", done.stdout)
    assert time.monotonic() - begin >= 2.9  # 6 s of stream at twice their speed
