# SPDX-License-Identifier: MIT
"""Modes while samples come: updates at the program's times, settled by its rule, a silence costs one update; and the
result of every kind of memory and method is that of `okid replay`."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import okid
import pytest
from captured import assert_same_result, edited
from okid import capture
from okid.capture.mode_watch import Settling, mode_text
from okid.result.result import Mode
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
    ours, theirs = (json.loads((tmp_path / name).read_text()) for name in ("r.json", "p.json"))
    assert_same_result(ours, theirs)


def mode(frequency_hz: float, damping_ratio: float = 0.01) -> Mode:
    return Mode(frequency_hz, damping_ratio, np.ones(1, complex), 1.0, 1.0)


def test_settled_after_three_updates_that_agree() -> None:
    rule = Settling()
    assert [rule.add([mode(10.0 + k * 1e-3), mode(20.0)]) for k in (5, 0, 1, 2)] == [False, False, True, True]
    assert not rule.add([mode(10.1), mode(20.0)])
    assert not rule.add([mode(10.1, 0.02), mode(20.0)])
    assert not rule.add([])
    assert [rule.add([mode(5.0)]) for _ in range(3)] == [False, False, True]
    assert rule.add([mode(5.0), mode(33.0)])  # one that comes and goes does not count
    assert not rule.add([mode(44.0)])


class Fed:
    """A session that notes what it gets."""

    fs = 100.0

    def __init__(self) -> None:
        self.calls: list[tuple[str, int]] = []

    def feed(self, block: np.ndarray) -> int:
        self.calls.append(("feed", len(block)))
        return 0

    def gap(self, count: int) -> None:
        self.calls.append(("gap", count))

    def modes(self) -> list[Mode]:
        self.calls.append(("modes", 0))
        return [mode(12.5)]


def test_updates_stand_at_whole_periods_and_a_silence_is_one() -> None:
    session, said = Fed(), []
    watch = capture.ModeWatch(session, 1.0, said.append)  # type: ignore[arg-type]
    watch.follow([np.zeros((70, 2)), np.zeros((150, 2)), np.broadcast_to(np.full((1, 2), np.nan), (65536, 2))])
    expected = [("feed", 70), ("feed", 30), ("modes", 0), ("feed", 100), ("modes", 0), ("feed", 20)]
    assert session.calls == [*expected, ("gap", 65536), ("modes", 0)]
    assert [line.split(":")[0] for line in said] == ["t 1.000 s", "t 2.000 s", "t 657.560 s"]
    assert said[-1].endswith("12.5 Hz 1.000 %; settled")
    assert watch.settled


def test_the_text_of_a_mode() -> None:
    known = mode(17.34871, 0.01003)._replace(frequency_std_hz=0.00061, damping_ratio_std=0.0000438)
    assert mode_text(known) == "17.3487±0.00061 Hz 1.003±0.0044 %"


def test_samples_of_a_session_are_those_of_the_grid(rig: Path) -> None:
    config = capture.load_config(rig / "a.toml")
    with okid.Session.from_config(rig / "a.toml") as session:
        assert session.names == [channel.name for channel in config.wanted]
        for block in capture.can_blocks(capture.messages_for(rig / "a.log", config), config, block=7):
            session.feed(block)
        assert session.samples == 1500
