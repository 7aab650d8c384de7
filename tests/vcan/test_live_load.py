# SPDX-License-Identifier: MIT
"""Everything at once: two buses of 8,000 frames/s and a serial line, recorded, while W2 is identified every 0.5 s.
And the whole program stopped for two seconds in the midst of it.

OKID_SLOW=1: for a minute.
"""

from __future__ import annotations

import json
import os
import shutil
import signal
import socket
import struct
import subprocess
import tempfile
import threading
import time
from pathlib import Path

import journal
import numpy as np
import pytest
from lines import Line, packet
from live_feed import UPDATE_S, latencies_ms, summary, watching
from numpy.typing import NDArray
from systems import w2_codes, w2_frequencies
from test_vcan import OKID, Run, interface, sh  # noqa: F401  (interface is a fixture)
from waiting import until

FLOOD = Path(OKID).parent / "tests" / "vcan_flood"
RATE, FRAMES, IN_PACKET = 1000, 8, 10
SO_RCVBUFFORCE = 33
SECONDS = 60 if os.environ.get("OKID_SLOW") else 6
NAMES = ["f1", "f2", "a1", "a2", "a3", "a4", "a5", "a6"]  # three a frame, the first three of bus 0 in its frame 0, …
PLACES = [(0, 0, 0), (0, 0, 1), (0, 0, 2), (0, 1, 0), (0, 1, 1), (1, 0, 0), (1, 0, 1), (1, 0, 2)]


def config(folder: Path, disk: Path, *, rate_hz: int = RATE, with_line: bool = True) -> str:
    text = f"[acquisition]\nrate_hz = {rate_hz}\n"
    for bus in (0, 1):
        text += f'[[bus]]\nname = "can{bus}"\ntype = "socketcan"\ninterface = "vcan{bus}"\n'
    if with_line:
        text += f'[[bus]]\nname = "line"\ntype = "serial"\nframing = "cobs"\ndevice = "{folder}/tty"\n'
    named = dict(zip(PLACES, NAMES, strict=True))
    for bus in (0, 1):
        for frame in range(FRAMES):
            for part in range(3):
                name = named.get((bus, frame, part), f"x{bus}{frame}{part}")
                role = {"f": "force", "a": "acceleration", "x": "aux"}[name[0]]
                text += f'[[channel]]\nname = "{name}"\nrole = "{role}"\nbus = "can{bus}"\n'
                text += f"can_id = {0x100 + frame}\nstart_bit = {16 + 16 * part}\nlength = 16\nsigned = true\n"
                text += "sequence = { start_bit = 0, length = 16 }\n"
    if with_line:
        text += '[[channel]]\nname = "temperature"\nrole = "aux"\nbus = "line"\nfield = 0\n'
    text += f"[identification]\np = 40\nupdate_s = {UPDATE_S}\nwindow_s = 4.0\n"
    text += f'[record]\ndirectory = "{disk}"\n'
    return text + '[publish]\nsocket = "live.sock"\n'


def can_frames(codes: NDArray[np.int16], bus: int) -> bytes:
    """struct can_frame: FRAMES of a sample, then those of the next one."""
    kind = np.dtype([("id", "<u4"), ("len", "u1"), ("pad", "u1", 3), ("number", "<u2"), ("values", "<i2", 3)])
    out = np.zeros((len(codes), FRAMES), kind)
    out["id"] = 0x100 + np.arange(FRAMES)
    out["len"] = 8
    out["number"] = np.arange(len(codes))[:, None] & 0xFFFF
    out["values"] = np.arange(len(codes))[:, None, None] % 1000
    for column, (its, frame, part) in enumerate(PLACES):
        if its == bus:
            out["values"][:, frame, part] = codes[:, column]
    return out.tobytes()


def feed(line: Line, samples: int) -> None:
    """The line keeps step with the first bus: this machine may be too slow for real time."""
    with socket.socket(socket.AF_CAN, socket.SOCK_RAW, socket.CAN_RAW) as bus:
        bus.setsockopt(socket.SOL_CAN_RAW, socket.CAN_RAW_FILTER, struct.pack("=II", 0x100, 0x7FF))
        bus.setsockopt(socket.SOL_SOCKET, SO_RCVBUFFORCE, 1 << 24)
        bus.bind(("vcan0",))
        bus.settimeout(1800)
        done = 0
        while done < samples:
            seen = int.from_bytes(bus.recv(16)[8:10], "little")
            while done <= seen:
                line.write(packet(done, [[k % 100] for k in range(done, done + IN_PACKET)]))
                done += IN_PACKET


def completion(disk: Path, samples: int) -> NDArray[np.float64]:
    """When each sample of the two buses was complete, by the journals; every frame of them must be there, once."""
    number, last = np.zeros((2, FRAMES), int), np.zeros(samples)
    lines = 0
    for path in sorted(disk.glob("*.okj")):
        for frame in (frame for chunk in journal.read(path)[0] for frame in chunk.frames()):
            if frame.bus == 2:
                lines += 1
                continue
            which = (frame.bus, frame.id - 0x100)
            assert int.from_bytes(frame.data[:2], "little") == number[which] & 0xFFFF
            last[number[which]] = max(last[number[which]], frame.time_ns * 1e-9)
            number[which] += 1
    assert (number == samples).all() and lines == samples
    return last


