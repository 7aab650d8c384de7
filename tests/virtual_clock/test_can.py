# SPDX-License-Identifier: MIT
"""CAN in a kernel whose clock only runs while everybody waits: how long something takes to be told, and a computer
whose clock is set while it measures. Run by tests/kernel/run."""

from __future__ import annotations

import csv
import random
import socket
import struct
import time
from collections.abc import Callable
from pathlib import Path

import pytest
from can_run import OKID, Run, sh

RATE, SAMPLES = 200, 2400
SETS = {300: 3.0, 700: -7.0, 1100: 0.2, 1101: -0.1, 1500: 3600.0, 1900: -86400.0}  # at this sample by so many seconds


@pytest.fixture
def live(tmp_path: Path) -> Run:
    """Two buses whose frames have no counter."""
    text = f"[acquisition]\nrate_hz = {RATE}\n"
    for bus in (0, 1):
        sh("ip", "link", "add", f"vcan{bus}", "type", "vcan", check=False)
        sh("ip", "link", "set", f"vcan{bus}", "up")
        text += f'[[bus]]\nname = "can{bus}"\ninterface = "vcan{bus}"\n'
    for bus, role in enumerate(("force", "acceleration")):
        text += f'[[channel]]\nname = "c{bus}"\nrole = "{role}"\nbus = "can{bus}"\ncan_id = 0x100\n'
        text += "start_bit = 0\nlength = 16\nsigned = true\n"
    (tmp_path / "a.toml").write_text(text + "[identification]\np = 4\nupdate_s = 1.0\nsigma_blocks = 0\n[record]\n")
    return Run(tmp_path)


def told(run: Run, kind: str, cause: Callable[[], object]) -> float:
    """@return s from the cause until okid has told the event"""
    begin = time.monotonic()
    cause()
    while f'"event":"{kind}"' not in (run.folder / "ev").read_text():
        assert time.monotonic() - begin < 5, run.messages()
        time.sleep(0.001)
    return time.monotonic() - begin


def opened() -> list[socket.socket]:
    """Both buses."""
    buses = [socket.socket(socket.AF_CAN, socket.SOCK_RAW, socket.CAN_RAW) for _ in (0, 1)]
    for number, each in enumerate(buses):
        each.bind((f"vcan{number}",))
    return buses


def test_what_happens_to_a_bus_is_told_at_once(live: Run) -> None:
    buses = opened()
    for _ in range(100):
        for each in buses:
            each.send(struct.pack("=IB3xh6x", 0x100, 2, 0))
        time.sleep(1 / RATE)
    time.sleep(0.35)  # anywhere between two regular looks
    for kind, cause in (
        ("bus_off", ("cansend", "vcan0", "20000040#0000000000000000")),
        ("restarted", ("cansend", "vcan0", "20000100#0000000000000000")),
        ("link_down", ("ip", "link", "set", "vcan0", "down")),
        ("link_up", ("ip", "link", "set", "vcan0", "up")),
    ):
        late_s = told(live, kind, lambda what=cause: sh(*what))
        print(f"{kind} told after {1e3 * late_s:.0f} ms")
        assert late_s < 0.02, kind
    live.stop(status=3)


def test_the_clock_is_set(live: Run) -> None:
    """By hand, by NTP in steps, by days: no frame is lost, none is elsewhere, in the samples and in the journal."""
    buses = opened()
    draw, motion = random.Random(1), [0.0, 0.0]
    sent = []
    for _ in range(SAMPLES):
        force = draw.gauss(0, 500)
        motion = [1.6 * motion[0] - 0.96 * motion[1] + force, motion[0]]
        sent.append((round(force), round(motion[0])))
    begin = time.monotonic() + 0.1
    for n, values in enumerate(sent):
        time.sleep(max(0.0, begin + n / RATE - time.monotonic()))
        if n in SETS:
            time.clock_settime(time.CLOCK_REALTIME, time.time() + SETS[n])
        for number, each in enumerate(buses):
            each.send(struct.pack("=IB3xh6x", 0x100, 2, values[number]))
            time.sleep(0.0005 * (1 - number))
    time.clock_settime(time.CLOCK_REALTIME, time.time() - sum(SETS.values()))  # the kernel is that of other tests, too
    events = live.stop(status=0)
    stats = [event for event in events if event["type"] == "stats"][-1]
    assert not [event for event in events if event["type"] == "gap"]
    for bus in ("can0", "can1"):
        assert stats["bus"][bus]["received"] == SAMPLES
        assert [stats["bus"][bus][key] for key in ("lost", "too_late", "out_of_order", "duplicate")] == [0] * 4
    for channel in stats["channel"].values():
        assert channel["expected"] == channel["received"] == SAMPLES and "uncertain" not in channel
    (journal,) = (live.folder / "runs").glob("*.okj")
    sh(OKID, "convert", str(journal), str(live.folder / "a.csv"), "-c", str(live.folder / "a.toml"))
    with open(live.folder / "a.csv", newline="") as file:
        rows = list(csv.DictReader(row for row in file if not row.startswith("#")))
    assert [(float(row["c0"]), float(row["c1"])) for row in rows] == sent
    sh(OKID, "replay", str(journal), "--json", str(live.folder / "again.json"))
    assert (live.folder / "again.json").read_bytes() == (live.folder / "r.json").read_bytes()
