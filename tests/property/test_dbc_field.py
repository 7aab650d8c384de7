# SPDX-License-Identifier: MIT
"""DBC and J1939 files as tools of the field write them, odd lines included: what each costs, and what messages advise.
The frames are packed here by struct, by the printed layout; nothing is shared with the program's codec."""

from __future__ import annotations

import struct
from pathlib import Path

import pytest
from program import okid

HEAD = """VERSION "HNPBNNNYNNNNNNNNNNNNNNNNYNYYYYYYYY>4YYYYYYYYYNNNNNNNNNNYNNNNNNNNNNNNNNNNNNN/4/%%%/4/'%**4YYY///"


NS_ :
\tNS_DESC_
\tCM_
\tBA_DEF_
\tBA_
\tSIG_VALTYPE_

BS_:

BU_: Inclino_Front Inclino_Rear Logger

"""
GOOD = """BO_ 256 LoadCell: 8 Inclino_Front
 SG_ Force : 7|16@0- (0.1,0) [-3276.8|3276.7] "N"  Logger
 SG_ Acc : 23|16@0- (0.01,0) [-327.68|327.67] "m/s^2"  Logger

"""
TAIL = """

CM_ "Exported 2019-03-04, rig 7;
 SG_ of the old sheet: do not use";
CM_ SG_ 256 Force "load cell, \\"new\\" amplifier";
BA_DEF_ BO_  "GenMsgCycleTime" INT 0 65535;
BA_DEF_ BO_  "VFrameFormat" ENUM  "StandardCAN","ExtendedCAN","reserved","J1939PG";
BA_DEF_  "ProtocolType" STRING ;
BA_DEF_DEF_  "GenMsgCycleTime" 0;
BA_DEF_DEF_  "VFrameFormat" "StandardCAN";
BA_DEF_DEF_  "ProtocolType" "";
BA_ "ProtocolType" "J1939";
BA_ "GenMsgCycleTime" BO_ 256 10;
"""
ACCEL, RATE = 0xF02D, 100


def accelerations(name: str, address: int, length: int = 8) -> str:
    """A message of the parameter group ACCEL from one address: three 16-bit words, 0.01 m/s^2 a bit, offset -320."""
    signals = "".join(
        f' SG_ {axis} : {16 * k}|16@1+ (0.01,-320) [-320|335.35] "m/s^2"  Logger\n' for k, axis in enumerate("XYZ")
    )
    return f"BO_ {0x98000000 | ACCEL << 8 | address} {name}: {length} Inclino_Front\n{signals}\n"


def config(folder: Path, dbc: str, channels: list[str], more: str = "") -> Path:
    (folder / "a.dbc").write_text(HEAD + dbc + TAIL + more)
    text = f'[acquisition]\nrate_hz = {RATE}\n[[bus]]\nname = "b"\ninterface = "can0"\ndbc = "a.dbc"\n'
    for k, channel in enumerate(channels):
        message, signal, *extra = channel.split()
        text += f'[[channel]]\nname = "c{k}"\nrole = "acceleration"\nmessage = "{message}"\nsignal = "{signal}"\n'
        text += "".join(f"{each}\n" for each in extra)
    path = folder / "a.toml"
    path.write_text(text)
    return path


def log(folder: Path, senders: list[int], count: int = 400) -> Path:
    """Each sender once a sample: sender s sends s + 0.01 n, 0, 0 m/s^2."""
    lines = []
    for n in range(count):
        for k, sender in enumerate(senders):
            word = round((sender + 0.01 * n + 320) / 0.01)
            data = struct.pack("<HHHH", word, 32000, 32000, 0xFFFF).hex().upper()
            lines.append(f"({1e9 + n / RATE + 0.0003 * k:.6f}) can0 18{ACCEL:04X}{sender:02X}#{data}\n")
    path = folder / "a.log"
    path.write_text("".join(lines))
    return path


def columns(folder: Path) -> list[list[float]]:
    okid("convert", folder / "a.log", folder / "a.csv", "-c", folder / "a.toml", status=0)
    rows = [line.split(",") for line in (folder / "a.csv").read_text().splitlines() if not line.startswith("#")][1:]
    return [[float(row[k]) for row in rows] for k in range(len(rows[0]))]


J1939 = "".join(f'BA_ "VFrameFormat" BO_ {0x98000000 | ACCEL << 8 | sender} 3;\n' for sender in (0x21, 0x22, 0xFE))


def test_two_senders_of_one_group_are_two_sensors(tmp_path: Path) -> None:
    """Release 0.1 gave each channel the samples of both."""
    both = accelerations("Front", 0x21) + accelerations("Rear", 0x22)
    config(tmp_path, both, ["Front X", "Rear X"], J1939)
    log(tmp_path, [0x21, 0x22])
    front, rear = columns(tmp_path)
    assert front == pytest.approx([0x21 + 0.01 * n for n in range(400)], abs=1e-9)
    assert rear == pytest.approx([0x22 + 0.01 * n for n in range(400)], abs=1e-9)


def test_a_group_without_an_address_takes_the_other_senders(tmp_path: Path) -> None:
    both = accelerations("Front", 0x21) + accelerations("Any", 0xFE)
    config(tmp_path, both, ["Front X", "Any X"], J1939)
    log(tmp_path, [0x21, 0x35])
    front, other = columns(tmp_path)
    assert (front[7], other[7]) == (pytest.approx(0x21 + 0.07), pytest.approx(0x35 + 0.07))