def nothing_lost(stats: dict, buses: tuple[str, ...]) -> None:
    for name in buses:
        counts = stats["bus"][name]
        assert [counts[key] for key in ("lost", "out_of_order", "too_late", "duplicate", "decode_errors")] == [0] * 5


def test_the_program_is_stopped(tmp_path: Path) -> None:
    """SIGSTOP for two seconds: the kernel keeps the frames, each comes to its place. The journal gives the same."""
    rate, samples = RATE // 2, SECONDS * RATE // 2
    sh("ip", "link", "add", "vcan1", "type", "vcan", check=False)
    sh("ip", "link", "set", "vcan1", "up")
    disk = Path(tempfile.mkdtemp(dir="/dev/shm"))
    (tmp_path / "a.toml").write_text(config(tmp_path, disk, rate_hz=rate, with_line=False))
    for bus in (0, 1):
        (tmp_path / f"{bus}.bin").write_bytes(can_frames(w2_codes(samples), bus))
    live = Run(tmp_path)
    until(lambda: list(disk.glob("*.okj")), live.process)
    files = f"{tmp_path}/0.bin,{tmp_path}/1.bin"
    sender = subprocess.Popen([str(FLOOD), "vcan0,vcan1", str(samples * FRAMES), str(rate * FRAMES), files])
    time.sleep(1.5)
    live.process.send_signal(signal.SIGSTOP)
    time.sleep(2.0)
    live.process.send_signal(signal.SIGCONT)
    assert sender.wait(1800) == 0
    time.sleep(1.0)
    events = live.stop()
    last = [event for event in events if event["type"] == "stats"][-1]
    nothing_lost(last, ("can0", "can1"))
    assert last["bus"]["can0"]["received"] == last["bus"]["can1"]["received"] == samples * FRAMES
    assert {channel["received"] for channel in last["channel"].values()} == {samples}
    assert not [event for event in events if event["type"] == "gap"]
    (first,) = disk.glob("*-0001.okj")
    sh(OKID, "replay", str(first), "--json", str(tmp_path / "again.json"), seconds=600)
    assert (tmp_path / "again.json").read_bytes() == (tmp_path / "r.json").read_bytes()
    shutil.rmtree(disk)


@pytest.mark.realtime
def test_two_buses_and_a_line(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    samples = SECONDS * RATE
    codes = w2_codes(samples)
    sh("ip", "link", "add", "vcan1", "type", "vcan", check=False)
    sh("ip", "link", "set", "vcan1", "up")
    disk = Path(tempfile.mkdtemp(dir="/dev/shm"))  # where a write takes as long here as elsewhere
    (tmp_path / "a.toml").write_text(config(tmp_path, disk))
    for bus in (0, 1):
        (tmp_path / f"{bus}.bin").write_bytes(can_frames(codes, bus))
    files = f"{tmp_path}/0.bin,{tmp_path}/1.bin"
    part = samples * FRAMES // 4
    alone = json.loads(sh(str(FLOOD), "vcan0,vcan1", str(part), str(RATE * FRAMES), files, seconds=600).stdout)[
        "seconds"
    ]
    line = Line(tmp_path / "tty")
    live = Run(tmp_path)
    with watching(tmp_path / "live.sock") as watch:
        until(lambda: list(disk.glob("*.okj")), live.process)  # then every bus is open
        feeder = threading.Thread(target=feed, args=(line, samples))
        feeder.start()
        sent = sh(str(FLOOD), "vcan0,vcan1", str(samples * FRAMES), str(RATE * FRAMES), files, seconds=600)
        took = json.loads(sent.stdout)["seconds"]
        feeder.join()
        time.sleep(1.0)
        events = live.stop()
    line.unplug()
    last = [event for event in events if event["type"] == "stats"][-1]
    waits = latencies_ms(watch.came, completion(disk, samples), RATE)
    with capfd.disabled():
        rate = samples * FRAMES / took
        print(f"\n2 x {rate:.0f} frames/s and a line for {took:.1f} s; frame in to modes out: {summary(waits)}")
    assert rate > 0.5 * part / alone, "half of what the sender sends when nobody listens"
    nothing_lost(last, ("can0", "can1", "line"))
    assert last["bus"]["can0"]["received"] == last["bus"]["can1"]["received"] == samples * FRAMES
    assert {channel["received"] for channel in last["channel"].values()} == {samples}
    assert not [event for event in events if event["type"] == "gap"]
    found = [mode["frequency_hz"] for mode in events[-1]["result"]["modes"]]
    for frequency in w2_frequencies(RATE):
        assert min(abs(f / frequency - 1) for f in found) < 0.005
    updates = last["updates"]
    assert len(waits) >= 1 and updates["made"] + updates["skipped"] >= (SECONDS - 2) / UPDATE_S
    (first,) = disk.glob("*-0001.okj")
    begin = time.monotonic()
    sh(OKID, "replay", str(first), "--json", str(tmp_path / "again.json"), seconds=600)
    an_update_ms = 1e3 * (time.monotonic() - begin) / (updates["made"] + updates["skipped"])
    # Two buses at full speed leave no processor for mathematics: it catches up behind them.
    assert np.percentile(waits, 99) < 1e3 * took + 15 * an_update_ms, an_update_ms
    assert (tmp_path / "again.json").read_bytes() == (tmp_path / "r.json").read_bytes()
    shutil.rmtree(disk)
