# SPDX-License-Identifier: MIT
"""Events of real runs, every type that needs no CAN hardware: replays of simulated rigs, and a live run on a serial
line (a pseudo terminal) that is unplugged, plugged in again, recorded and looked at through the socket."""

from __future__ import annotations

import contextlib
import json
import os
import pathlib
import signal
import socket
import struct
import subprocess
import threading
import tty
import zlib
from collections.abc import Iterator
from typing import Any

from cobs import cobs
from command_help import OKID
from methods import by_method
from okid.capture.stream import Capture
from waiting import until

Event = dict[str, Any]
CHAIN = "masses = [1.0, 0.8, 1.2]\nsprings = [3e4, 2e4, 2.5e4]\nsense_dofs = [1, 2, 3]\n"
FRAME = f"""rate_hz = 250.0
duration_s = 60.0
zeta = [0.01, 0.01]
force_dofs = [1]
noise_percent = 1.0
{CHAIN}
[[change]]
at_s = 30.0
springs = [2.7e4, 2e4, 2.5e4]
[[change]]
at_s = 45.0
springs = [3e4, 2e4, 2.5e4]
"""
STRUCK = f"""rate_hz = 1000.0
duration_s = 8.0
zeta = [0.02, 0.02]
force_dofs = [2]
excitation = "hammer"
force_rms = 20.0
hold = "foh"
{CHAIN}"""
NODE = """[acquisition]
rate_hz = 100.0
notes = "a node on a line"
[[bus]]
name = "node"
type = "serial"
framing = "cobs"
device = "line"
[[channel]]
name = "force"
role = "force"
field = 0
[[channel]]
name = "acc"
role = "acceleration"
field = 1
[identification]
p = 4
[record]
directory = "runs"
[publish]
socket = "okid.sock"
samples = true
"""


def okid(folder: pathlib.Path, *arguments: str) -> None:
    """The program in `folder`; its exit code must be 0 or 3 (a replay that was ended before a model was there)."""
    done = subprocess.run([OKID, *arguments], cwd=folder, capture_output=True, text=True, timeout=1800)
    assert done.returncode in (0, 3), f"okid {' '.join(arguments)}: {done.returncode}\n{done.stderr}"


def events_of(path: pathlib.Path) -> list[Event]:
    return [json.loads(line) for line in path.read_text().splitlines()]


def changing_frame(folder: pathlib.Path) -> list[Event]:
    """A frame that loses stiffness and gets it back: frames lost, a change, an alarm that ends, a result."""
    (folder / "rig.toml").write_text(FRAME)
    okid(folder, "simulate", "rig.toml", "--log", "rig.log", "--config", "frame.toml", "--quiet")
    quick = by_method((folder / "frame.toml").read_text(), p=12, rows=24)
    (folder / "frame.toml").write_text(quick)
    log = (folder / "rig.log").read_text().splitlines(keepends=True)
    (folder / "lossy.log").write_text("".join(log[:500] + log[520:]))
    config = (folder / "frame.toml").read_text()
    for old, new in (("update_s = 1.0", "update_s = 0.5\nwindow_s = 6.0"), ("[[bus]]", 'operator = "me"\n\n[[bus]]')):
        assert old in config
        config = config.replace(old, new, 1)
    (folder / "lossy.toml").write_text(config + "\n[alarm]\nbaseline_updates = 5\ntest_s = 14.0\n")
    okid(folder, "replay", "lossy.log", "-c", "lossy.toml", "--events", "lossy.jsonl")
    return events_of(folder / "lossy.jsonl")


def triggered_frame(folder: pathlib.Path) -> list[Event]:
    """The same frame, begun by a force that crosses a level."""
    trigger = '\n[trigger]\nsource = "level"\nlevel = 2.5\npretrigger_s = 0.1\n'
    (folder / "trigger.toml").write_text((folder / "frame.toml").read_text() + trigger)
    arguments = ("-c", "trigger.toml", "--duration", "10", "--events", "trigger.jsonl")
    okid(folder, "replay", "rig.log", *arguments)
    return events_of(folder / "trigger.jsonl")


def two_clocks(folder: pathlib.Path) -> list[Event]:
    """The same frame with its sensors on another bus, whose node has a clock of its own."""
    config = (folder / "frame.toml").read_text().split("\n\n")
    second = '[[bus]]\nname = "can1"\ninterface = "vcan1"\nclock = "free"\ndbc = "frame.dbc"'
    sections = [part.replace('"can0"', '"can1"') if 'role = "acceleration"' in part else part for part in config]
    (folder / "clocks.toml").write_text("\n\n".join([sections[0], second, *sections[1:]]))
    log = (folder / "rig.log").read_text().splitlines(keepends=True)
    moved = [line.replace("vcan0", "vcan1") if k % 2 else line for k, line in enumerate(log)]
    (folder / "clocks.log").write_text("".join(moved))
    arguments = ("-c", "clocks.toml", "--duration", "12", "--events", "clocks.jsonl")
    okid(folder, "replay", "clocks.log", *arguments)
    return events_of(folder / "clocks.jsonl")


