# SPDX-License-Identifier: MIT
"""okid-capture of a log is okid replay of it: the same samples and gap marks to the bit, the same causes, events and
result, for every framing and kind of clock, read by the library or handed over message by message."""

from __future__ import annotations

import binascii
import ctypes
import json
import random
import struct
import subprocess
from collections.abc import Callable
from pathlib import Path
from typing import Any

import can
import numpy as np
import okid as okid_package
import pytest
from lines import packet
from numpy.typing import NDArray
from okid import capture
from okid.capture import stream
from program import okid

RATE, SAMPLES = 200.0, 2400
HEAD = f"[acquisition]\nrate_hz = {RATE}\n"
BUS = '[[bus]]\nname = "can0"\ninterface = "can0"\n'
TAIL = "[identification]\np = 8\nrows = 16\nupdate_s = 1.0\n"


def signals(count: int = SAMPLES, rate_hz: float = RATE) -> NDArray[np.float64]:
    """Force and two accelerations of two modes, as whole numbers within 15 bits."""
    noise = np.random.default_rng(5)
    force = noise.standard_normal(count)
    out = np.zeros((count, 2))
    for f, zeta, shape in ((17.0, 0.01, (1.0, 0.7)), (41.0, 0.01, (0.6, -0.9))):
        pole = np.exp(2 * np.pi * f / rate_hz * complex(-zeta, 1))
        state = 0j
        for k in range(count):
            out[k] += np.array(shape) * state.real
            state = pole * state + force[k] * 0.1
    rows = np.column_stack([force, out + 0.002 * noise.standard_normal((count, 2))])
    return np.round(rows / np.abs(rows).max(axis=0) * 30000)


def channel(name: str, role: str, **keys: Any) -> str:
    shown = {"name": name, "role": role, **keys}
    return "[[channel]]\n" + "".join(
        f"{key} = {value if key == 'sequence' else json.dumps(value)}\n" for key, value in shown.items()
    )


NAMES = (("f", "force"), ("a", "acceleration"), ("b", "acceleration"))


def bits(can_id: int, at: int, **more: Any) -> dict[str, Any]:
    return {"bus": "can0", "can_id": can_id, "start_bit": at, "length": 16, "signed": True, "scale": 0.01, **more}


def frame_line(time_s: float, can_id: str, data: bytes, fd: bool = False) -> str:
    return f"({1.7e9 + time_s:.6f}) can0 {can_id}#{'#1' if fd else ''}{data.hex().upper()}"


def frames(counted: bool = True, rate_hz: float = RATE, can_ids: tuple[str, str] = ("100", "101")) -> list[str]:
    """One frame with the force and one with both accelerations; bytes 0-1 count."""
    out = []
    for k, (f, a, b) in enumerate(signals(rate_hz=rate_hz).astype(int).tolist()):
        head = struct.pack("<H", k & 0xFFFF) if counted else b""
        out.append(frame_line(k / rate_hz, can_ids[0], head + struct.pack("<h", f)))
        out.append(frame_line(k / rate_hz + 4e-4, can_ids[1], head + struct.pack("<hh", a, b)))
    return out


def battered(lines: list[str], seed: int = 1) -> list[str]:
    """Frames lost one by one and in runs, doubled and out of order."""
    draw = random.Random(seed)
    out: list[str] = []
    at = 0
    while at < len(lines):
        chance = draw.random()
        if chance < 0.01:
            at += 1 if chance < 0.007 else draw.randrange(2, 50)
            continue
        if chance < 0.02:
            out += [lines[at]] * 2
        elif chance < 0.03:
            several = lines[at : at + 6]
            out += draw.sample(several, len(several))
            at += 5
        else:
            out.append(lines[at])
        at += 1
    return out


