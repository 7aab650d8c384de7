# SPDX-License-Identifier: MIT
"""load_percent of the stats against bits counted one by one, at a bit rate so low that every bit shows."""

from __future__ import annotations

import json
import random
import subprocess
from pathlib import Path

from program import PROGRAM
from wire_bits import FD_LENGTHS, classic, flexible

BITRATE, DBITRATE, RATE = 1000, 4000, 1000.0
CONFIG = f"""
[acquisition]
rate_hz = {RATE}
[[bus]]
name = "can0"
interface = "can0"
fd = true
bitrate = {BITRATE}
dbitrate = {DBITRATE}
[[channel]]
name = "f"
role = "force"
can_id = 256
start_bit = 16
length = 16
sequence = {{ start_bit = 0, length = 16 }}
[[channel]]
name = "a"
role = "acceleration"
can_id = 256
start_bit = 32
length = 16
[identification]
p = 4
rows = 8
update_s = 0.1
"""


def test_load_counts_every_bit(tmp_path: Path) -> None:
    dice = random.Random(5)
    (tmp_path / "c.toml").write_text(CONFIG)
    for turn in range(12):
        samples, seconds, lines = 100, 0.0, []
        for n in range(samples):
            data = n.to_bytes(2, "little") + dice.randbytes(6)
            frames = [(0x100, False, data, None)]
            for _ in range(dice.randrange(3)):  # other traffic loads the bus too
                extended, fd = dice.random() < 0.5, dice.random() < 0.5
                size = dice.choice(FD_LENGTHS) if fd else dice.randrange(9)
                fill = dice.choice([dice.randbytes(64), bytes(64), b"\xff" * 64, b"\x0f\xf8" * 32])
                other = dice.randrange(1 << 29) if extended else dice.randrange(0x101, 0x800)
                frames.append((other, extended, fill[:size], dice.random() < 0.5 if fd else None))
            for k, (identifier, extended, payload, switched) in enumerate(frames):
                name = f"{identifier:08X}" if extended else f"{identifier:03X}"
                mark = "#" if switched is None else f"##{int(switched)}"
                lines.append(f"({1000 + n / RATE + k * 1e-5:.6f}) can0 {name}{mark}{payload.hex().upper()}")
                if switched is None:
                    seconds += classic(identifier, extended, payload, BITRATE)
                else:
                    seconds += flexible(identifier, extended, switched, payload, BITRATE, DBITRATE)
        (tmp_path / "l.log").write_text("\n".join(lines) + "\n")
        events = tmp_path / "e.jsonl"
        subprocess.run(
            [PROGRAM, "replay", tmp_path / "l.log", "-c", tmp_path / "c.toml", "--events", events],
            capture_output=True,
            check=False,
            timeout=1800,
        )
        stats = [e for e in map(json.loads, events.read_text().splitlines()) if e["type"] == "stats"][-1]
        expected = 100 * seconds * RATE / samples
        assert abs(stats["bus"]["can0"]["load_percent"] - expected) < 0.006, turn  # a bit is 1 percent or 0.25
