# SPDX-License-Identifier: MIT
"""Every preset on a log made by us and the samples it must give; J1939 is checked with cantools too.

The logs are frames as the makers' documents describe them, no recordings of devices.
"""

from __future__ import annotations

import binascii
import math
import random
import struct
from pathlib import Path

import cantools
import program
import pytest
from lines import Run, line, of_type, witmotion

ROOT = Path(__file__).resolve().parents[2]
RATE = 100
IMC_BIG = "can_id = 0x123\nstart_bit = 55\nbyte_order = 'big'"

# preset, keys a user adds, frames (identifier and data of each sample), samples expected
CASES = [
    ("gsv4.1", "", ["610#8000FFFF00008001", "610#0000800080008000"], [0.0, -1.0]),
    ("gsv4.2", "", ["610#8000FFFF00008001", "610#0000800080008000"], [32767 / 32768, 0.0]),
    ("gsv4.3", "scale = 0.5\nunit = 'N'", ["610#8000FFFF00008001", "610#0000800080028000"], [-16384.0, 1.0]),
    ("gsv4.4", "can_id = 0x620", ["620#8000FFFF00008001", "620#0000800080008000"], [1 / 32768, 0.0]),
    ("cia404.float32", "", ["281#0000C0BFD204", "281#DB0F49402EFB"], [-1.5, 3.1415927410125732]),
    ("cia404.adc16", "", ["281#0000C0BFD204", "281#DB0F49402EFB"], [1234.0, -1234.0]),
    ("cia404.int32", "can_id = 0x385\nscale = 0.001", ["385#40E20100", "385#C01DFEFF"], [123.456, -123.456]),
    ("j1939-accel.x", "", ["0CF02D80#007D64819C7AFF00", "18F02D0B#FFFF00000000FF00"], [0.0, 335.35]),
    ("j1939-accel.y", "", ["0CF02D80#007D64819C7AFF00", "18F02D0B#FFFF00000000FF00"], [11.24, -320.0]),
    ("j1939-accel.z", "", ["0CF02D80#007D64819C7AFF00", "18F02D0B#FFFF00000000FF00"], [-6.12, -320.0]),
    ("imc.int16-1", "can_id = 0x123", ["123#0180FF7F00000100", "123#0000000000000000"], [-32767.0, 0.0]),
    ("imc.int16-2", "can_id = 0x123", ["123#0180FF7F00000100", "123#0000000000000000"], [32767.0, 0.0]),
    ("imc.int16-3", "can_id = 0x123", ["123#0180FF7F00010100", "123#0000000000000000"], [256.0, 0.0]),
    ("imc.int16-4", IMC_BIG, ["123#0180FF7F00000100", "123#0000000000000001"], [256.0, 1.0]),
    ("imc.int24-1", "can_id = 0x123", ["123#010080FFFF7F0000", "123#0000010000000000"], [-8388607.0, 65536.0]),
    ("imc.int24-2", "can_id = 0x123", ["123#010080FFFF7F0000", "123#0000010000000000"], [8388607.0, 0.0]),
    ("imc.float32-1", "can_id = 0x123", ["123#0000803F000000C0", "123#00000000000000BF"], [1.0, 0.0]),
    ("imc.float32-2", "can_id = 0x123", ["123#0000803F000000C0", "123#00000000000000BF"], [-2.0, -0.5]),
]  # fmt: skip

HEAD = f'[acquisition]\nrate_hz = {RATE}\n[[bus]]\nname = "b"\ninterface = "can0"\n'


def decoded(folder: Path, channel: str, frames: list[str], bus: str = "") -> list[float]:
    """What okid makes of the frames, one a sample."""
    text = HEAD + bus + f'[[channel]]\nname = "c"\nrole = "acceleration"\n{channel}\n'
    (folder / "a.toml").write_text(text)
    (folder / "a.log").write_text("".join(f"({n / RATE:.6f}) can0 {frame}\n" for n, frame in enumerate(frames)))
    done = program.okid("convert", folder / "a.log", folder / "a.csv", "-c", folder / "a.toml")
    assert done.returncode == 0, done.stderr
    return [float(row) for row in (folder / "a.csv").read_text().splitlines()[3:]]


@pytest.mark.parametrize(("preset", "keys", "frames", "expected"), CASES, ids=[case[0] for case in CASES])
def test_samples_of_a_preset(tmp_path: Path, preset: str, keys: str, frames: list[str], expected: list[float]) -> None:
    assert decoded(tmp_path, f'preset = "{preset}"\n{keys}', frames) == pytest.approx(expected, rel=1e-9, abs=1e-12)


def test_every_preset_is_tested() -> None:
    found = set()
    for file in (ROOT / "drivers" / "presets").glob("*.toml"):
        for row in file.read_text().splitlines():
            if row.startswith("[channel."):
                found.add(f"{file.stem}.{row[9:-1]}")
    assert found - {case[0] for case in CASES} == {f"{s}.{axis}" for s in ("wt901", "vn100") for axis in "xyz"}


