# SPDX-License-Identifier: MIT
"""okid-capture sync and emulate: deadlines by an injected clock, frames over virtual and multicast buses, packets."""

from __future__ import annotations

import errno
import itertools
import json
import os
import socket
import struct
import subprocess
import threading
from collections.abc import Iterator
from pathlib import Path

import can
import pytest
from captured import COMMAND, assert_same_result, assert_truth, frames
from methods import by_method
from okid import capture
from okid._errors import InputError
from waiting import until

_numbers = itertools.count()
GROUP = "239.74.163.77"


class Clock:
    """Time that passes only while somebody sleeps, `late` s longer than asked for, or by work()."""

    def __init__(self, late: float = 0.0) -> None:
        self.now, self.late = 100.0, late

    def sleep(self, seconds: float) -> None:
        self.now += seconds + self.late

    def pacer(self) -> capture.Pacer:
        return capture.Pacer(lambda: self.now, self.sleep)


class Bus:
    """Keeps what is sent, with the time of the injected clock."""

    def __init__(self, clock: Clock, faults: dict[int, Exception] | None = None, work_s: float = 0.0) -> None:
        self.clock, self.sent, self.faults, self.work_s = clock, [], faults or {}, work_s
        self.calls = itertools.count()

    def send(self, message: can.Message) -> None:
        fault = self.faults.get(next(self.calls))
        if fault is not None:
            raise fault
        self.sent.append((self.clock.now, message))
        self.clock.now += self.work_s


@pytest.fixture
def pair() -> Iterator[tuple[str, can.BusABC]]:
    name = f"okid-nodes-{os.getpid()}-{next(_numbers)}"
    receiver = can.Bus(interface="virtual", channel=name)
    yield name, receiver
    receiver.shutdown()


def test_late_deadlines_do_not_move_those_behind_them() -> None:
    clock = Clock(late=1e-3)
    bus = Bus(clock)
    report = capture.send_sync(bus, 100.0, count=50, pacer=clock.pacer())  # type: ignore[arg-type]
    assert report.sent == 50
    assert [round(t - 100.0, 6) for t, _ in bus.sent] == [0.0] + [round(k / 100 + 1e-3, 6) for k in range(1, 50)]
    assert report.pacer.late_worst_s == pytest.approx(1e-3)
    assert report.pacer.late_mean_s == pytest.approx(49e-3 / 50)
    assert report.pacer.late_sd_s == pytest.approx(1e-3 / 50**0.5)
    assert "50 sent, 0 missed; 50 deadlines, late by 980 us (sd 141, worst 1000)" in report.text()


def test_the_counter_of_a_sync() -> None:
    clock = Clock()
    bus = Bus(clock)
    capture.send_sync(bus, 10.0, count=7, counter=3, pacer=clock.pacer())  # type: ignore[arg-type]
    assert [message.data[0] for _, message in bus.sent] == [1, 2, 3, 1, 2, 3, 1]
    assert {(m.arbitration_id, m.is_extended_id, m.dlc) for _, m in bus.sent} == {(0x80, False, 1)}


def test_missed_deadlines_are_left_out_and_counted() -> None:
    clock = Clock()
    bus = Bus(clock, work_s=0.035)  # sending takes three and a half periods
    report = capture.send_sync(bus, 100.0, count=20, counter=240, pacer=clock.pacer())  # type: ignore[arg-type]
    assert report.sent + report.missed == 20
    assert report.missed > 10
    ticks = [message.data[0] - 1 for _, message in bus.sent]
    assert all(0 <= t - 100.0 - tick / 100 < 0.0101 for (t, _), tick in zip(bus.sent, ticks, strict=True))


def test_a_bus_that_fails_ends_the_sync() -> None:
    clock = Clock()
    bus = Bus(clock, faults={3: can.CanOperationError("Network is down")})
    report = capture.send_sync(bus, 100.0, count=20, pacer=clock.pacer())  # type: ignore[arg-type]
    assert (report.sent, report.fault) == (3, "Network is down")


def test_sync_command(pair: tuple[str, can.BusABC], capsys: pytest.CaptureFixture[str]) -> None:
    name, receiver = pair
    where = ["sync", "--interface", "virtual", "--channel", name, "--rate", "500"]
    assert capture.main([*where, "--id", "0x12345", "--data", "A55A", "--count", "10"]) == 0
    shown = capsys.readouterr().out
    got = [receiver.recv(0) for _ in range(10)]
    assert {(m.arbitration_id, m.is_extended_id, bytes(m.data)) for m in got if m} <= {(0x12345, True, b"\xa5\x5a")}
    sent, missed = (int(part.split()[0]) for part in shown.split(";")[0].split(","))
    assert sent + missed == 10
    assert len([m for m in got if m]) == sent


