# SPDX-License-Identifier: MIT
"""okid init: what it proposes is accepted by okid check, and reads the frames it was made from."""

from __future__ import annotations

import json
import shutil
import tomllib
from pathlib import Path

import pytest
from program import ROOT, okid

RECIPES = ROOT / "examples" / "recipes"
COMMENTED = ("title = ", "bitrate = ", "hold = ", "mkr = ", "window_s = ", "[record]", "directory = ")


@pytest.fixture(scope="module")
def rig(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("init")
    for name in ("vendor.dbc", "lab.toml", "frame_rig.toml"):
        shutil.copy(RECIPES / name, folder)
    okid("simulate", folder / "frame_rig.toml", "--csv", folder / "frame.csv", "--quiet", status=0)
    okid("convert", folder / "frame.csv", folder / "run.log", "-c", folder / "lab.toml", status=0)
    return folder


def test_from_a_log(rig: Path) -> None:
    """Rate measured, counter found, and the same samples as by the config written by hand."""
    okid("init", rig / "a.toml", "--dbc", rig / "vendor.dbc", "--log", rig / "run.log", status=0)
    made = tomllib.loads((rig / "a.toml").read_text())
    assert made["acquisition"]["rate_hz"] == 250 and made["bus"][0]["dbc"] == "vendor.dbc"
    assert [(c["name"], c["role"], c["sequence"]) for c in made["channel"]] == [
        ("LC_Force", "force", "LC_Count"),
        *((f"ACC_{k}", "acceleration", "ACC_Count") for k in (1, 2, 3)),
    ]
    assert "left out: LC_Data.LC_Status" in (rig / "a.toml").read_text()
    checked = okid("check", rig / "a.toml", status=0).stdout
    assert "1 force and 3 response channels" in checked
    assert (rig / "a.toml").read_text().startswith("# Made by okid init")
    by_hand, proposed = rig / "hand.csv", rig / "proposed.csv"
    okid("convert", rig / "run.log", by_hand, "-c", rig / "lab.toml", status=0)
    okid("convert", rig / "run.log", proposed, "-c", rig / "a.toml", status=0)
    rows = [path.read_text().splitlines()[3:] for path in (by_hand, proposed)]
    assert rows[0] == rows[1] and len(rows[0]) == 10000


def test_only_messages_that_are_heard(rig: Path) -> None:
    lines = [line for line in (rig / "run.log").read_text().splitlines() if " 300#" in line]
    (rig / "accelerations.log").write_text("\n".join(lines) + "\n")
    okid("init", rig / "b.toml", "--dbc", rig / "vendor.dbc", "--log", rig / "accelerations.log", status=0)
    text = (rig / "b.toml").read_text()
    assert "# left out: message LC_Data (0x200), not heard" in text
    assert [c["role"] for c in tomllib.loads(text)["channel"]] == ["acceleration"] * 3


def test_from_the_fields_of_a_line(tmp_path: Path) -> None:
    path = tmp_path / "line.toml"
    okid("init", path, "--device", "/dev/ttyACM0", "--fields", "count,-,force,a1,a2", "--rate", "250", status=0)
    made = tomllib.loads(path.read_text())
    assert made["bus"][0]["counter_field"] == 0 and made["bus"][0]["framing"] == "ascii"
    assert [(c["name"], c["role"], c["field"]) for c in made["channel"]] == [
        ("force", "force", 2),
        ("a1", "acceleration", 3),
        ("a2", "acceleration", 4),
    ]
    shown = json.loads(okid("check", path, "--json", status=0).stdout)
    assert shown["rate_hz"] == 250 and shown["inputs"] == 1 and shown["outputs"] == 2


def test_the_rig_of_the_program(rig: Path) -> None:
    """A DBC of the program itself, in another folder; the commented lines are valid when they are switched on."""
    (rig / "sub").mkdir()
    okid("simulate", rig / "frame_rig.toml", "--dbc", rig / "sub" / "rig.dbc", "--quiet", status=0)
    okid("init", rig / "c.toml", "--dbc", rig / "sub" / "rig.dbc", "--rate", "250", status=0)
    text = (rig / "c.toml").read_text()
    assert 'dbc = "sub/rig.dbc"' in text
    for line in COMMENTED:
        assert f"# {line}" in text, line
        text = text.replace(f"# {line}", line)
    assert tomllib.loads(text)["publish"] == {"socket": "c.sock", "samples": True}  # what okid-live asks for
    (rig / "all.toml").write_text(text)
    okid("check", rig / "all.toml", status=0)


def test_refused(rig: Path) -> None:
    def refused(words: str, *arguments: object, code: int = 2) -> None:
        done = okid("init", *arguments, status=code)
        assert words in done.stderr, done.stderr

    (rig / "there.toml").write_text("mine\n")
    refused("exists", rig / "there.toml", "--dbc", rig / "vendor.dbc", "--rate", "250")
    assert (rig / "there.toml").read_text() == "mine\n"
    refused("--rate HZ", rig / "x.toml", "--dbc", rig / "vendor.dbc")
    refused("either --dbc", rig / "x.toml", "--rate", "250")
    refused("--fields", rig / "x.toml", "--device", "/dev/ttyACM0", "--rate", "250")
    refused("no response", rig / "x.toml", "--device", "/dev/ttyACM0", "--rate", "250", "--fields", "force")
    (rig / "none.dbc").write_text('VERSION ""\nBO_ 5 Temp: 2 X\n SG_ T : 0|16@1+ (0.1,0) [0|0] "degC" X\n')
    refused("unit of a motion", rig / "x.toml", "--dbc", rig / "none.dbc", "--rate", "10")
    (rig / "empty.log").write_text("")
    refused("no frame came", rig / "x.toml", "--dbc", rig / "vendor.dbc", "--log", rig / "empty.log", code=4)
    refused(
        "nosuchbus", rig / "x.toml", "--dbc", rig / "vendor.dbc", "--listen", "1", "--interface", "nosuchbus", code=4
    )
    assert not (rig / "x.toml").exists()
