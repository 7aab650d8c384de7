# SPDX-License-Identifier: MIT
"""CAN frames over a serial line: okid at one end, python-can's slcan interface at the other."""

from __future__ import annotations

import cmath
import contextlib
import math
import random
import threading
from collections.abc import Iterator
from io import FileIO
from pathlib import Path

import can
import program
from lines import Line, Run, line, of_type

CONFIG = """[acquisition]
rate_hz = 1000
[[bus]]
name = "adapter"
type = "slcan"
device = "{device}"
bitrate = 500000
[[channel]]
name = "force"
role = "force"
can_id = 0x100
start_bit = 16
length = 16
signed = true
sequence = {{ start_bit = 0, length = 16 }}
[[channel]]
name = "a1"
role = "acceleration"
can_id = 0x18F02D0B
start_bit = 16
length = 16
signed = true
sequence = {{ start_bit = 0, length = 16 }}
[identification]
p = 4
update_s = 1.0
sigma_blocks = 0
"""


@contextlib.contextmanager
def wire(first: Path, second: Path) -> Iterator[tuple[Line, Line]]:
    """Two devices with a null-modem cable between them."""
    with line(first) as a, line(second) as b:
        for source, target in ((a, b), (b, a)):
            threading.Thread(target=carry, args=(source.own(), target.own()), daemon=True).start()
        yield a, b


def carry(source: FileIO, target: FileIO) -> None:
    with source, target, contextlib.suppress(OSError):
        while data := source.read(4096):
            while data:
                data = data[target.write(data) :]


def message(identifier: int, n: int, value: int) -> can.Message:
    data = (n & 0xFFFF).to_bytes(2, "little") + value.to_bytes(2, "little", signed=True)
    return can.Message(arbitration_id=identifier, is_extended_id=identifier > 0x7FF, data=data)


def test_frames_of_python_can_are_identified(tmp_path: Path) -> None:
    config = tmp_path / "slcan.toml"
    config.write_text(CONFIG.format(device=tmp_path / "okid"))
    draw = random.Random(1)
    lost = {n for n in range(50, 950) if draw.random() < 0.03}
    with wire(tmp_path / "okid", tmp_path / "python"):
        run = Run(config, "--duration", 1.0)
        with can.Bus(interface="slcan", channel=str(tmp_path / "python"), sleep_after_open=0) as bus:
            state = [0.0, 0.0]
            for n in range(1000):
                force = draw.randint(-9000, 9000)
                state = [1.6 * state[0] - 0.9 * state[1] + 0.1 * force, state[0]]
                bus.send(message(0x100, n, force))
                bus.send(can.Message(arbitration_id=0x7DF, is_remote_frame=True, is_extended_id=False))
                if n not in lost:
                    bus.send(message(0x18F02D0B, n, round(state[0] + draw.gauss(0, 20))))
            events = run.finish()
    gaps = [n for gap in of_type(events, "gap") for n in range(gap["first"], gap["last"] + 1)]
    assert sorted(gaps) == sorted(lost)
    stats = of_type(events, "stats")[-1]
    assert stats["bus"]["adapter"]["lost"] == len(lost) == stats["bus"]["adapter"]["lost_by"]["sequence"]
    assert stats["channel"]["force"]["missing"] == 0
    pole = complex(0.8, math.sqrt(0.9 - 0.8**2))  # of z^2 - 1.6 z + 0.9
    pole_hz = 1000 * abs(cmath.log(pole)) / (2 * math.pi)
    assert abs(events[-1]["result"]["modes"][0]["frequency_hz"] - pole_hz) < 1.0


def test_a_log_is_played_onto_an_adapter(tmp_path: Path) -> None:
    draw = random.Random(2)
    sent = []
    for _ in range(300):
        extended, size = draw.random() < 0.5, draw.randrange(9)
        identifier = draw.randrange(1 << 29 if extended else 1 << 11)
        sent.append((identifier, extended, draw.randbytes(size)))
    with open(tmp_path / "a.log", "w") as log:
        for n, (identifier, extended, data) in enumerate(sent):
            name = f"{identifier:08X}" if extended else f"{identifier:03X}"
            log.write(f"({n * 0.001:.6f}) can0 {name}#{data.hex().upper()}\n")
    with (
        wire(tmp_path / "okid", tmp_path / "python"),
        can.Bus(interface="slcan", channel=str(tmp_path / "python"), sleep_after_open=0) as bus,
    ):
        done = program.okid("replay", tmp_path / "a.log", "--to", tmp_path / "okid", "--speed", "max")
        assert done.returncode == 0, done.stderr
        assert f"300 frames played onto {tmp_path / 'okid'}" in done.stdout
        got = []
        while len(got) < 300:
            received = bus.recv(timeout=1800)
            assert received is not None, len(got)
            got.append((received.arbitration_id, received.is_extended_id, bytes(received.data)))
    assert got == sent
    done = program.okid("replay", tmp_path / "a.log", "--to", tmp_path / "okid")
    assert done.returncode == 4 and "there is no such device" in done.stderr


def test_a_rate_the_protocol_has_not(tmp_path: Path) -> None:
    config = tmp_path / "slcan.toml"
    config.write_text(CONFIG.format(device="/dev/ttyX").replace("500000", "83333"))
    done = program.okid("check", config)
    assert done.returncode == 2
    assert "found 83333, slcan has 10000, 20000" in done.stderr
    config.write_text(CONFIG.format(device="/dev/ttyX").replace("bitrate = 500000", 'btr = "031C"'))
    assert program.okid("check", config).returncode == 0
    config.write_text(CONFIG.format(device="/dev/ttyX").replace("bitrate = 500000", 'btr = "zz"'))
    done = program.okid("check", config)
    assert done.returncode == 2 and "expected hexadecimal digits" in done.stderr
