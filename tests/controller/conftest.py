# SPDX-License-Identifier: MIT
"""Two controllers on one bus. Each stands for a computer: can0 is ours, can1 is in the network namespace `sender`."""

from __future__ import annotations

import json
import os
import re
import signal
import subprocess
import time
from pathlib import Path

import pytest
from can_run import OKID, Run, sh

TOOLS = Path(OKID).parent / "tests"
THERE = ("ip", "netns", "exec", "sender")


def bring_up(bitrate: int = 1_000_000, *options: str) -> None:
    """Both controllers at this rate, whatever they were before, their interrupts on the first processor."""
    batch("netns add sender", "link set can1 netns sender", force=True)
    settings = " ".join(["type can bitrate", str(bitrate), "restart-ms 100", *options])
    for where, name in (((), "can0"), (("-n", "sender"), "can1")):
        batch(f"link set {name} down", f"link set {name} up txqueuelen 1000 {settings}", where=where)
    interrupts("can0", 0)
    interrupts("can1", 0)


def interrupts(name: str, processor: int) -> None:
    (line,) = [each for each in Path("/proc/interrupts").read_text().splitlines() if re.search(rf"\b{name}\b", each)]
    Path(f"/proc/irq/{line.split(':')[0].strip()}/smp_affinity").write_text(str(1 << processor))


def batch(*commands: str, where: tuple[str, ...] = (), force: bool = False) -> None:
    """Commands of ip in one process."""
    words = ["ip", *where, *(["-force"] if force else []), "-batch", "-"]
    text = "\n".join(commands) + "\n"
    done = subprocess.run(words, input=text, capture_output=True, text=True, timeout=60, check=False)
    assert force or done.returncode == 0, f"{commands}: {done.stderr}"


def load(present: bool) -> None:
    """The driver of both controllers into the kernel, or out of it."""
    stock = os.environ["OKID_STOCK"]
    sh("modprobe", "-d", stock, *([] if present else ["-r"]), "kvaser_pci")


def link(name: str = "can0") -> dict:
    return json.loads(sh("ip", "-json", "-statistics", "-details", "link", "show", name).stdout)[0]


def flood(frames: Path, rate: int, processor: int) -> None:
    """Frames of a file (struct can_frame) by the other computer, in batches of 64."""
    words = (str(TOOLS / "vcan_flood"), "can1", str(frames.stat().st_size // 16), str(rate), str(frames))
    sh(*THERE, "taskset", "-c", str(processor), *words)


def play(log: Path, *options: str) -> str:
    """Frames of a log by the other computer. The processor that sends takes the interrupts too: the sender waits while
    the receiver's driver empties its controller, as the bits of a real bus make it wait, and nothing overruns."""
    return sh(*THERE, "taskset", "-c", "0", OKID, "replay", str(log), "--to", "can1", *options).stdout


class Witness:
    """candump beside okid, with a buffer that holds whole runs: what came past the controller."""

    def __init__(self, folder: Path, interface: str = "can0") -> None:
        self.log, self.interface = folder / "witness.log", interface
        before = self.listeners()
        with self.log.open("w") as out:
            self.process = subprocess.Popen(
                ["candump", "-L", "-r", "100000000", f"{interface},0:0,#FFFFFFFF"], stdout=out
            )
        for _ in range(400):
            if self.listeners() > before:
                return
            assert self.process.poll() is None
            time.sleep(0.02)
        raise AssertionError("candump never listened")

    def listeners(self) -> int:
        return Path("/proc/net/can/rcvlist_all").read_text().count(f" {self.interface} ")

    def lines(self) -> list[str]:
        size = -1
        while size != self.log.stat().st_size:
            size = self.log.stat().st_size
            time.sleep(0.3)
        self.process.terminate()
        self.process.wait(10)
        text = self.log.read_text()
        assert "DROPCOUNT" not in text
        return [line.split()[2] for line in text.splitlines() if len(line.split()) == 3]


def listen(folder: Path, *options: str, config: str = "a.toml", interface: str = "can0") -> Run:
    return Run(folder, *options, config=config, interface=interface)


def end(run: Run) -> list[dict]:
    """@return its events; whether its numbers make a model does not matter"""
    time.sleep(0.3)
    run.process.send_signal(signal.SIGINT)
    assert run.process.wait(30) in (0, 3), run.messages()
    return run.events()


def on_can0(folder: Path, **changes: str) -> Path:
    """Config and log of the rig on can0."""
    text = (folder / "a.toml").read_text().replace('"vcan0"', '"can0"')
    for key, value in changes.items():
        text, found = re.subn(rf"(?m)^{key} = .*$", f"{key} = {value}", text)
        assert found == 1
    (folder / "a.toml").write_text(text)
    (folder / "a.log").write_text((folder / "a.log").read_text().replace(" vcan0 ", " can0 "))
    return folder


@pytest.fixture(autouse=True)
def buses() -> None:
    bring_up()
