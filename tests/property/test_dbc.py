# SPDX-License-Identifier: MIT
"""Random DBC files and random frames: okid decodes what cantools decodes, and refuses damaged lines by name."""

from __future__ import annotations

import json
import math
import subprocess
from pathlib import Path

import cantools
import program
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

ROOT = Path(__file__).parents[2]
RATE = 100


def okid(*args: str, status: int = 0) -> subprocess.CompletedProcess[str]:
    return program.okid(*args, status=status)


@st.composite
def layouts(draw: st.DrawFn) -> dict:
    """One message of up to four signals that may overlap nothing: each owns its own bytes."""
    extended = draw(st.booleans())
    signals, first = [], 2
    multiplexed = draw(st.booleans())
    for index in range(draw(st.integers(1, 4))):
        kind = draw(st.sampled_from(["integer", "integer", "float32", "float64"]))
        length = {"float32": 32, "float64": 64}.get(kind) or draw(st.integers(1, 64))
        offset_in_byte = 0 if kind != "integer" else draw(st.integers(0, 7))
        size = (offset_in_byte + length + 7) // 8
        if first + size > 64:
            break
        big = draw(st.booleans())
        start = first * 8 + 7 - offset_in_byte if big else first * 8 + offset_in_byte
        scale = draw(st.sampled_from([1, 0.5, 0.01, -2, 1e-6, 9.80665]))
        signals.append(
            {
                "name": f"S{index}",
                "start": start,
                "length": length,
                "big": big,
                "signed": draw(st.booleans()),
                "kind": kind,
                "scale": scale,
                "offset": draw(st.sampled_from([0, -320, 0.25])),
                "page": index % 2 if multiplexed else None,
            }
        )
        first += size
    size = next(n for n in (8, 12, 16, 20, 24, 32, 48, 64) if n >= first)
    return {
        "id": draw(st.integers(0, 0x1FFFFFFF if extended else 0x7FF)),
        "extended": extended,
        "size": size,
        "signals": signals,
        "multiplexed": multiplexed,
    }


def dbc_text(layout: dict) -> str:
    number = layout["id"] | (0x80000000 if layout["extended"] else 0)
    lines = ['VERSION ""', "NS_ :", "BS_:", "BU_: X", "", f"BO_ {number} Message: {layout['size']} X"]
    lines.append(f' SG_ Page {"M " if layout["multiplexed"] else ""}: 0|8@1+ (1,0) [0|0] "" X')
    for s in layout["signals"]:
        page = f"m{s['page']} " if s["page"] is not None else ""
        sign = "-" if s["signed"] or s["kind"] != "integer" else "+"
        lines.append(
            f' SG_ {s["name"]} {page}: {s["start"]}|{s["length"]}@{0 if s["big"] else 1}{sign} '
            f'({s["scale"]},{s["offset"]}) [0|0] "m/s^2" X'
        )
    lines += ["", f'CM_ BO_ {number} "a comment over', ' SG_ two lines";', 'BA_DEF_ BO_ "Cycle" INT 0 1;']
    for s in layout["signals"]:
        if s["kind"] != "integer":
            lines.append(f'SIG_VALTYPE_ {number} {s["name"]} : {1 if s["kind"] == "float32" else 2};')
    return "\n".join(lines) + "\n"


def config_text(layout: dict) -> str:
    text = f'[acquisition]\nrate_hz = {RATE}\n[[bus]]\nname = "b"\ninterface = "can0"\nfd = true\ndbc = "a.dbc"\n'
    for i, s in enumerate(layout["signals"]):
        role = "force" if i == 0 else "acceleration"
        text += f'[[channel]]\nname = "{s["name"]}"\nrole = "{role}"\nmessage = "Message"\nsignal = "{s["name"]}"\n'
    return text


