# SPDX-License-Identifier: MIT
"""A force without a counter in bursts that all end alike, beside a punctual bus: how well its time is known is said,
and what that means for R. The log is made here, of a simulated oscillator, not by `okid simulate`."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import program

CONFIG = """[acquisition]
rate_hz = 1000
[[bus]]
name = "a"
type = "socketcan"
interface = "can0"
[[bus]]
name = "b"
type = "socketcan"
interface = "can1"
[[channel]]
name = "force"
role = "force"
bus = "b"
can_id = 0x100
start_bit = 0
length = 16
signed = true
[[channel]]
name = "acc"
role = "acceleration"
bus = "a"
can_id = 0x200
start_bit = 0
length = 16
signed = true
sequence = { start_bit = 16, length = 16 }
[identification]
p = 10
update_s = 2.0
sigma_blocks = 0
"""


def play(folder: Path, every_s: float) -> tuple[dict[str, Any], dict[str, Any]]:
    """@return the last stats, the result"""
    force = np.random.default_rng(4).integers(-8000, 8000, 8000)
    answer, state = [], np.zeros(2)
    for value in force:
        state = np.array([1.9 * state[0] - 0.98 * state[1] + 0.05 * value, state[0]])
        answer.append(round(float(state[0])))
    rows = []
    for n, (value, response) in enumerate(zip(force.tolist(), answer, strict=True)):
        due = n / 1000
        held = np.ceil(due / every_s + 1e-9) * every_s if every_s else due
        rows.append((due, f"can0 200#{(response & 0xFFFF).to_bytes(2, 'little').hex()}{n.to_bytes(2, 'little').hex()}"))
        rows.append((float(held) + 1e-4, f"can1 100#{(value & 0xFFFF).to_bytes(2, 'little').hex()}"))
    rows.sort(key=lambda row: row[0])
    (folder / "a.log").write_text(
        "".join(f"({1.7e9 + t:.6f}) {text.upper().replace('CAN', 'can')}\n" for t, text in rows)
    )
    (folder / "a.toml").write_text(CONFIG)
    done = program.okid("replay", folder / "a.log", "-c", folder / "a.toml", "--events", folder / "e")
    assert done.returncode == 0, done.stderr
    events = [json.loads(line) for line in (folder / "e").read_text().splitlines()]
    stats = [event for event in events if event["type"] == "stats"][-1]
    return stats, events[-1]["result"]


def test_bursts_that_end_alike_leave_a_part_of_a_sample_open(tmp_path: Path) -> None:
    stats, result = play(tmp_path, 0.016)
    known_us = stats["channel"]["force"]["place_std_us"]
    assert 150 < known_us < 1000 / np.sqrt(12) + 1  # uniform over what is left of a sample period
    assert "place_std_us" not in stats["channel"]["acc"]
    (text,) = [warning["text"] for warning in result["warnings"] if warning["code"] == "burst_delay"]
    assert '"force"' in text and f"{known_us:.2g} us" in text
    assert abs(stats["rate_hz_by_stamps"] - 1000) < 0.5


def test_bursts_that_end_anywhere_and_punctual_frames_are_known(tmp_path: Path) -> None:
    for every_s in (0.0, 0.01617):
        stats, result = play(tmp_path, every_s)
        assert stats["channel"]["force"].get("place_std_us", 0) < 60
        assert stats["channel"]["force"]["missing"] == 0
