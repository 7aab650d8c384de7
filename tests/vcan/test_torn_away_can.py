# SPDX-License-Identifier: MIT
"""Two CAN buses, one of them without a counter, and a line of text while something is taken away: the processor, the
program's own time, memory, the disk. Whoever is late is late: nothing is missing, nothing is elsewhere, and the journal
gives the same result.

Frames are made and samples are read back here without the helpers of other tests. OKID_SLOW=1: for a minute.
"""

from __future__ import annotations

import contextlib
import csv
import math
import os
import random
import signal
import socket
import struct
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from can_run import OKID, Run, sh
from lines import Line
from sensor import in_memory, sensor
from waiting import until

RATE = 200
SECONDS = 60 if os.environ.get("OKID_SLOW") else 8
SAMPLES = RATE * SECONDS
DISK = Path(OKID).parent / "tests" / "libjournal_disk.so"
CONFIG = """[acquisition]
rate_hz = 200
[[bus]]
name = "can0"
interface = "vcan0"
[[bus]]
name = "can1"
interface = "vcan1"
[[bus]]
name = "line"
type = "serial"
framing = "ascii"
device = "{folder}/tty"
[[channel]]
name = "counted"
role = "force"
bus = "can0"
can_id = 0x100
start_bit = 16
length = 16
signed = true
sequence = {{ start_bit = 0, length = 16 }}
[[channel]]
name = "uncounted"
role = "acceleration"
bus = "can1"
can_id = 0x100
start_bit = 0
length = 16
signed = true
[[channel]]
name = "text"
role = "aux"
bus = "line"
field = 0
[identification]
p = 4
update_s = 0.5
sigma_blocks = 0
[record]
"""


@contextlib.contextmanager
def hogs(count: int, run: Run) -> Iterator[None]:
    busy = [subprocess.Popen([sys.executable, "-c", "while True: pass"]) for _ in range(count)]
    try:
        yield
    finally:
        for each in busy:
            each.kill()
            each.wait()


@contextlib.contextmanager
def every_second(happens: Callable[[], None]) -> Iterator[None]:
    """It happens a second after the last time has ended, until the block ends."""
    ends = threading.Event()

    def again() -> None:
        while not ends.wait(1.0):
            happens()

    thread = threading.Thread(target=again)
    thread.start()
    try:
        yield
    finally:
        ends.set()
        thread.join()


def stopped(_: int, run: Run) -> contextlib.AbstractContextManager[None]:
    def stop() -> None:
        run.process.send_signal(signal.SIGSTOP)
        time.sleep(1.5)
        run.process.send_signal(signal.SIGCONT)

    return every_second(stop)


OWN_KERNEL = "OKID_ROOM=" in Path("/proc/cmdline").read_text()  # tests/kernel/boot: its memory is nobody else's


def free_mb() -> int:
    rows = Path("/proc/meminfo").read_text().splitlines()
    return next(int(row.split()[1]) for row in rows if row.startswith("MemAvailable")) >> 10


@contextlib.contextmanager
def no_memory(_: int, run: Run) -> Iterator[None]:
    """All but 24 MB is taken: what is read of files, the program's own among them, is thrown away and read again."""
    room = run.folder / "room"
    room.mkdir()
    sh("mount", "-t", "tmpfs", "-o", "size=100%", "room", str(room))
    try:
        filler = subprocess.Popen(
            ["dd", "if=/dev/zero", f"of={room}/all", "bs=1M", f"count={free_mb() - 24}"], stderr=subprocess.DEVNULL
        )
        yield
        assert filler.wait(1800) == 0 and free_mb() < 64, f"{free_mb()} MB were left: that is no pressure"
    finally:
        sh("umount", str(room))


def no_disk(_: int, run: Run) -> contextlib.AbstractContextManager[None]:
    def stall() -> None:
        (run.folder / "stall").touch()
        time.sleep(2.0)
        (run.folder / "stall").unlink()

    return every_second(stall)


