# SPDX-License-Identifier: MIT
"""Frames onto the sample grid: the same rows as `okid convert` makes of the same log, whatever befell the frames."""

from __future__ import annotations

import os
import random
import tracemalloc
from pathlib import Path

import can
import numpy as np
import pytest
from captured import edited, samples_by_program, samples_of
from okid import capture


def battered(lines: list[str], seed: int) -> list[str]:
    """Frames lost one by one and in runs, doubled, shuffled, with a wrong counter, cut short; joined in the middle."""
    draw = random.Random(seed)
    out: list[str] = []
    at, longest = draw.randrange(20), 60 if seed % 3 else 700
    while at < len(lines):
        line, chance = lines[at], draw.random()
        head, data = line.split("#")
        if chance < 0.01:
            pass
        elif chance < 0.012:
            at += draw.randrange(2, longest)
        elif chance < 0.02:
            out += [line, line]
        elif chance < 0.03:
            count = draw.randrange(2, 14)
            out += draw.sample(lines[at : at + count], len(lines[at : at + count]))
            at += count - 1
        elif chance < 0.034 and seed % 2:
            out.append(f"{head}#{draw.randbytes(2).hex().upper()}{data[4:]}")
        elif chance < 0.036:
            out.append(line[:-4])
        else:
            out.append(line)
        at += 1
    return out


@pytest.mark.parametrize("seed", range(12))
def test_counted_frames_stand_where_the_program_puts_them(rig: Path, tmp_path: Path, seed: int) -> None:
    log = tmp_path / "f.log"
    log.write_text("\n".join(battered((rig / "a.log").read_text().splitlines(), seed)) + "\n")
    ours, kept = samples_of(log, rig / "a.toml")
    wanted = samples_by_program(log, rig / "a.toml")
    assert ours.shape == wanted.shape
    assert np.isnan(wanted).any()
    assert np.allclose(ours, wanted, rtol=1e-9, atol=1e-12, equal_nan=True)
    assert kept.counts["can0"].lost_in_all > 0


def late(lines: list[str], seed: int) -> list[str]:
    """Stamps of a sensor off its rate, handed on late at random or in bursts of 16 ms; some frames are lost."""
    draw = random.Random(seed)
    ppm, kind = draw.uniform(-250, 250) * 1e-6, seed % 3
    out: list[tuple[float, str]] = []
    for number, line in enumerate(lines):
        if kind != 2 and draw.random() < 0.004:
            continue
        time_s = (float(line[1:18]) - 1.7e9) * (1 + ppm)
        if kind == 1:
            time_s += draw.expovariate(1 / 200e-6)
        elif kind == 2:
            time_s = np.ceil(time_s / 0.016) * 0.016 + number * 1e-9  # in the order they were sent
        out.append((1.7e9 + time_s, line[19:]))
    return [f"({time_s:.6f}){rest}" for time_s, rest in sorted(out)]


@pytest.mark.parametrize("seed", range(6))
def test_frames_without_counter_stand_where_the_program_puts_them(rig: Path, tmp_path: Path, seed: int) -> None:
    config = edited(rig / "a.toml", tmp_path / "a.toml", lambda text: text.replace('sequence = "Counter"\n', ""))
    (tmp_path / "a.dbc").write_text((rig / "a.dbc").read_text())
    log = tmp_path / "f.log"
    log.write_text("\n".join(late((rig / "a.log").read_text().splitlines(), seed)) + "\n")
    ours, _ = samples_of(log, config)
    wanted = samples_by_program(log, config)
    assert ours.shape == wanted.shape
    assert np.isnan(wanted[10:-10]).any() == (seed % 3 != 2)  # the log may begin and end within a burst
    assert np.allclose(ours, wanted, rtol=1e-9, atol=1e-12, equal_nan=True)


BITS = """
[acquisition]
rate_hz = 100.0
[[bus]]
name = "can0"
interface = "can0"
[[channel]]
name = "f"
role = "force"
unit = "kN"
can_id = 0x10
start_bit = 7
length = 12
byte_order = "big"
signed = true
scale = 0.5
sequence = { start_bit = 12, length = 4 }
[[channel]]
name = "a"
role = "acceleration"
unit = "g"
pgn = 61485
start_bit = 0
length = 16
scale = 0.01
zero_code = 32000
[[channel]]
name = "b"
role = "displacement"
can_id = 0x11
start_bit = 0
length = 32
value = "float32"
"""


