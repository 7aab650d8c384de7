# SPDX-License-Identifier: MIT
"""A computer that is suspended while it measures: sensors go on, nobody hears them, and the stamps jump. In a kernel
whose clock only runs while everybody waits, woken by its own clock. Run by tests/kernel/run."""

from __future__ import annotations

import csv
import random
import socket
import struct
import time
from pathlib import Path

import pytest
from can_run import OKID, Run, sh
from lines import line

RATE, SAMPLES = 200, 2400
SLEEPS = {700: 20, 1500: 90}  # behind so many samples that were heard, for so many seconds


def now_s() -> float:
    return time.clock_gettime(time.CLOCK_BOOTTIME)


def config(folder: Path, counted: bool) -> str:
    text = f"[acquisition]\nrate_hz = {RATE}\n"
    text += f'[[bus]]\nname = "line"\ntype = "serial"\nframing = "ascii"\ndevice = "{folder}/tty"\n'
    text += '[[channel]]\nname = "text"\nrole = "aux"\nbus = "line"\nfield = 0\n'
    for bus in (0, 1):
        text += f'[[bus]]\nname = "can{bus}"\ninterface = "vcan{bus}"\n'
    for bus, role in enumerate(("force", "acceleration")):
        text += f'[[channel]]\nname = "c{bus}"\nrole = "{role}"\nbus = "can{bus}"\ncan_id = 0x100\n'
        text += "start_bit = 0\nlength = 16\nsigned = true\n"
        text += "sequence = { start_bit = 16, length = 16 }\n" if counted else ""
    return text + "[identification]\np = 4\nupdate_s = 1.0\nsigma_blocks = 0\n[record]\n"


@pytest.mark.parametrize("counted", [True, False], ids=["counter", "no counter"])
def test_suspended(tmp_path: Path, counted: bool) -> None:
    """What was not heard is marked, to the sample, with a counter and without, on buses and on a line."""
    for bus in (0, 1):
        sh("ip", "link", "add", f"vcan{bus}", "type", "vcan", check=False)
        sh("ip", "link", "set", f"vcan{bus}", "up")
    (tmp_path / "a.toml").write_text(config(tmp_path, counted))
    with line(tmp_path / "tty") as tty:
        run = Run(tmp_path)
        buses = [socket.socket(socket.AF_CAN, socket.SOCK_RAW, socket.CAN_RAW) for _ in (0, 1)]
        for number, each in enumerate(buses):
            each.bind((f"vcan{number}",))
        begin, n, slept = now_s() + 0.1, 0, dict(SLEEPS)
        draw, motion = random.Random(1), [0.0, 0.0]
        sent: dict[int, tuple[int, int, int]] = {}
        tty.write(b"0\n")  # the first line of a text may be half of one
        while len(sent) < SAMPLES:
            time.sleep(max(0.0, begin + n / RATE - now_s()))
            force = draw.gauss(0, 500)
            motion = [1.6 * motion[0] - 0.96 * motion[1] + force, motion[0]]
            sent[n] = round(force), round(motion[0]), n
            for number, each in enumerate(buses):
                each.send(struct.pack("=IB3xhH4x", 0x100, 4, sent[n][number], n & 0xFFFF))
                time.sleep(0.0005)
            tty.write(b"%d\n" % n)
            n += 1
            if seconds := slept.pop(len(sent), 0):
                time.sleep(0.001)
                before_s = now_s()
                sh("rtcwake", "-m", "mem", "-s", str(seconds), seconds=600)
                assert now_s() - before_s > seconds - 1.5
                n = int((now_s() - begin) * RATE) + 1
        events = run.stop()
    places = sorted(sent)
    missing = [(a + 1, b - 1) for a, b in zip(places, places[1:], strict=False) if b != a + 1]
    assert len(missing) == len(SLEEPS)
    for name in ("text", "c0", "c1"):
        gaps = [(e["first"], e["last"]) for e in events if e["type"] == "gap" and e["channel"] == name]
        assert gaps == missing, name
    stats = [event for event in events if event["type"] == "stats"][-1]
    for channel in stats["channel"].values():
        assert channel["received"] == SAMPLES and channel["expected"] == places[-1] + 1
    (journal,) = (tmp_path / "runs").glob("*.okj")
    sh(OKID, "convert", str(journal), str(tmp_path / "a.csv"), "-c", str(tmp_path / "a.toml"))
    with open(tmp_path / "a.csv", newline="") as file:
        rows = list(csv.DictReader(row for row in file if not row.startswith("#")))
    assert len(rows) == places[-1] + 1
    values = [tuple(float(row[name] or "nan") for name in ("c0", "c1", "text")) for row in rows]
    assert {n: row for n, row in enumerate(values) if row[0] == row[0]} == sent
    sh(OKID, "replay", str(journal), "--json", str(tmp_path / "again.json"))
    assert (tmp_path / "again.json").read_bytes() == (tmp_path / "r.json").read_bytes()
