# SPDX-License-Identifier: MIT
"""Results of every kind of memory and method are those of `okid replay`; blocks for a Session are those of the grid."""

from __future__ import annotations

import json
from pathlib import Path

import okid
import pytest
from captured import edited
from okid import capture
from program import okid as program

MEMORIES = {
    "window": "update_s = 0.5\nwindow_s = 4.0",
    "forgetting": "update_s = 0.5\nforgetting = 0.999",
    "moesp": 'update_s = 1.0\nmethod = "n4sid-moesp"',
    "era-dc": 'update_s = 1.0\nmethod = "okid-era-dc"',
}


@pytest.mark.parametrize("kind", MEMORIES)
def test_every_memory_and_method_as_in_replay(rig: Path, tmp_path: Path, kind: str) -> None:
    (tmp_path / "a.dbc").write_text((rig / "a.dbc").read_text())

    def change(text: str) -> str:
        text = text.replace('method = "okid-era"\n', "") if "method" in MEMORIES[kind] else text
        return text.replace("update_s = 1.0", MEMORIES[kind])

    config = edited(rig / "a.toml", tmp_path / "a.toml", change)
    done = program("replay", rig / "a.log", "-c", config, "--json", tmp_path / "p.json")
    assert done.returncode == 0, done.stderr
    given = ["can", "--log", rig / "a.log", "--config", config, "--json", tmp_path / "r.json", "--quiet"]
    assert capture.main([str(each) for each in given]) == 0
    assert json.loads((tmp_path / "r.json").read_text())["modes"]
    assert (tmp_path / "r.json").read_bytes() == (tmp_path / "p.json").read_bytes()


def test_samples_of_a_session_are_those_of_the_grid(rig: Path) -> None:
    config = capture.load_config(rig / "a.toml")
    with okid.Session.from_config(rig / "a.toml") as session:
        assert session.names == [channel.name for channel in config.wanted]
        for block in capture.can_blocks(capture.messages_for(rig / "a.log", config), config, block=7):
            session.feed(block)
        assert session.samples == 1500
