# SPDX-License-Identifier: MIT
"""What names and foreign texts do to a terminal: nothing. Control characters are shown, not sent."""

from __future__ import annotations

import pathlib
import re

import numpy as np
from okid import InputError
from okid._errors import shown
from program import okid

EVIL = "\x1b]0;pwned\x07\x1b[2J\r\x08\u202egnp\u2066\x9b31m"
CONTROL = re.compile("[\x00-\x08\x0b-\x1f\x7f-\x9f\u202a-\u202e\u2066-\u2069]")


def toml_text(text: str) -> str:
    return '"' + "".join(f"\\u{ord(c):04x}" if CONTROL.match(c) else c for c in text) + '"'


def test_names_of_a_config(tmp_path: pathlib.Path) -> None:
    name = toml_text("a" + EVIL)
    config = f'[acquisition]\nrate_hz = 100.0\ntitle = {name}\n[[bus]]\nname = {name}\ninterface = "vcan0"\n'
    channel = (
        f'[[channel]]\nname = {name}\nrole = "acceleration"\nunit = {name}\ncan_id = 1\nstart_bit = 0\nlength = 16\n'
    )
    (tmp_path / "c.toml").write_text(config + channel)
    done = okid("check", tmp_path / "c.toml")
    assert done.returncode == 0, done.stderr
    assert not CONTROL.search(done.stdout + done.stderr) and "a\\x1b]0;pwned\\x07" in done.stdout
    (tmp_path / "c.toml").write_text(config + channel + channel)
    done = okid("check", tmp_path / "c.toml")
    assert done.returncode == 2 and not CONTROL.search(done.stderr) and "\\" in done.stderr


def test_names_of_a_record_and_of_files(tmp_path: pathlib.Path) -> None:
    path = tmp_path / f"rec{EVIL}.csv".replace("/", "")
    path.write_text('f,"a' + EVIL.replace("\r", "") + '"\n1,2\n')
    for arguments in ((path,), (path, "--inputs", "f", "--outputs", "a" + EVIL, "--fs", "100")):
        done = okid("identify", *arguments)
        assert done.returncode == 2 and not CONTROL.search(done.stderr), done.stderr


def test_strings_of_a_dbc(tmp_path: pathlib.Path) -> None:
    (tmp_path / "a.dbc").write_text(
        f'VERSION "{EVIL}"\nBO_ 256 M: 8 A\n SG_ S : 0|16@1- (1,0) [0|0] "g{EVIL}" B\n', encoding="utf-8", newline="\n"
    )
    (tmp_path / "c.toml").write_text(
        '[acquisition]\nrate_hz = 100.0\n[[bus]]\nname = "b"\ninterface = "vcan0"\ndbc = "a.dbc"\n'
        '[[channel]]\nname = "s"\nrole = "acceleration"\nmessage = "M"\nsignal = "S"\n'
    )
    done = okid("check", tmp_path / "c.toml")
    assert not CONTROL.search(done.stdout + done.stderr)


def test_the_same_in_python() -> None:
    assert shown("plain äöü ± 你\n\ttab") == "plain äöü ± 你\n\ttab"
    assert not CONTROL.search(shown(EVIL)) and shown("\x1b\x9b\u202e") == "\\x1b\\u009b\\u202e"
    assert str(InputError(f"{EVIL}: bad")) == shown(f"{EVIL}: bad")
    rng = np.random.default_rng(1)
    for _ in range(200):
        text = "".join(map(chr, rng.integers(0, 0x3000, 20)))
        assert not CONTROL.search(shown(text))