def test_channels_by_bits_in_si_units(tmp_path: Path) -> None:
    (tmp_path / "c.toml").write_text(BITS)
    config = capture.load_config(tmp_path / "c.toml")
    assert [channel.name for channel in config.wanted] == ["f", "a", "b"]
    sent = []
    for k in range(40):
        t = 100.0 + k / 100
        force = (k - 20 & 0xFFF) << 4 | k & 15
        sent.append(can.Message(t, 0x10, is_extended_id=False, data=force.to_bytes(2, "big")))
        sent.append(can.Message(t, 0x18F02D00 | k & 3, data=(32000 + k).to_bytes(2, "little") + bytes(6)))
        sent.append(can.Message(t, 0x11, is_extended_id=False, data=np.float32(k / 4).tobytes()))
        sent.append(can.Message(t, 0x12, data=b"\1\2"))
    rows = np.vstack(list(capture.can_blocks(sent, config)))
    k = np.arange(40.0)
    assert np.allclose(rows, np.column_stack([500 * (k - 20), 0.01 * 9.80665 * k, k / 4]), atol=1e-12)


MUX = """VERSION ""
NS_ :
BS_:
BU_: Rig
BO_ 256 Node: 4 Rig
 SG_ Axis M : 0|8@1+ (1,0) [0|3] "" Rig
 SG_ X m0 : 16|16@1- (0.5,0) [0|0] "m/s^2" Rig
 SG_ Y m1 : 16|16@1- (0.25,1) [0|0] "m/s^2" Rig
"""


def test_multiplexed_signals(tmp_path: Path) -> None:
    (tmp_path / "m.dbc").write_text(MUX)
    text = '[acquisition]\nrate_hz = 100.0\n[[bus]]\nname = "can0"\ninterface = "can0"\ndbc = "m.dbc"\n'
    for name in "XY":
        text += f'[[channel]]\nname = "{name}"\nrole = "acceleration"\nmessage = "Node"\nsignal = "{name}"\n'
    (tmp_path / "m.toml").write_text(text)
    sent = [
        can.Message(50 + k / 100 + axis * 1e-3, 256, is_extended_id=False, data=bytes([axis, 0, k, 0]))
        for k in range(30)
        for axis in (0, 1)
    ]
    rows = np.vstack(list(capture.can_blocks(sent, tmp_path / "m.toml")))
    k = np.arange(30.0)
    assert np.allclose(rows, np.column_stack([0.5 * k, 0.25 * k + 1]))


def counted(k: int) -> can.Message:
    return can.Message(100.0 + k / 1000, 0x10, is_extended_id=False, data=(k & 0xFFFF).to_bytes(2, "little") + b"\1\0")


COUNTED = """[acquisition]
rate_hz = 1000.0
[[bus]]
name = "can0"
interface = "can0"
[[channel]]
name = "a"
role = "acceleration"
can_id = 0x10
start_bit = 16
length = 16
sequence = { start_bit = 0, length = 16 }
"""


def test_a_long_silence_is_missing_samples_and_no_memory(tmp_path: Path) -> None:
    (tmp_path / "c.toml").write_text(COUNTED)
    with capture.Capture(tmp_path / "c.toml", identify=False) as kept:
        kept.push(counted(k) for k in [*range(100), 100 + 3_600_000, 101 + 3_600_000])
        kept.finish()
        tracemalloc.start()
        blocks = kept.take()
        assert tracemalloc.get_traced_memory()[0] < 1 << 20
        tracemalloc.stop()
        assert sum(map(len, blocks)) == 3_600_102
        assert kept.counts["can0"].lost_in_all == 3_600_000


def resident() -> int:
    """Bytes of this process."""
    return int(Path("/proc/self/statm").read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE")


def test_memory_does_not_grow_with_the_stream(tmp_path: Path) -> None:
    (tmp_path / "c.toml").write_text(COUNTED)
    with capture.Capture(tmp_path / "c.toml", identify=False, keep_events=False) as kept:
        taken = 0

        def run(first: int, count: int) -> int:
            nonlocal taken
            for at in range(first, first + count, 250):
                kept.push(counted(k) for k in range(at, at + 250) if k % 97)  # losses all along
                taken += sum(map(len, kept.take()))
            return resident()

        before = run(0, 20000)
        after = run(20000, 60000)
        assert after - before < 1 << 20
        assert taken > 78000
        assert kept.counts["can0"].lost["sequence"] > 780


def test_a_limit_ends_the_samples_exactly(rig: Path) -> None:
    kept = capture.Capture(rig / "a.toml", identify=False, duration=777 / 250)
    assert sum(map(len, capture.can_blocks(capture.log_messages(rig / "a.log"), kept.config, samples=kept))) == 777
