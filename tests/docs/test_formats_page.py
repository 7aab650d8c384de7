# SPDX-License-Identifier: MIT
"""The sessions of docs/reference/formats.md, typed as they stand: `okid-convert` answers what the page shows."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import okid
import pytest
from asammdf import MDF, Signal
from can import Message
from command_help import ROOT
from markdown_pages import blocks
from okid.formats import write_log, write_record
from okid.formats.command import main

PAGE = ROOT / "docs" / "reference" / "formats.md"
SESSIONS = [block.text for block in blocks(PAGE) if block.text.startswith("$ okid-convert ")]
GEOMETRY = '[geometry]\nnodes = [[0, 0, 0]]\ndofs = [[1, "x"], [1, "y"]]\n'


@pytest.fixture
def prepared(tmp_path: Path) -> Path:
    """The files that the sessions begin with."""
    dice, time = np.random.default_rng(5), np.arange(5000) / 250.0
    force = dice.standard_normal(5000)
    ring = [np.exp(-0.01 * w * time) * np.sin(w * time) for w in (60.0, 200.0)]
    first, second = (np.convolve(force, h)[:5000] for h in ring)
    moved = np.column_stack([force, first + second, first - second])
    record = okid.Record(["force1", "acc1", "acc2"], moved, 250.0)
    write_record(tmp_path / "run.csv", record)
    result = okid.identify(force, moved[:, 1:], fs=250.0, order=4, method="n4sid-moesp")
    result.save(tmp_path / "result.json")
    (tmp_path / "frame.toml").write_text(GEOMETRY)
    table = "\n".join(f"{k * 0.004:.3f},{a:.6f},{b:.6f}" for k, (a, b) in enumerate(moved[:, :2]))
    (tmp_path / "scope.csv").write_text(f"Model,SC-4\nSerial,17\nCoupling,DC\n\nTime,CH1,CH2\n{table}\n")
    frames = [
        Message(timestamp=1.7e9 + k // 2 / 250.0, arbitration_id=0x100 + k % 2, is_extended_id=False, data=bytes(8))
        for k in range(10000)
    ]
    write_log(tmp_path / "trace.blf", frames)
    write_log(tmp_path / "run.blf", frames[:100])
    with MDF(version="4.10") as file:
        for name, rate in (("force", 250.0), ("acc", 125.0)):
            stamps = np.arange(int(4 * rate)) / rate
            file.append([Signal(np.sin(stamps), stamps, name=name)], comment=name)
        file.save(tmp_path / "two.mf4")
    return tmp_path


@pytest.mark.parametrize("session", SESSIONS, ids=lambda text: text.split("\n")[0][15:])
def test_a_session_answers_as_shown(
    session: str, prepared: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(prepared)
    for command in session.removeprefix("$ ").split("\n$ "):
        typed, *shown = command.strip().split("\n")
        words = typed.split()[1:]
        if session is not SESSIONS[0]:  # these sessions begin anew
            Path(words[1]).unlink(missing_ok=True)
        code = main(words)
        said = capsys.readouterr()
        assert (said.err + said.out).rstrip("\n").split("\n") == shown, typed
        assert code == (2 if said.err and not said.out else 0)


def test_all_sessions_are_followed() -> None:
    assert len(SESSIONS) == 4
    assert PAGE.read_text().count("$ okid-convert") == sum(text.count("$ okid-convert") for text in SESSIONS)