def jittered(lines: list[str], seed: int = 2) -> list[str]:
    """Stamps of a clock 120 ppm fast, late by 0.3 ms on average; some frames are lost."""
    draw = random.Random(seed)
    late = [
        (((float(line[1:18]) - 1.7e9) * (1 + 120e-6)) + draw.expovariate(1 / 3e-4), line[19:])
        for line in lines
        if draw.random() > 0.004
    ]
    return [f"({1.7e9 + t:.6f}){rest}" for t, rest in sorted(late)]


def counted_config(more: str = "", **extra: Any) -> str:
    count = "{ start_bit = 0, length = 16 }"
    places = [(0x100, 16), (0x101, 16), (0x101, 32)]
    channels = [
        channel(*NAMES[k], dof=max(k, 1), **bits(can_id, at, sequence=count, **extra))
        for k, (can_id, at) in enumerate(places)
    ]
    return HEAD + more + BUS + "".join(channels) + TAIL


def plain_config(head: str = HEAD, bus: str = BUS, **extra: Any) -> str:
    places = [(0x100, 0), (0x101, 0), (0x101, 16)]
    return head + bus + "".join(channel(*NAMES[k], **bits(i, at, **extra)) for k, (i, at) in enumerate(places)) + TAIL


def free_config() -> str:
    """The accelerations come from a node on a clock of its own."""
    count = "{ start_bit = 0, length = 16 }"
    text = HEAD + BUS + '[[bus]]\nname = "can1"\ninterface = "can1"\nclock = "free"\nrate_hz = 200.0\n'
    text += channel(*NAMES[0], **bits(0x100, 16, sequence=count))
    for k in (1, 2):
        text += channel(*NAMES[k], **{**bits(0x101, 16 * k, sequence=count), "bus": "can1"})
    return text + TAIL


def free_frames() -> list[str]:
    second = [line.replace("can0 101", "can1 101") for line in frames() if " 101#" in line]
    stretched = [f"({1.7e9 + (float(one[1:18]) - 1.7e9) * (1 + 300e-6):.6f}){one[19:]}" for one in second]
    first = [line for line in frames() if " 100#" in line]
    return sorted(first + stretched, key=lambda line: float(line[1:18]))


def j1939() -> tuple[str, list[str]]:
    """Two groups of parameters from changing source addresses, without a counter."""
    text = HEAD + BUS
    for k, (pgn, at) in enumerate([(65280, 0), (65281, 0), (65281, 16)]):
        text += channel(*NAMES[k], bus="can0", pgn=pgn, start_bit=at, length=16, signed=True, scale=0.01)
    lines = [
        line.replace(" 100#", f" 18FF00{n % 3:02X}#").replace(" 101#", f" 18FF01{n % 3:02X}#")
        for n, line in enumerate(jittered(frames(counted=False)))
    ]
    return text + TAIL, lines


def flexible() -> tuple[str, list[str]]:
    """Everything in one CAN FD frame of 64 bytes, big-endian, float32 and float64 among it."""
    text = HEAD + BUS.replace("interface", "fd = true\ninterface")
    count = "{ start_bit = 0, length = 32 }"
    text += channel(
        *NAMES[0], bus="can0", can_id=0x20, start_bit=39, length=24, signed=True, byte_order="big", sequence=count
    )
    text += channel(*NAMES[1], bus="can0", can_id=0x20, start_bit=64, length=32, value="float32", sequence=count)
    text += channel(*NAMES[2], bus="can0", can_id=0x20, start_bit=448, length=64, value="float64", sequence=count)
    lines = []
    for k, (f, a, b) in enumerate(signals().tolist()):
        body = struct.pack("<I", k) + int(f).to_bytes(3, "big", signed=True) + b"\0" + struct.pack("<f", a / 7)
        lines.append(frame_line(k / RATE, "020", body.ljust(56, b"\xaa") + struct.pack("<d", b / 3), fd=True))
    return text + TAIL, battered(lines, 3)


