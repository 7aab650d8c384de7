# SPDX-License-Identifier: MIT
"""A sensor without a counter in bursts, through a line and the whole program, in a kernel whose clock only runs while
everybody waits: nobody is ever late, however busy the computer is. Run by tests/kernel/run."""

from __future__ import annotations

import random
import time
from pathlib import Path

import pytest
from lines import Run, line, of_type, witmotion

RATE, IN_BURST, COUNT = 200, 8, 3200
LOST = {162, 163, 164, 623, 1304, 1305, 1776, 1998, 1999, 2000, 2400, 2401, 2402, 2403, 2404, 2405, 2406, 2407}


def send_bursts(device: Path, config: Path, packets: list[bytes]) -> list[dict]:
    """Eight packets at once, those that are not empty. @return events of the run"""
    with line(device) as ours:
        run = Run(config)
        begin = time.monotonic() + 0.5
        for first in range(0, len(packets), IN_BURST):
            due = begin + (first + IN_BURST) / RATE
            time.sleep(due - time.monotonic())
            ours.write(b"".join(packets[first : first + IN_BURST]))
            assert time.monotonic() - due < 1e-3, "the clock is that of the wall"
        time.sleep(0.3)
        run.stop()
        return run.finish()


@pytest.mark.parametrize("fault", ["none", "lost", "check sum"])
def test_bursts_of_a_sensor_without_a_counter(tmp_path: Path, fault: str) -> None:
    """No gap but those of lost packets, no sample too many; a check sum that fails tells the place."""
    device, config = tmp_path / "sensor", tmp_path / "a.toml"
    config.write_text(
        f'[acquisition]\nrate_hz = {RATE}\n[[bus]]\nname = "s"\npreset = "wt901"\nbaud = 115200\ndevice = "{device}"\n'
        '[[channel]]\nname = "x"\npreset = "wt901.x"\ndof = 1\n'
        '[identification]\nmethod = "n4sid-cva"\nrows = 10\norder = 2\nupdate_s = 1.0\nsigma_blocks = 0\n'
    )
    draw, motion = random.Random(4), [0.0, 0.0]
    packets = []
    for n in range(COUNT):
        motion = [1.6 * motion[0] - 0.96 * motion[1] + draw.gauss(0, 800), motion[0]]
        packets.append(witmotion(round(motion[0]), n, 0))
    lost = LOST if fault != "none" else set()
    for n in lost:
        whole = packets[n]
        packets[n] = b"" if fault == "lost" else whole[:4] + bytes([whole[4] ^ 1]) + whole[5:]
    events = send_bursts(device, config, packets)
    stats = of_type(events, "stats")[-1]
    bus, channel = stats["bus"]["s"], stats["channel"]["x"]
    assert bus["duplicate"] == 0 and bus["received"] == COUNT - len(lost)
    assert bus["damaged"] == (len(lost) if fault == "check sum" else 0)
    gaps = of_type(events, "gap")
    marked = {n for gap in gaps for n in range(gap["first"], gap["last"] + 1)}
    assert len(marked) == len(lost) == channel["missing"], (marked, stats)
    assert channel["expected"] == COUNT
    assert fault != "none" or "uncertain" not in channel  # a single loss looks like a poll that slipped past it
    assert all(min(abs(n - m) for m in lost) < IN_BURST for n in marked), sorted(marked)
    if fault == "check sum":
        assert marked == lost and {gap["cause"] for gap in gaps} == {"crc"}
