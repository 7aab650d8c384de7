# SPDX-License-Identifier: MIT
"""Files that are none, that never end or that are nested without end: refused at once by every reader, in one line."""

from __future__ import annotations

import json
import os
import pathlib
import stat
import subprocess
import sys
import zlib

import pytest
from measured_run import Measured, measured
from okid import InputError, Session
from okid.data.input_file import DEEPEST, check_input, parse_json, parse_toml, read_input
from program import PROGRAM

DEPTH = 50_000
CONFIG = '[acquisition]\nrate_hz = 100.0\n[[bus]]\nname = "can0"\ninterface = "vcan0"\n'
CHANNEL = '[[channel]]\nname = "a"\nrole = "acceleration"\ncan_id = 256\nstart_bit = 0\nlength = 16\n'
NESTED = {
    "dotted key": ".".join(["a"] * DEPTH) + " = 1\n",
    "quoted dotted key": '"a" . ' * DEPTH + "b = 1\n",
    "header": "[" + ".".join(["a"] * DEPTH) + "]\n",
    "array of tables": "[[" + ".".join(["a"] * DEPTH) + "]]\n",
    "array": "x = " + "[" * DEPTH + "]" * DEPTH + "\n",
    "inline table": "x = " + "{a=" * DEPTH + "1" + "}" * DEPTH + "\n",
    "behind a string of five quotes": 'x = ["""a"""""' + ", {" + ".".join(["a"] * DEPTH) + " = 1}]\n",
    "behind a comment": "# '''\nx = " + "[" * DEPTH + "\n",
}


def one_line(done: Measured, *words: str, program: str = "okid") -> None:
    assert done.returncode == 2, done
    assert len(done.stderr.splitlines()) == 1 and done.stderr.startswith(f"{program}"), done.stderr
    assert all(word in done.stderr for word in words), done.stderr
    assert done.peak_mb < 300


def report(*arguments: object) -> Measured:
    return measured("-m", "okid.report", *arguments, program=sys.executable, within_s=60)


def journal_with(text: bytes) -> bytes:
    """A whole journal whose config is this, docs/reference/journal-format.md."""
    import struct

    def chunk(kind: int, payload: bytes, sequence: int) -> bytes:
        head = b"\x8fOKJ\r\n\x1a\n" + struct.pack(
            "<BBHIQIIqqQI", 1, kind, 0, len(payload), 7, sequence, 0, 1, 2, 0, zlib.crc32(payload)
        )
        return head + struct.pack("<I", zlib.crc32(head)) + payload

    out, most = [], 60_000
    for first in range(0, len(text), most):
        piece = text[first : first + most]
        out.append(chunk(1, struct.pack("<IQQ", 6, len(text), first) + b"config" + piece, len(out)))
    return b"".join([*out, chunk(3, b"", len(out))])


@pytest.mark.parametrize("kind", list(NESTED))
def test_a_nested_config_is_refused(tmp_path: pathlib.Path, kind: str) -> None:
    """Release 0.1 ended by a signal (139)."""
    for text in (NESTED[kind], CONFIG + CHANNEL + "[geometry]\n" + NESTED[kind]):
        (tmp_path / "c.toml").write_text(text)
        for command in (("check",), ("simulate", "--log", tmp_path / "x")):
            one_line(
                measured(command[0], tmp_path / "c.toml", *command[1:], within_s=20), "c.toml", "nested deeper than 32"
            )


@pytest.mark.parametrize("kind", ["dotted key", "array"])
def test_a_nested_config_in_a_journal_is_refused(tmp_path: pathlib.Path, kind: str) -> None:
    (tmp_path / "j.okj").write_bytes(journal_with(NESTED[kind].encode()))
    one_line(measured("replay", tmp_path / "j.okj", within_s=20), "j.okj", "nested deeper than 32")
    one_line(measured("convert", tmp_path / "j.okj", tmp_path / "j.csv", within_s=20), "j.okj")


def test_what_is_written_passes(tmp_path: pathlib.Path) -> None:
    """Brackets and dots in strings and comments, numbers in long arrays: no nesting."""
    text = '[acquisition]\nrate_hz = 100.0\nnotes = "' + "[." * 200 + '"\n# ' + "[a." * 200 + "\n"
    text += "title = '''" + "{a." * 100 + "\n" + '"' + "'''\n"
    text += CONFIG.split("rate_hz = 100.0\n")[1] + CHANNEL
    (tmp_path / "c.toml").write_text(text)
    done = measured("check", tmp_path / "c.toml")
    assert done.returncode == 0, done.stderr


def test_a_line_that_ends_too_early_is_refused_in_one(tmp_path: pathlib.Path) -> None:
    """The TOML parser shows the line feed it met: release 0.1 printed it as it is."""
    (tmp_path / "c.toml").write_text(CONFIG + CHANNEL + "[identification]\nmkr = t\n")
    one_line(measured("check", tmp_path / "c.toml"), "c.toml: line 13, column 8", "expected 'true'")