MUX = """VERSION ""
NS_ :
BS_:
BU_: Rig
BO_ 256 Node: 8 Rig
 SG_ Axis M : 0|8@1+ (1,0) [0|3] "" Rig
 SG_ Count : 8|8@1+ (1,0) [0|255] "" Rig
 SG_ F m0 : 16|16@1- (0.01,0) [0|0] "N" Rig
 SG_ A m1 : 16|16@1- (0.5,0) [0|0] "mg" Rig
 SG_ B m2 : 16|16@1- (0.25,1) [0|0] "m/s^2" Rig
"""


def multiplexed() -> tuple[str, list[str]]:
    text = HEAD + BUS + 'dbc = "m.dbc"\n'
    for k, signal in enumerate("FAB"):
        text += channel(*NAMES[k], message="Node", signal=signal, sequence='"Count"')
    lines = [
        frame_line(k / RATE + axis * 1e-3, "100", struct.pack("<BBh", axis, k & 255, int(number)) + b"\0" * 4)
        for k, row in enumerate(signals())
        for axis, number in enumerate(row)
    ]
    return text + TAIL, battered(lines, 4)


LEVEL = '[trigger]\nsource = "level"\nchannel = "f"\nlevel = 250.0\npretrigger_s = 0.2\n'
EDGE = '[trigger]\nsource = "gpio"\nchip = "gpiochip0"\nline = 3\npretrigger_s = 0.1\n'
WINDOW = TAIL + "window_s = 4.0\n"

CASES: dict[str, Callable[[], tuple[str, list[str]]]] = {
    "counter": lambda: (counted_config(), battered(frames())),
    "counter, one kind after the other": lambda: (counted_config(), battered(frames(), 7)),
    "cadence": lambda: (plain_config(), jittered(frames(counted=False))),
    "free clock": lambda: (free_config(), free_frames()),
    "decimated": lambda: (
        counted_config().replace("rate_hz = 200.0", "rate_hz = 100.0\ndecimate = 2", 1), battered(frames(), 5)
    ),
    "J1939": j1939,
    "CAN FD": flexible,
    "multiplexed": multiplexed,
    "level": lambda: (counted_config() + LEVEL, battered(frames(), 6)),
    "edge": lambda: (counted_config() + EDGE, battered(frames(), 8)),
    "window": lambda: (counted_config().replace(TAIL, WINDOW), battered(frames(), 9)),
    "units and zero code": lambda: (
        counted_config(zero_code=512, unit="g"), frames()
    ),
}  # fmt: skip


def rows_of(kept: capture.Capture) -> NDArray[np.float64]:
    blocks = kept.take(every=True)
    return np.vstack(blocks) if blocks else np.zeros((0, len(kept.config.channels)))


def table(path: Path, config: Path) -> list[list[str]]:
    """The numbers of `okid convert`, as it writes them."""
    out = path.parent / "converted.csv"
    done = okid("convert", path, out, "-c", config)
    assert done.returncode == 0, done.stderr
    return [line.split(",") for line in out.read_text().splitlines() if not line.startswith("#")][1:]


def written(rows: NDArray[np.float64], like: list[list[str]]) -> list[list[str]]:
    """The rows as `okid convert` writes them: ten digits, 17 of a float64."""

    def text(value: float, other: str) -> str:
        short = "nan" if np.isnan(value) else f"{value:.10g}"
        return f"{value:.17g}" if other not in (short, "nan") and short != "nan" else short

    return [
        [text(*pair) for pair in zip(row, other, strict=True)] for row, other in zip(rows.tolist(), like, strict=True)
    ]


@pytest.fixture(params=CASES)
def case(request: pytest.FixtureRequest, tmp_path: Path) -> tuple[Path, Path, float | None]:
    """A config, a log, and when the edge came."""
    text, lines = CASES[request.param]()
    (tmp_path / "m.dbc").write_text(MUX)
    (tmp_path / "c.toml").write_text(text)
    (tmp_path / "c.log").write_text("\n".join(lines) + "\n")
    return tmp_path / "c.toml", tmp_path / "c.log", 1.7e9 + 1.5 if request.param == "edge" else None