def test_the_key_in_the_config_comes_before_the_dbc(tmp_path: Path) -> None:
    both = accelerations("Front", 0x21) + accelerations("Rear", 0x22)
    config(tmp_path, both, ["Front X source_address=0x35"], J1939)
    log(tmp_path, [0x21, 0x35])
    (only,) = columns(tmp_path)
    assert only[3] == pytest.approx(0x35 + 0.03)


def test_a_second_sender_is_named(tmp_path: Path) -> None:
    """One message, no source_address: release 0.1 mixed both sensors without a word."""
    path = config(tmp_path, accelerations("Front", 0x21), ["Front X"], J1939 + "")
    path.write_text(path.read_text() + "[identification]\np = 4\n")
    done = okid("replay", log(tmp_path, [0x21, 0x35]), "-c", path)
    named = 'parameter group 61485 of "c0" is sent by the addresses 0x21, 0x35'
    assert named in done.stderr and "source_address" in done.stderr, done.stderr
    assert named not in okid("replay", log(tmp_path, [0x21]), "-c", path).stderr


@pytest.mark.parametrize(
    ("lines", "message", "why"),
    [
        ('BO_ 418119423 EEC1: 8 Logger\n SG_ S : 0|8@1+ (1,0) [0|0] ""  Logger\n', "EEC1", "written 2565603071"),
        (
            'BO_ 300 Page: 8 Logger\n SG_ Sel M : 0|8@1+ (1,0) [0|3] ""  Logger\n'
            ' SG_ S m : 8|8@1- (1,0) [0|0] ""  Logger\n', "Page", "M, m<number> or ':'",
        ),
        ('BO_ 300 Page: 8 Logger\n SG_ S : 0|8@1+ (n.a.,0) [0|0] ""  Logger\n', "Page", "the factor, a number"),
        ('BO_ 300 Page: eight Logger\n SG_ S : 0|8@1+ (1,0) [0|0] ""  Logger\n', "Page", "the length of the message"),
        (
            'BO_ 300 Page: 8 Logger\n SG_ S : 0|32@1- (1,0) [0|0] ""  Logger\n\nSIG_VALTYPE_ 300 S : 9;\n',
            "Page", "the value type",
        ),
    ],
)  # fmt: skip
@pytest.mark.parametrize("first", [True, False])
def test_a_line_costs_its_message_and_no_more(tmp_path: Path, lines: str, message: str, why: str, first: bool) -> None:
    """Release 0.1 refused the whole file."""
    path = config(tmp_path, lines + GOOD if first else GOOD + lines, ["LoadCell Acc"])
    done = okid("check", path, status=0)
    (told,) = [line for line in done.stdout.splitlines() if "a.dbc" in line]
    assert why in told and told.endswith(f"message {message} is left out"), told
    assert "a.dbc: line " in told
    path.write_text(path.read_text().replace('"LoadCell"', f'"{message}"').replace('"Acc"', '"S"'))
    wrong = okid("check", path, status=2).stderr
    assert wrong.count("\n") == 1 and why in wrong and f"message {message} cannot be used" in wrong, wrong


def test_a_maximum_beyond_any_number_is_not_used(tmp_path: Path) -> None:
    absurd = GOOD.replace("3276.7]", "1.7976931348623158E+309]")
    done = okid("check", config(tmp_path, absurd, ["LoadCell Force", "LoadCell Acc"]), status=0)
    assert "the range of signal Force is beyond any number; it is not used" in done.stdout


def test_many_bad_lines_are_told_in_few(tmp_path: Path) -> None:
    bad = "".join(f"BO_ {70000 + k} Old{k}: 8 Logger\n\n" for k in range(200))
    told = okid("check", config(tmp_path, bad + GOOD, ["LoadCell Acc"]), status=0).stdout
    assert told.count("a.dbc") == 5 and "196 more lines could not be read" in told


def test_nothing_left_is_refused_by_the_first_line(tmp_path: Path) -> None:
    bad = 'BO_ 418119423 EEC1: 8 Logger\n SG_ S : 0|8@1+ (1,0) [0|0] ""  Logger\n'
    wrong = okid("check", config(tmp_path, bad, ["EEC1 S"]), status=2).stderr
    assert "written 2565603071" in wrong and wrong.count("\n") == 1, wrong


@pytest.mark.parametrize(
    ("length", "marked", "advice", "not_advised"),
    [
        (20, True, "a transport protocol sends it in pieces", "fd = true"),
        (200, False, "no CAN frame has", "fd = true"),
        (20, False, "write fd = true", "transport protocol"),
    ],
)
def test_long_messages(tmp_path: Path, length: int, marked: bool, advice: str, not_advised: str) -> None:
    """Release 0.1 advised fd = true for all of them; J1939 and anything beyond 64 bytes has none of it."""
    path = config(tmp_path, accelerations("Front", 0x21, length), ["Front X"], J1939 if marked else "")
    wrong = okid("check", path, status=2).stderr
    assert advice in wrong and not_advised not in wrong, wrong


def test_a_sender_of_a_message_that_is_no_group(tmp_path: Path) -> None:
    wrong = okid(
        "check", config(tmp_path, accelerations("Front", 0x21), ["Front X source_address=33"]), status=2
    ).stderr
    assert "leave the key out" in wrong and "0x18f02d21" in wrong, wrong


def test_a_group_that_is_not_marked(tmp_path: Path) -> None:
    """The identifier of the file (address 254) never comes: what came is told, and what to write."""
    path = config(tmp_path, accelerations("Front", 0xFE), ["Front X"])
    path.write_text(path.read_text() + "[identification]\np = 4\n")
    wrong = okid("replay", log(tmp_path, [0x21]), "-c", path, status=3).stderr
    assert "0x18f02d21" in wrong and "pgn = 61485" in wrong, wrong