def struck_frame(folder: pathlib.Path) -> list[Event]:
    """Blows of a hammer: good ones, and with another config bad ones."""
    (folder / "struck.toml").write_text(STRUCK)
    okid(folder, "simulate", "struck.toml", "--log", "hits.log", "--config", "hits.toml", "--quiet")
    out: list[Event] = []
    for more in ("", "spectrum_hz = 200.0\n"):
        text = (folder / "hits.toml").read_text() + f"\n[hammer]\nlevel = 100.0\nhits = 2\nlength_s = 1.0\n{more}"
        (folder / "hammer.toml").write_text(text)
        okid(folder, "replay", "hits.log", "-c", "hammer.toml", "--events", "hits.jsonl")
        out += events_of(folder / "hits.jsonl")
    return out


class Line:
    """Our end of a line whose other end keeps its name while it is unplugged and plugged in again."""

    def __init__(self, path: pathlib.Path) -> None:
        self.path = path
        self.plug_in()

    def plug_in(self) -> None:
        self.fd, self.far = os.openpty()
        tty.setraw(self.far)
        self.path.symlink_to(os.ttyname(self.far))

    def unplug(self) -> None:
        self.path.unlink()
        os.close(self.far)
        os.close(self.fd)

    def send(self, first: int, count: int) -> None:
        """So many samples of two int16 channels, ten to a packet (docs/wire-protocol.md)."""
        for n in range(first, first + count, 10):
            codes = [struct.pack("<hh", 1000 * (7 * k % 11) - 5000, 900 * (7 * k % 13)) for k in range(n, n + 10)]
            plain = struct.pack("<BBBBII", 1, 0, 2, 10, n, 0) + b"".join(codes)
            packet = cobs.encode(plain + struct.pack("<I", zlib.crc32(plain))) + b"\0"
            while packet:
                packet = packet[os.write(self.fd, packet) :]


@contextlib.contextmanager
def listening(path: pathlib.Path) -> Iterator[list[Event]]:
    """What a subscriber of the socket gets, in a list that is complete once the other end has closed."""
    one = socket.socket(socket.AF_UNIX)
    one.settimeout(1800)
    until(path.exists)
    one.connect(str(path))
    out: list[Event] = []

    def read() -> None:
        with one, one.makefile() as lines:
            out.extend(json.loads(line) for line in lines)

    thread = threading.Thread(target=read, daemon=True)
    thread.start()
    yield out
    thread.join(1800)


@contextlib.contextmanager
def running(folder: pathlib.Path, config: str, events: str) -> Iterator[subprocess.Popen[str]]:
    """`okid run` in the background; ended whatever happens."""
    arguments = [OKID, "run", config, "--events", events]
    one = subprocess.Popen(arguments, cwd=folder, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)
    try:
        yield one
    finally:
        one.kill()
        one.wait()


def node_on_a_line(folder: pathlib.Path) -> list[Event]:
    """`okid run` on a line that goes away and comes back; recorded, and followed through the socket."""
    (folder / "node.toml").write_text(NODE)
    line = Line(folder / "line")
    events = folder / "node.jsonl"

    def told(text: str) -> bool:
        return events.exists() and text in events.read_text()

    with running(folder, "node.toml", "node.jsonl") as run:
        with listening(folder / "okid.sock") as heard:
            line.send(0, 500)
            until(lambda: told('"stats"'))  # after sample 500: nothing is on the way any more
            line.unplug()
            line.plug_in()
            line.send(700, 600)
            until(lambda: told('"cause":"link_down"'))
            run.send_signal(signal.SIGINT)
            _, said = run.communicate(timeout=1800)
        assert run.returncode in (0, 3), said  # white noise has no modes
    line.unplug()
    return events_of(events) + [event for event in heard if event["type"] == "samples"]


def in_a_hurry(folder: pathlib.Path) -> list[Event]:
    """The changing frame as a live session gets it that is fed without waiting: updates are left out."""
    with Capture(folder / "lossy.toml", live=True) as live:
        live.open(folder / "lossy.log")
        while live.play(10000) == 10000:
            live.serve()
        live.finish()
        return live.events()


def all_runs(folder: pathlib.Path) -> list[Event]:
    """Events of all the runs above."""
    runs = (changing_frame, triggered_frame, two_clocks, struck_frame, in_a_hurry, node_on_a_line)
    return [event for run in runs for event in run(folder)]