def test_a_log_gives_what_okid_replay_gives(case: tuple[Path, Path, float | None], tmp_path: Path) -> None:
    config, log, edge = case
    at = [] if edge is None else ["--trigger-at", f"{edge:.6f}"]
    done = okid("replay", log, "-c", config, "--events", tmp_path / "p.jsonl", "--json", tmp_path / "p.json", *at)
    assert done.returncode == 0, done.stderr
    given = ["can", "--log", log, "--config", config, "--events", tmp_path / "o.jsonl", "--json", tmp_path / "o.json"]
    assert capture.main([str(each) for each in [*given, "--quiet", *at]]) == 0
    theirs = (tmp_path / "p.jsonl").read_text()
    assert theirs == (tmp_path / "o.jsonl").read_text()
    assert (tmp_path / "p.json").read_bytes() == (tmp_path / "o.json").read_bytes()
    wanted = [json.loads(line) for line in theirs.splitlines()]
    assert {"start", "modes", "stats", "result"} <= {event["type"] for event in wanted}
    if edge is not None:
        assert [event["type"] for event in wanted].count("trigger") == 1
    with capture.Capture(config, trigger_at=edge, keep_samples=True) as by_library:
        by_library.open(log)
        while by_library.play(700) == 700:
            pass
        by_library.finish()
        rows = rows_of(by_library)
    with capture.Capture(config, trigger_at=edge, keep_samples=True) as by_message:
        messages = list(capture.log_messages(log))
        for k in range(0, len(messages), 113):
            by_message.push(messages[k : k + 113])
        by_message.finish()
        assert by_message.events() == wanted
        assert rows_of(by_message).tobytes() == rows.tobytes()
    printed = table(log, config)
    assert written(rows, printed) == printed


def test_every_kind_of_loss_was_there(case: tuple[Path, Path, float | None]) -> None:
    """The logs of this file are battered enough to tell something."""
    config, log, edge = case
    with capture.Capture(config, identify=False) as kept:
        for _ in capture.feed_messages(capture.messages_for(log, kept.config), kept):
            pass
        kept.finish()
        gaps = [event for event in kept.events() if event["type"] == "gap"]
        counts = list(kept.counts.values())
        missing = int(np.isnan(rows_of(kept)).sum())
    assert missing == sum(gap["count"] for gap in gaps)
    if "zero_code" not in config.read_text() and "clock" not in config.read_text():
        assert len(gaps) > 5 and sum(one.lost_in_all for one in counts) > 5


def witmotion(f: float, a: float, b: float) -> bytes:
    body = b"\x55\x51" + struct.pack("<hhhh", int(f), int(a), int(b), 2500)
    return body + bytes([sum(body) & 0xFF])


def vectornav(k: int, f: float, a: float, b: float) -> bytes:
    body = b"\x01\x01\x01" + struct.pack("<Qfff", int(k / RATE * 1e9), f, a, b)
    return b"\xfa" + body + binascii.crc_hqx(body, 0).to_bytes(2, "big")


def slcan(k: int, f: float, a: float, b: float) -> bytes:
    frame = struct.pack("<Hhhh", k & 0xFFFF, int(f), int(a), int(b))
    return f"t1008{frame.hex().upper()}{int(k / RATE * 1e3) % 60000:04X}\r".encode()


LINES: dict[str, Callable[[int, list[float]], bytes]] = {
    "cobs": lambda k, row: packet(k, [[int(x) for x in row]], time_us=int(k / RATE * 1e6)),
    "ascii": lambda k, row: ",".join(str(int(x)) for x in (k & 255, *row)).encode() + b"\r\n",
    "witmotion": lambda k, row: witmotion(*row),
    "vectornav": lambda k, row: vectornav(k, *row),
    "slcan": lambda k, row: slcan(k, *row),
}