def test_j1939_acceleration_is_that_of_cantools(tmp_path: Path) -> None:
    text = f'VERSION ""\nBU_: X\nBO_ {0x80000000 | 0x0CF02DFE} ARI: 8 X\n'
    for i, axis in enumerate("xyz"):
        text += f' SG_ {axis} : {16 * i}|16@1+ (0.01,-320) [0|0] "m/s^2" X\n'
    database = cantools.database.load_string(text, "dbc")
    for case in [case for case in CASES if case[0].startswith("j1939")]:
        frames = [bytes.fromhex(frame.partition("#")[2]) for frame in case[2]]
        wanted = [float(database.messages[0].decode(frame)[case[0][-1]]) for frame in frames]
        assert case[3] == pytest.approx(wanted, abs=1e-9)


J1939 = """VERSION ""
BU_: X
BO_ {a} Broadcast: 8 X
 SG_ Level : 0|16@1+ (0.5,-100) [0|0] "N" X
BO_ {b} ToOne: 8 X
 SG_ Level : 8|16@0- (1,0) [0|0] "N" X
BA_DEF_ BO_ "VFrameFormat" ENUM "StandardCAN","ExtendedCAN","reserved","J1939PG";
BA_DEF_DEF_ "VFrameFormat" "{default}";
{told}
"""


@pytest.mark.parametrize("by_default", [True, False])
def test_a_j1939_dbc_matches_by_group(tmp_path: Path, by_default: bool) -> None:
    a, b = 0x80000000 | 0x18FF12FE, 0x80000000 | 0x18EF00FE
    told = "" if by_default else f'BA_ "VFrameFormat" BO_ {a} 3;\nBA_ "VFrameFormat" BO_ {b} 3;'
    default = "J1939PG" if by_default else "ExtendedCAN"
    text = J1939.format(a=a, b=b, told=told, default=default)
    (tmp_path / "a.dbc").write_text(text)
    database = cantools.database.load_string(text, "dbc")
    assert all(message.protocol == "j1939" for message in database.messages)
    bus = 'dbc = "a.dbc"\n'
    frames = ["0CFF1203#1027000000000000", "18FF1299#E803000000000000", "1CFF1303#0000000000000000"]
    want = [float(database.messages[0].decode(bytes.fromhex(f.partition("#")[2]))["Level"]) for f in frames[:2]]
    channel = 'message = "Broadcast"\nsignal = "Level"'
    assert decoded(tmp_path, channel, frames, bus) == pytest.approx(want)
    only = decoded(tmp_path, channel + "\nsource_address = 0x99", frames, bus)
    assert only == pytest.approx(want[1:])
    # PDU1: the destination is no part of the group.
    frames = ["18EF2101#00FFFE0000000000", "18EF4502#0000050000000000"]
    want = [float(database.messages[1].decode(bytes.fromhex(f.partition("#")[2]))["Level"]) for f in frames]
    assert decoded(tmp_path, 'message = "ToOne"\nsignal = "Level"', frames, bus) == pytest.approx(want)


def test_a_strict_identifier_comes_before_a_group(tmp_path: Path) -> None:
    text = HEAD + (
        '[[channel]]\nname = "all"\nrole = "force"\npgn = 65298\nstart_bit = 0\nlength = 8\n'
        '[[channel]]\nname = "one"\nrole = "acceleration"\ncan_id = 0x18FF1203\nstart_bit = 0\nlength = 8\n'
    )
    (tmp_path / "a.toml").write_text(text)
    rows = [
        f"({n / RATE:.6f}) can0 18FF1203#{n:02X}\n({n / RATE + 0.001:.6f}) can0 18FF1204#{n + 100:02X}\n"
        for n in range(9)
    ]
    (tmp_path / "a.log").write_text("".join(rows))
    done = program.okid("convert", tmp_path / "a.log", tmp_path / "a.csv", "-c", tmp_path / "a.toml")
    assert done.returncode == 0, done.stderr
    assert (tmp_path / "a.csv").read_text().splitlines()[3:] == [f"{n + 100},{n}" for n in range(9)]