def numbers() -> tuple[list[int], list[int]]:
    """A force that no two samples share, and the answer of an oscillator to it."""
    draw, motion, forces, answers = random.Random(5), [0.0, 0.0], [], []
    for _ in range(SAMPLES):
        forces.append(draw.randrange(-9000, 9000))
        motion = [1.6 * motion[0] - 0.96 * motion[1] + 0.1 * forces[-1], motion[0]]
        answers.append(round(motion[0]))
    return forces, answers


def send(line: Line, forces: list[int], answers: list[int]) -> float:
    """Every 5 ms a frame on each bus and a line; who is late makes up for it. @return how late at most, s"""
    buses = [socket.socket(socket.AF_CAN, socket.SOCK_RAW, socket.CAN_RAW) for _ in (0, 1)]
    for number, each in enumerate(buses):
        each.bind((f"vcan{number}",))
    begin, late = time.monotonic() + 0.1, 0.0
    for n in range(SAMPLES):
        time.sleep(max(0.0, begin + n / RATE - time.monotonic()))
        buses[0].send(struct.pack("=IB3xHh4x", 0x100, 4, n & 0xFFFF, forces[n]))
        buses[1].send(struct.pack("=IB3xh6x", 0x100, 2, answers[n]))
        line.write(b"%d\n" % n)
        late = max(late, time.monotonic() - begin - n / RATE)
    return late


def columns(path: Path) -> dict[str, list[float]]:
    with open(path, newline="") as file:
        rows = list(csv.DictReader(row for row in file if not row.startswith("#")))
    return {name: [float(row[name] or "nan") for row in rows] for name in ("counted", "uncounted", "text")}


@pytest.mark.parametrize(
    ("taken", "count"),
    [
        pytest.param(hogs, 1, marks=pytest.mark.realtime),
        pytest.param(hogs, 2, marks=pytest.mark.realtime),
        (stopped, 0),
        (no_disk, 0),
        *([pytest.param(no_memory, 0, marks=pytest.mark.realtime)] if OWN_KERNEL else []),
    ],
)
def test_nothing_is_lost_without(
    taken: Callable[[int, Run], contextlib.AbstractContextManager[None]],
    count: int,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    for number in (0, 1):
        sh("ip", "link", "add", f"vcan{number}", "type", "vcan", check=False)
        sh("ip", "link", "set", f"vcan{number}", "up")
    (tmp_path / "a.toml").write_text(CONFIG.format(folder=tmp_path))
    forces, answers = numbers()
    line = Line(tmp_path / "tty")
    with monkeypatch.context() as disk:
        disk.setenv("LD_PRELOAD", str(DISK))
        disk.setenv("OKID_STALL", str(tmp_path / "stall"))
        run = Run(tmp_path)
    until(lambda: list((tmp_path / "runs").glob("*.okj")), run.process)
    with in_memory(), sensor(), taken(count, run):
        late = send(line, forces, answers)
    print(f"the sensor was late by {late:.3f} s")
    until(lambda: not line.unread())
    time.sleep(0.5)
    events = run.stop()
    line.unplug()
    stats = [event for event in events if event["type"] == "stats"][-1]
    for name in ("can0", "can1", "line"):
        bus = stats["bus"][name]
        assert [bus[key] for key in ("too_late", "out_of_order", "duplicate", "decode_errors")] == [0] * 4
        assert bus["received"] == SAMPLES - (name == "line")  # the first line of a text may be half of one
    (journal,) = (tmp_path / "runs").glob("*.okj")
    sh(OKID, "convert", str(journal), str(tmp_path / "a.csv"), "-c", str(tmp_path / "a.toml"))
    sent = {"counted": forces, "uncounted": answers, "text": list(range(SAMPLES))}
    for name, values in columns(tmp_path / "a.csv").items():
        while math.isnan(values[-1]):  # a line whose first half a second was read late ends late, too
            values.pop()
        first = next(first for first in range(SAMPLES) if sent[name][first : first + 9] == values[:9])
        assert values == sent[name][first:][: len(values)], name
        assert len(values) > 0.98 * SAMPLES, name
    sh(OKID, "replay", str(journal), "--json", str(tmp_path / "again.json"), seconds=600)
    assert (tmp_path / "again.json").read_bytes() == (tmp_path / "r.json").read_bytes()