def line_config(framing: str, folder: Path) -> str:
    head = HEAD + f'[[bus]]\nname = "n"\ndevice = "{folder}/tty"\n'
    if framing == "slcan":
        text = head + 'type = "slcan"\n'
        for k, (name, role) in enumerate(NAMES):
            place = {**bits(0x100, 16 + 16 * k), "bus": "n"}
            text += channel(name, role, **place, sequence="{ start_bit = 0, length = 16 }")
    else:
        text = head + f'type = "serial"\nframing = "{framing}"\n'
        text += "counter_field = 0\ncounter_bits = 8\n" if framing == "ascii" else ""
        for k, (name, role) in enumerate(NAMES):
            text += channel(name, role, field=k + (framing == "ascii"), scale=0.5)
    return text + TAIL + f'[record]\ndirectory = "{folder}/runs"\n'


@pytest.mark.parametrize("framing", LINES)
def test_bytes_of_a_line_give_what_their_journal_gives(framing: str, tmp_path: Path) -> None:
    """Damaged, lost and doubled packets, a line that was away: the capture's own journal, replayed, says the same."""
    config = tmp_path / "c.toml"
    config.write_text(line_config(framing, tmp_path))
    draw = random.Random(11)
    with capture.Capture(config, record=True, keep_samples=True) as kept:
        for k, row in enumerate(signals().tolist()):
            piece = LINES[framing](k, row)
            chance = draw.random()
            if chance < 0.005 or 900 <= k < 930:  # lost
                piece = b""
            elif chance < 0.01:  # damaged
                piece = piece[:4] + bytes([piece[4] ^ 0x15]) + piece[5:]
            elif chance < 0.015 and framing in ("cobs", "slcan"):
                piece += piece
            if k == 900:
                kept.link(up=False)
            if k == 930:
                kept.link(up=True)
            cut = draw.randrange(len(piece) + 1)
            stamp = 1.7e9 + k / RATE
            kept.push_bytes(piece[:cut], stamp)
            kept.push_bytes(piece[cut:], stamp + 2e-4)
        result = kept.finish()
        ours, rows, counts = kept.events(), rows_of(kept), kept.counts["n"]
    assert result is not None
    gaps = [event for event in ours if event["type"] == "gap"]
    assert {"link_down"} <= {gap["cause"] for gap in gaps}
    assert counts.more["damaged"] > 3
    (journal,) = (tmp_path / "runs").glob("*.okj")
    done = okid("replay", journal, "--events", tmp_path / "p.jsonl")
    assert done.returncode == 0, done.stderr
    theirs = [json.loads(line) for line in (tmp_path / "p.jsonl").read_text().splitlines()]
    assert [event for event in theirs if event["type"] in ("gap", "modes")] == [
        event for event in ours if event["type"] in ("gap", "modes")
    ]
    assert theirs[-1]["result"] == json.loads(json.dumps(result))
    printed = table(journal, config)
    assert written(rows, printed) == printed


@pytest.mark.parametrize("framing", [name for name in LINES if name != "slcan"])
def test_a_file_of_bytes_has_every_sample_in_its_place(framing: str, tmp_path: Path) -> None:
    """Nobody stamped them: the device's clock or the order does."""
    (tmp_path / "c.toml").write_text(line_config(framing, tmp_path))
    rows = signals(600)
    (tmp_path / "run.bin").write_bytes(b"".join(LINES[framing](k, row) for k, row in enumerate(rows.tolist())))
    with (tmp_path / "run.bin").open("rb") as file:
        found = np.vstack(list(capture.serial_blocks(file, tmp_path / "c.toml")))
    scale = 0.5 * (16 / 32768 * 9.80665 if framing == "witmotion" else 1.0)  # the device tells g
    first = len(rows) - len(found)
    assert first <= 1  # the first line may be torn
    assert np.allclose(found, rows[first:] * scale, atol=1e-9)