@pytest.mark.parametrize(
    ("channel", "expected"),
    [
        ('preset = "gsv5.1"', 'line 9, [[channel]] "c", key "preset": found "gsv5.1" (did you mean "gsv4.1"?)'),
        ('preset = "gsv4"', "expected one of: cia404."),
        ("preset = 4", "found 4, expected text in quotes"),
        ('preset = "imc.int16-1"', '"can_id" is missing'),
        ("pgn = 0xEF21\nstart_bit = 0\nlength = 8", "found 61217, expected 61184"),
        ("pgn = 65298\ncan_id = 1\nstart_bit = 0\nlength = 8", "either can_id or pgn"),
        ("can_id = 1\nsource_address = 1\nstart_bit = 0\nlength = 8", "it needs pgn beside it"),
        ("field = 0", "only a serial bus has fields"),
        ('preset = "gsv4.1"\nlength = 60\nvalue = "float64"', 'from the preset, [[channel]] "c", key "start_bit"'),
    ],
)
def test_what_is_refused(tmp_path: Path, channel: str, expected: str) -> None:
    (tmp_path / "a.toml").write_text(HEAD + f'[[channel]]\nname = "c"\nrole = "acceleration"\n{channel}\n')
    done = program.okid("check", tmp_path / "a.toml")
    assert done.returncode == 2
    assert expected in done.stderr, done.stderr


def vectornav(n: int, x: float, y: float, z: float) -> bytes:
    body = b"\x01\x01\x01" + struct.pack("<Qfff", n * 10_000_000, x, y, z)  # TimeStartup and Accel of the common group
    return b"\xfa" + body + binascii.crc_hqx(body, 0).to_bytes(2, "big")


@pytest.mark.parametrize("preset", ["wt901", "vn100"])
def test_serial_presets_through_a_line(tmp_path: Path, preset: str) -> None:
    """A swing through the device's packets: the preset makes bus and channels, the unit becomes m/s^2."""
    device, config = tmp_path / "sensor", tmp_path / "a.toml"
    text = f'[acquisition]\nrate_hz = {RATE}\n[[bus]]\nname = "s"\npreset = "{preset}"\ndevice = "{device}"\n'
    for axis in "xyz":
        text += f'[[channel]]\nname = "{axis}"\npreset = "{preset}.{axis}"\ndof = 1\n'
    config.write_text(
        text + '[identification]\nmethod = "n4sid-cva"\nrows = 10\norder = 2\nupdate_s = 10.0\nsigma_blocks = 0\n'
    )
    done = program.okid("check", config)
    assert done.returncode == 0, done.stderr
    draw, radius, angle = random.Random(8), math.exp(-0.01 * 2 * math.pi * 7.0 / RATE), 2 * math.pi * 7.0 / RATE
    swing = [0.0, 0.0]  # of a structure with 7 Hz and 1 % in the wind
    with line(device) as ours:
        run = Run(config, "--duration", 40.0)
        for n in range(40 * RATE):
            swing = [2 * radius * math.cos(angle) * swing[0] - radius**2 * swing[1] + draw.gauss(0, 0.05), swing[0]]
            values = [swing[0], 0.5 * swing[1] + draw.gauss(0, 0.01), 1 + draw.gauss(0, 0.01)]
            if preset == "wt901":
                ours.write(witmotion(*(round(v / 16 * 32768) for v in values)))
            else:
                ours.write(vectornav(n, *(9.80665 * v for v in values)))
        events = run.finish()
    # Fed far faster than the sensor would: nothing counts here, so where this test pauses samples seem to be lost.
    stats = of_type(events, "stats")[-1]
    assert stats["channel"]["z"]["expected"] == 40 * RATE
    assert stats["channel"]["z"]["completeness_percent"] > 99
    bus = stats["bus"]["s"]
    assert bus["decode_errors"] == 0 and bus["received"] >= stats["channel"]["z"]["received"]
    assert bus["lost"] == stats["channel"]["z"]["missing"]
    assert events[-1]["result"]["modes"][0]["frequency_hz"] == pytest.approx(7.0, abs=0.1)


def test_presets_are_listed() -> None:
    """A line for each with its channels; every name in it can be asked for."""
    done = program.okid("check", "--presets")
    assert done.returncode == 0, done.stderr
    lines = done.stdout.splitlines()
    names = sorted(path.stem for path in (ROOT / "drivers" / "presets").glob("*.toml"))
    assert [line.split()[0] for line in lines[::2]] == names
    assert all(len(line.split(maxsplit=1)[1]) > 15 for line in lines[::2]), done.stdout
    named = [name for line in lines[1::2] for name in line.partition("channels: ")[2].split(", ")]
    assert {case[0] for case in CASES} <= set(named)
    assert any("bus: wt901;" in line for line in lines)


def test_unknown_preset_tells_which_there_are(tmp_path: Path) -> None:
    text = HEAD + '[[channel]]\nname = "c"\nrole = "force"\npreset = "gsv4.5"\n'
    (tmp_path / "a.toml").write_text(text)
    done = program.okid("check", tmp_path / "a.toml")
    assert done.returncode == 2
    for piece in ("gsv4.1", "imc.int16-1", "did you mean", "okid check --presets"):
        assert piece in done.stderr, done.stderr
    done = program.okid("check")
    assert done.returncode == 2 and "the file to check is missing" in done.stderr