@pytest.mark.parametrize(
    ("change", "code", "words"),
    [
        ({"--rate": "0"}, 2, "--rate"),
        ({"--rate": "nan"}, 2, "--rate"),
        ({"--id": "0x20000000"}, 2, "identifier"),
        ({"--id": "eighty"}, 2, "--id eighty: expected a number such as 0x80"),
        ({"--data": "0"}, 2, "--data 0: expected up to 8 bytes, two hex digits each"),
        ({"--data": "00" * 9}, 2, "9 bytes"),
        ({"--counter": "1"}, 2, "counter is 1"),
        ({"--count": "0"}, 2, "--count"),
        ({"--interface": "telepathy"}, 2, "telepathy"),
        ({"--interface": "socketcan", "--channel": "nosuchcan9"}, 4, "nosuchcan9"),
    ],
)
def test_sync_refusals(capsys: pytest.CaptureFixture[str], change: dict[str, str], code: int, words: str) -> None:
    given = {"--interface": "virtual", "--channel": "r", "--rate": "100", **change}
    assert capture.main(["sync", *itertools.chain.from_iterable(given.items())]) == code
    assert words in capsys.readouterr().err


def test_a_kernel_without_socketcan_is_told(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def refuse(**_: object) -> None:
        raise OSError(errno.EAFNOSUPPORT, os.strerror(errno.EAFNOSUPPORT))

    monkeypatch.setattr(can, "Bus", refuse)
    assert capture.main(["sync", "--interface", "socketcan", "--channel", "can0", "--rate", "1"]) == 4
    shown = capsys.readouterr().err
    assert "okid doctor" in shown and "udp_multicast" in shown and shown.count("\n") == 1


def test_frames_are_played_at_their_times(rig: Path) -> None:
    sent = frames(rig / "a.log")[:200]
    for speed in (1.0, 4.0):
        clock = Clock(late=2e-4)
        bus = Bus(clock)
        done = capture.play(sent, bus, speed=speed, pacer=clock.pacer())  # type: ignore[arg-type]
        assert (done.sent, done.fault) == (200, None)
        for (t, message), wanted in zip(bus.sent, sent, strict=True):
            assert message is wanted
            late = t - 100.0 - (wanted.timestamp - sent[0].timestamp) / speed
            assert -1e-9 < late < 4.1e-4
        assert done.pacer.late_worst_s < 4.1e-4


def test_a_full_queue_is_waited_for_and_a_dead_bus_is_told(rig: Path) -> None:
    clock = Clock()
    sent = frames(rig / "a.log")[:10]
    full = can.CanOperationError("Transmit buffer full", 105)
    done = capture.play(sent, Bus(clock, {2: full, 3: full}), speed=None, pacer=clock.pacer())  # type: ignore[arg-type]
    assert (done.sent, done.retries, done.fault) == (10, 2, None)
    dead = Bus(clock, {5: can.CanOperationError("Network is down", 100)})
    done = capture.play(sent, dead, speed=None, pacer=clock.pacer())  # type: ignore[arg-type]
    assert done.sent == 5
    assert done.fault is not None and "Network is down" in done.fault
    with pytest.raises(InputError, match="speed is 0"):
        capture.play(sent, dead, speed=0.0)  # type: ignore[arg-type]


def test_emulate_and_capture_on_a_virtual_bus(
    rig: Path, pair: tuple[str, can.BusABC], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    name, receiver = pair
    written = ["--write-config", str(tmp_path / "e.toml"), "--truth", str(tmp_path / "t.json")]
    where = ["--interface", "virtual", "--channel", name, "--speed", "max"]
    assert capture.main(["emulate", str(rig / "rig.toml"), *where, *written]) == 0
    assert "3000 frames in " in capsys.readouterr().out
    got = [message for _ in range(3000) if (message := receiver.recv(0))]
    assert [bytes(m.data) for m in got] == [bytes(m.data) for m in frames(rig / "a.log")]
    assert capture.main(["can", "--log", str(rig / "a.log"), "--config", str(tmp_path / "e.toml"), "--quiet"]) == 0
    assert json.loads((tmp_path / "t.json").read_text()) == json.loads((rig / "t.json").read_text())


def multicast() -> str | None:
    """Why there is no multicast here; None when there is."""
    try:
        import msgpack  # noqa: F401
    except ImportError:
        return "msgpack is not installed (pip install python-can[multicast])"
    try:
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as one:
            member = struct.pack("4s4s", socket.inet_aton(GROUP), socket.inet_aton("0.0.0.0"))
            one.setsockopt(socket.IPPROTO_IP, socket.IP_ADD_MEMBERSHIP, member)
            one.settimeout(1800)
            one.bind(("", 0))
            one.sendto(b"x", (GROUP, one.getsockname()[1]))
            one.recv(1)
    except OSError as fault:
        return f"no multicast on this machine: {fault}"
    return None


def test_two_processes_over_multicast(rig: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    reason = multicast()
    if reason is not None:
        pytest.skip(reason)
    where = ["--interface", "udp_multicast", "--channel", GROUP]
    outputs = [
        "--config",
        rig / "a.toml",
        "--out",
        tmp_path / "r.log",
        "--json",
        tmp_path / "r.json",
        "--frames",
        "3000",
    ]
    said: list[str] = []

    def emulate() -> None:
        until((tmp_path / "r.log").exists)
        node = [*COMMAND, "emulate", str(rig / "rig.toml"), *where, "--speed", "4"]
        done = subprocess.run(node, capture_output=True, text=True, timeout=1800, check=False)
        said.append(done.stdout + done.stderr)

    thread = threading.Thread(target=emulate, daemon=True)
    thread.start()
    assert capture.main(["can", *where, *map(str, outputs)]) == 0
    thread.join()
    assert "3000 frames in " in said[0]
    assert "late by" in said[0]
    assert "can0: 3000 received, 0 lost" in capsys.readouterr().out
    assert_same_result(json.loads((tmp_path / "r.json").read_text()), json.loads((rig / "replay.json").read_text()))


def test_emulate_on_a_line(rig: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    kept = bytearray()
    with socket.create_server(("127.0.0.1", 0)) as server:

        def serve() -> None:
            peer, _ = server.accept()
            with peer:
                while data := peer.recv(4096):
                    kept.extend(data)

        thread = threading.Thread(target=serve, daemon=True)
        thread.start()
        url = f"socket://127.0.0.1:{server.getsockname()[1]}"
        written = ["--write-config", str(tmp_path / "line.toml")]
        assert capture.main(["emulate", str(rig / "rig.toml"), "--serial", url, "--speed", "max", *written]) == 0
        thread.join()
    assert "packets in " in capsys.readouterr().out
    (tmp_path / "run.bin").write_bytes(kept)
    (tmp_path / "line.toml").write_text(by_method((tmp_path / "line.toml").read_text(), p=12, rows=24))
    arguments = ["serial", "--from", tmp_path / "run.bin", "--config", tmp_path / "line.toml", "--json", tmp_path / "r"]
    assert capture.main([*map(str, arguments)]) == 0
    result = json.loads((tmp_path / "r").read_text())
    assert_same_result(result, json.loads((rig / "replay.json").read_text()))
    assert_truth(result, rig / "t.json")


@pytest.mark.parametrize(
    ("arguments", "code", "words"),
    [
        (["{rig}/rig.toml"], 2, "give either --interface and --channel, or --serial URL"),
        (["{rig}/rig.toml", "--interface", "virtual"], 2, "give either"),
        (["{rig}/rig.toml", "--interface", "virtual", "--channel", "x", "--serial", "loop://"], 2, "give either"),
        (["{rig}/rig.toml", "--interface", "virtual", "--channel", "x", "--speed", "fast"], 2, "--speed is 'fast'"),
        (
            ["{rig}/rig.toml", "--interface", "virtual", "--channel", "x", "--config", "c.toml"],
            2,
            "--config is for a LOG",
        ),
        (["{rig}/a.log", "--interface", "virtual", "--channel", "x", "--truth", "t.json"], 2, "--truth"),
        (["{rig}/a.log", "--serial", "loop://"], 2, "--serial needs --config"),
        (["{rig}/a.log", "--interface", "socketcan", "--channel", "nosuchcan9"], 4, "nosuchcan9"),
        (["{rig}/a.log", "--serial", "/nowhere/tty", "--config", "{rig}/a.toml"], 4, "/nowhere/tty"),
        (["{rig}/a.toml", "--interface", "virtual", "--channel", "x"], 2, "a.toml"),
        (["/nowhere/a.log", "--interface", "virtual", "--channel", "x"], 2, "/nowhere/a.log"),
    ],
)
def test_emulate_refusals(
    rig: Path, capsys: pytest.CaptureFixture[str], arguments: list[str], code: int, words: str
) -> None:
    assert capture.main(["emulate", *[argument.replace("{rig}", str(rig)) for argument in arguments]]) == code
    shown = capsys.readouterr().err
    assert words in shown
    assert shown.startswith("okid-capture: ")