@settings(
    max_examples=60, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture, HealthCheck.too_slow]
)
@given(layout=layouts(), data=st.data())
def test_decodes_as_cantools(tmp_path: Path, layout: dict, data: st.DataObject) -> None:
    text = dbc_text(layout)
    newline = data.draw(st.sampled_from(["\n", "\r\n"]))
    mark = data.draw(st.sampled_from([b"", b"\xef\xbb\xbf"]))
    (tmp_path / "a.dbc").write_bytes(mark + text.replace("\n", newline).encode())
    (tmp_path / "a.toml").write_text(config_text(layout))
    message = cantools.database.load_string(text, "dbc").messages[0]
    frames = [bytearray(data.draw(st.binary(min_size=layout["size"], max_size=layout["size"]))) for _ in range(6)]
    identifier = f"{layout['id']:08X}" if layout["extended"] else f"{layout['id']:03X}"
    mark_fd = "##0" if layout["size"] > 8 else "#"
    pages = len({s["page"] for s in layout["signals"]})
    lines = []
    for n, frame in enumerate(frames):
        if layout["multiplexed"]:
            frame[0] = n % pages
        lines.append(f"({n // pages / RATE:.6f}) can0 {identifier}{mark_fd}{frame.hex().upper()}\n")
    (tmp_path / "a.log").write_text("".join(lines))
    expected: dict[str, list[float]] = {s["name"]: [] for s in layout["signals"]}
    for frame in frames:
        for name, value in message.decode(bytes(frame), decode_choices=False).items():
            if name in expected:
                expected[name].append(float(value))
    if any(not math.isfinite(v) for values in expected.values() for v in values):
        return  # such a frame is refused as a whole, which test_grid covers
    okid("convert", str(tmp_path / "a.log"), str(tmp_path / "a.csv"), "-c", str(tmp_path / "a.toml"))
    rows = [line for line in (tmp_path / "a.csv").read_text().splitlines() if not line.startswith("#")]
    names = rows[0].split(",")
    got = {name: [float(row.split(",")[i]) for row in rows[1:]] for i, name in enumerate(names)}
    for name, values in expected.items():
        assert len(values) == len(got[name])
        for a, b in zip(values, got[name], strict=True):
            assert math.isclose(a, b, rel_tol=1e-9, abs_tol=1e-12 * max(1.0, abs(a))), (name, a, b)


def test_okid_dbc_is_read_whole(tmp_path: Path) -> None:
    database = cantools.database.load_file(ROOT / "drivers" / "proto" / "okid.dbc")
    text = '[acquisition]\nrate_hz = 1000\n[[bus]]\nname = "b"\ninterface = "can0"\n'
    text += f'dbc = "{ROOT / "drivers" / "proto" / "okid.dbc"}"\n'
    wanted = {}
    for message in database.messages:
        for signal in message.signals:
            if signal.name == "Counter":
                continue
            role = "force" if "Force" in signal.name else "acceleration" if "Accel" in signal.name else "aux"
            text += f'[[channel]]\nname = "{signal.name}"\nrole = "{role}"\n'
            text += f'message = "{message.name}"\nsignal = "{signal.name}"\n'
            text += 'sequence = "Counter"\n'
            wanted[signal.name] = (
                message.frame_id,
                signal.start,
                signal.length,
                signal.is_signed,
                float(signal.scale),
                float(signal.offset),
            )
    (tmp_path / "all.toml").write_text(text + "[identification]\np = 4\n")
    found = json.loads(okid("check", str(tmp_path / "all.toml"), "--json").stdout)
    assert {
        c["name"]: (c["can_id"], c["start_bit"], c["length"], c["signed"], c["scale"], c["offset"])
        for c in found["channels"]
    } == wanted
    assert all(c["sequence"] == found["channels"][0]["sequence"] for c in found["channels"])


@pytest.mark.parametrize(
    ("line", "column", "expected"),
    [
        ("BO_ x Message: 8 X", 5, "the identifier of the message"),
        ("BO_ 1 : 8 X", 7, "the name of the message"),
        ("BO_ 1 Message 8 X", 15, "':' after the name of the message"),
        ("BO_ 4096 Message: 8 X", 5, "an identifier of 11 bits"),
        ('BO_ 1 M: 8 X\n SG_ S : 0-8@1+ (1,0) [0|0] "" X', 11, "'|' after the start bit"),
        ('BO_ 1 M: 8 X\n SG_ S : 0|8@2+ (1,0) [0|0] "" X', 14, "(byte order)"),
        ('BO_ 1 M: 8 X\n SG_ S : 0|8@1 (1,0) [0|0] "" X', 16, "(sign)"),
        ('BO_ 1 M: 8 X\n SG_ S : 0|8@1+ (x,0) [0|0] "" X', 18, "the factor, a number"),
        ('BO_ 1 M: 8 X\n SG_ S : 0|8@1+ (1,0) [0|0] "', 30, "'\"' after the unit"),
        ('BO_ 1 M: 8 X\n SG_ S mx : 0|8@1+ (1,0) [0|0] "" X', 8, "M, m<number>"),
        (' SG_ S : 0|8@1+ (1,0) [0|0] "" X', 5, "a message (BO_) before its first signal"),
    ],
)
def test_damaged_lines_are_named(tmp_path: Path, line: str, column: int, expected: str) -> None:
    (tmp_path / "a.dbc").write_text('VERSION ""\n' + line + "\n")
    (tmp_path / "a.toml").write_text(config_text({"signals": [{"name": "S"}]}))
    message = okid("check", str(tmp_path / "a.toml"), status=2).stderr
    assert f"a.dbc: line {2 + line.count(chr(10))}, column {column}:" in message, message
    assert expected in message