def special_files(folder: pathlib.Path) -> list[str]:
    os.mkfifo(folder / "pipe")
    (folder / "link").symlink_to("/dev/zero")
    return [
        "/dev/zero",
        "/dev/tty0" if os.path.exists("/dev/tty0") else "/dev/null",
        str(folder / "pipe"),
        str(folder / "link"),
    ]


def test_devices_and_pipes_are_refused_by_the_program(tmp_path: pathlib.Path) -> None:
    (tmp_path / "c.toml").write_text(CONFIG + CHANNEL)
    for path in special_files(tmp_path):
        with_dbc = (
            CONFIG + f'dbc = "{path}"\n[[channel]]\nname = "a"\nrole = "acceleration"\nmessage = "m"\nsignal = "s"\n'
        )
        (tmp_path / "dbc.toml").write_text(with_dbc)
        for command in (
            ("check", path), ("check", tmp_path / "dbc.toml"), ("run", path), ("identify", path, "--outputs", "a"),
            ("simulate", path, "--log", tmp_path / "x.log"), ("replay", path, "-c", tmp_path / "c.toml"),
        ):  # fmt: skip
            one_line(measured(*command, within_s=10), path, "device or a named pipe")
    assert not (tmp_path / "x.log").exists()


def test_an_open_pipe_is_read(tmp_path: pathlib.Path) -> None:
    done = subprocess.run(
        [PROGRAM, "check", "/dev/stdin"],
        input=CONFIG + CHANNEL,
        text=True,
        capture_output=True,
        timeout=1800,
        check=False,
    )
    assert done.returncode == 0, done.stderr


def test_large_files_are_refused(tmp_path: pathlib.Path) -> None:
    with (tmp_path / "big.toml").open("wb") as file:
        file.truncate(40 << 30)
    for command in (("check", tmp_path / "big.toml"), ("simulate", tmp_path / "big.toml", "--log", "-")):
        one_line(measured(*command, within_s=20), "big.toml: longer than 67108864 bytes")


def test_the_report_refuses_the_same(tmp_path: pathlib.Path) -> None:
    """Release 0.1: MemoryError, RecursionError, an endless read."""
    (tmp_path / "deep.json").write_text("[" * DEPTH + "]" * DEPTH)
    (tmp_path / "object.json").write_text('{"schema":"okid.result/1","a":' + '{"a":' * 900 + "1" + "}" * 901)
    (tmp_path / "events.jsonl").write_text('{"type":"start","t":' + "[" * DEPTH + "\n")
    (tmp_path / "good.json").write_text(json.dumps({"schema": "okid.result/1"}))
    for name in ("deep.json", "object.json"):
        one_line(report(tmp_path / name), name, "nested deeper than 32", program="okid-report")
    for path in special_files(tmp_path):
        one_line(report(path), path, "device or a named pipe", program="okid-report")
    assert not list(tmp_path.glob("*.html"))


def test_readers_of_python(tmp_path: pathlib.Path) -> None:
    for path in special_files(tmp_path):
        with pytest.raises(InputError, match="device or a named pipe"):
            check_input(path)
    (tmp_path / "long").write_bytes(bytes(1001))
    with pytest.raises(InputError, match="larger than 1000 bytes"):
        read_input(tmp_path / "long", 1000)
    assert len(read_input(tmp_path / "long", 1001)) == 1001
    deepest = "[" * DEEPEST + "]" * DEEPEST
    assert parse_json(deepest) and stat.S_ISREG(os.stat(tmp_path / "long").st_mode)
    for text in ("[" + deepest + "]", "[" * DEPTH):
        with pytest.raises(json.JSONDecodeError):
            parse_json(text)
    for kind in NESTED.values():
        with pytest.raises(ValueError, match="nested deeper|recursion|Unclosed|Invalid|Expected|Found"):
            parse_toml(kind)


@pytest.mark.parametrize("command", ["check", "replay", "convert", "run", "Session"])
def test_a_slow_grid(tmp_path: pathlib.Path, command: str) -> None:
    """Release 0.2 ended by a signal: what it refused was a default, which has no place in the file."""
    text = CONFIG.replace("100.0", "1e-5") + CHANNEL + '[identification]\nmethod = "okid-era"\np = 2\n'
    (tmp_path / "c.toml").write_text(text)
    (tmp_path / "x.log").write_text("(1700000000.0) vcan0 100#0011\n(1700100000.0) vcan0 100#0012\n")
    if command == "Session":
        with Session.from_config(tmp_path / "c.toml") as session:
            assert session.fs == 1e-5
        return
    arguments: dict[str, tuple[object, ...]] = {
        "replay": (tmp_path / "x.log", "-c", tmp_path / "c.toml"),
        "convert": (tmp_path / "x.log", tmp_path / "x.csv", "-c", tmp_path / "c.toml"),
        "run": (tmp_path / "c.toml", "--duration", 1),
    }
    done = measured(command, *arguments.get(command, (tmp_path / "c.toml",)), within_s=60)
    assert done.returncode in {"replay": (3,), "run": (3, 4)}.get(command, (0,)), done
    (tmp_path / "c.toml").write_text(text.replace("1e-5", "9e-6"))
    one_line(measured(command, *arguments.get(command, (tmp_path / "c.toml",)), within_s=60), "from 1e-05 to 1000000")