def test_a_controller_and_a_source_that_lose_frames(tmp_path: Path) -> None:
    """Error messages are counted, losses that the source counted become the causes of the gaps."""
    (tmp_path / "c.toml").write_text(counted_config())
    sent = [one for one in map(message, frames())]
    with capture.Capture(tmp_path / "c.toml", identify=False) as kept:
        kept.push(sent[:1000])
        kept.lost(socket_overflow=20)
        kept.push(sent[1020:2000])
        kept.lost(socket_overflow=20, driver=10)
        kept.push(sent[2010:3000])
        kept.link(up=False)
        kept.link(up=True)
        kept.push(sent[3100:4000])
        kept.push([can.Message(timestamp=1.7e9 + 10, arbitration_id=4, is_error_frame=True, dlc=8, data=bytes(8))])
        kept.push([can.Message(timestamp=1.7e9 + 10, arbitration_id=0x100, is_extended_id=False, is_remote_frame=True)])
        kept.finish()
        gaps = [event for event in kept.events() if event["type"] == "gap"]
        counts = kept.counts["can0"]
    assert {gap["cause"] for gap in gaps} == {"socket_overflow", "driver", "link_down"}
    assert counts.lost == {"socket_overflow": 20, "driver": 10, "link_down": 100}
    assert counts.more["error_frames"] == 1
    assert counts.received == 1000 + 980 + 990 + 900


def message(line: str) -> can.Message:
    stamp, _, body = line.split(" ")
    can_id, data = body.split("#")
    return can.Message(float(stamp[1:-1]), int(can_id, 16), is_extended_id=False, data=bytes.fromhex(data))


def test_a_limit_of_samples_and_a_finished_capture(tmp_path: Path) -> None:
    (tmp_path / "c.toml").write_text(counted_config())
    sent = list(map(message, frames()))
    with capture.Capture(tmp_path / "c.toml", identify=False, duration=777 / RATE) as kept:
        kept.push(sent)
        assert kept.done
        kept.finish()
        assert len(rows_of(kept)) == 777
        with pytest.raises(okid_package.InputError, match="has been finished"):
            kept.push(sent[:1])
    with (
        capture.Capture(tmp_path / "c.toml") as kept,
        pytest.raises(okid_package.InputError, match="there is no bus 1"),
    ):
        kept.link(up=False, bus=1)


LAYOUT = """#include <okid_host/capture.h>
#include <stddef.h>
#include <stdio.h>
int main(void) {
    printf("%zu %zu %zu", sizeof(drv_frame_t), offsetof(drv_frame_t, id), offsetof(drv_frame_t, data));
    printf(" %zu %zu", sizeof(okid_host_capture_options_t), offsetof(okid_host_capture_options_t, trigger_ns));
    printf(" %zu %zu", sizeof(okid_host_rows_t), offsetof(okid_host_rows_t, rows));
    return 0;
}
"""


def test_the_header_is_plain_c_and_python_has_its_layout(tmp_path: Path) -> None:
    (tmp_path / "layout.c").write_text(LAYOUT)
    root = Path(__file__).resolve().parents[2]
    where = [f"-I{root}/firmware_host/include", f"-I{root}/drivers/include"]
    strict = ["-std=c99", "-Wall", "-Wextra", "-Wpedantic", "-Werror"]
    subprocess.run(["cc", *strict, *where, tmp_path / "layout.c", "-o", tmp_path / "layout"], check=True)
    shown = subprocess.run([tmp_path / "layout"], check=True, capture_output=True, text=True).stdout
    frame, options, rows = stream.FRAME, stream._Options, stream._Rows
    assert list(map(int, shown.split())) == [
        frame.itemsize, frame.fields["id"][1], frame.fields["data"][1], ctypes.sizeof(options),
        options.trigger_ns.offset, ctypes.sizeof(rows), rows.rows.offset,
    ]  # fmt: skip
