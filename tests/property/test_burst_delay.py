# SPDX-License-Identifier: MIT
"""A force without a counter in bursts that all end alike, beside a punctual bus: how well its time is known is said,
and what that means for R. The log is made here, of a simulated oscillator, not by `okid simulate`."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import program
import pytest
from methods import by_method

CONFIG = """[acquisition]
rate_hz = 1000
[[bus]]
name = "a"
type = "socketcan"
interface = "can0"
[[bus]]
name = "b"
type = "socketcan"
interface = "can1"
[[channel]]
name = "force"
role = "force"
bus = "b"
can_id = 0x100
start_bit = 0
length = 16
signed = true
[[channel]]
name = "acc"
role = "acceleration"
bus = "a"
can_id = 0x200
start_bit = 0
length = 16
signed = true
sequence = { start_bit = 16, length = 16 }
[identification]
p = 10
update_s = 2.0
sigma_blocks = 0
"""


def play(folder: Path, every_s: float, lost: tuple[int, ...] = ()) -> tuple[dict[str, Any], dict[str, Any]]:
    """@param lost  samples of the force. @return the last stats, the result"""
    force = np.random.default_rng(4).integers(-8000, 8000, 8000)
    answer, state = [], np.zeros(2)
    for value in force:
        state = np.array([1.9 * state[0] - 0.98 * state[1] + 0.05 * value, state[0]])
        answer.append(round(float(state[0])))
    rows = []
    for n, (value, response) in enumerate(zip(force.tolist(), answer, strict=True)):
        due = n / 1000
        held = np.ceil(due / every_s + 1e-9) * every_s if every_s else due
        rows.append((due, f"can0 200#{(response & 0xFFFF).to_bytes(2, 'little').hex()}{n.to_bytes(2, 'little').hex()}"))
        if n not in lost:
            rows.append((float(held) + 1e-4, f"can1 100#{(value & 0xFFFF).to_bytes(2, 'little').hex()}"))
    rows.sort(key=lambda row: row[0])
    (folder / "a.log").write_text(
        "".join(f"({1.7e9 + t:.6f}) {text.upper().replace('CAN', 'can')}\n" for t, text in rows)
    )
    (folder / "a.toml").write_text(CONFIG)
    done = program.okid("replay", folder / "a.log", "-c", folder / "a.toml", "--events", folder / "e")
    assert done.returncode == 0, done.stderr
    events = [json.loads(line) for line in (folder / "e").read_text().splitlines()]
    stats = [event for event in events if event["type"] == "stats"][-1]
    return stats, events[-1]["result"]


def test_bursts_that_end_alike_leave_a_part_of_a_sample_open(tmp_path: Path) -> None:
    stats, result = play(tmp_path, 0.016)
    known_us = stats["channel"]["force"]["place_std_us"]
    assert 150 < known_us < 1000 / np.sqrt(12) + 1  # uniform over what is left of a sample period
    assert "place_std_us" not in stats["channel"]["acc"]
    (text,) = [warning["text"] for warning in result["warnings"] if warning["code"] == "burst_delay"]
    assert '"force"' in text and f"{known_us:.2g} us" in text
    assert abs(stats["rate_hz_by_stamps"] - 1000) < 0.5


def test_bursts_that_end_anywhere_and_punctual_frames_are_known(tmp_path: Path) -> None:
    for every_s in (0.0, 0.01617):
        stats, result = play(tmp_path, every_s)
        assert stats["channel"]["force"].get("place_std_us", 0) < 60
        assert stats["channel"]["force"]["missing"] == 0


def test_a_place_that_nobody_can_know(tmp_path: Path) -> None:
    """One sample that is lost looks like a poll that slips past one: warned of. A second one soon proves both."""
    for lost, uncertain, missing in (((), 0, 0), ((4000,), 1, 0), ((4000, 5500), 2, 2)):
        stats, result = play(tmp_path, 0.016, lost)
        channel = stats["channel"]["force"]
        assert (channel.get("uncertain", 0), channel["missing"]) == (uncertain, missing), lost
        assert channel["expected"] == channel["received"] + channel["missing"]
        said = [warning["text"] for warning in result["warnings"] if warning["code"] == "place_uncertain"]
        assert len(said) == (uncertain > 0) and all('"force"' in text for text in said)


RIG = """rate_hz = 1000.0
duration_s = 12.0
seed = 1
masses = [1.0, 0.8, 1.2]
springs = [3e4, 2e4, 2.5e4]
zeta = [0.01, 0.01]
force_dofs = [1]
sense_dofs = [1, 2, 3]
noise_percent = 1.0
bits = 16
"""


@pytest.fixture(scope="module")
def rig(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A frame whose force comes over a bus of its own, without a counter."""
    folder = tmp_path_factory.mktemp("bursts")
    (folder / "rig.toml").write_text(RIG)
    names = {"log": "a.log", "truth": "t.json", "dbc": "a.dbc", "config": "a.toml"}
    given = [x for option, name in names.items() for x in (f"--{option}", folder / name)]
    program.okid("simulate", folder / "rig.toml", *given, status=0)
    text = by_method((folder / "a.toml").read_text())
    bus = '[[bus]]\nname = "can1"\ntype = "socketcan"\ninterface = "vcan1"\ndbc = "a.dbc"\n\n[[channel]]'
    text = text.replace("[[channel]]", bus, 1).replace('bus = "can0"\n', 'bus = "can1"\n', 1)
    (folder / "b.toml").write_text(text.replace('sequence = "Counter"\n', "", 1))
    return folder


def in_bursts(rig: Path, polled_s: float, packet: int, jitter_s: float, late_s: float) -> tuple[Any, list[str]]:
    """Bursts of polls or of packets, handed over so late behind their last sample at least, two stalls among them.
    @return M and the warnings"""
    rows, last = [], 0.0
    for n, row in enumerate((rig / "a.log").read_text().splitlines()):
        stamp, _, data = row.split()
        if data.startswith("101#"):
            rows.append((float(stamp[1:-1]), f"vcan0 {data}"))
            continue
        k = n // 2
        early_s = 1e-3 - late_s  # of a poll, before the next sample is there
        burst = int(np.ceil((k / 1000 + early_s) / polled_s - 1e-9)) if polled_s else k // packet
        handed_s = burst * polled_s - early_s if polled_s else (burst * packet + packet - 1) / 1000 + late_s
        handed_s += np.random.default_rng(burst).uniform(0, jitter_s)
        for at, held in ((3.0, 0.15), (7.3, 0.3)):
            handed_s = at + held if at <= handed_s < at + held else handed_s
        last = max(handed_s, last + 1e-6)
        rows.append((1.7e9 + last, f"vcan1 {data}"))
    rows.sort(key=lambda row: row[0])
    (rig / "b.log").write_text("".join(f"({t:.6f}) {text}\n" for t, text in rows))
    done = program.okid("replay", rig / "b.log", "-c", rig / "b.toml", "--json", "-", status=0)
    result = json.loads(done.stdout)
    return np.array(result["mkr"]["M"]), [warning["code"] for warning in result["warnings"]]


@pytest.mark.parametrize(
    ("polled_s", "packet", "jitter_s"), [(0.016, 0, 0.0), (0.01617, 0, 2e-3), (0.0, 4, 0.0), (0.0, 16, 2e-3)]
)
def test_masses_beside_a_punctual_bus(rig: Path, polled_s: float, packet: int, jitter_s: float) -> None:
    """M within 3 % of the truth: every sample in its place."""
    truth = np.array(json.loads((rig / "t.json").read_text())["M"])
    found, _ = in_bursts(rig, polled_s, packet, jitter_s, 3e-4)
    np.testing.assert_allclose(found, truth, atol=0.03 * truth.max(), rtol=0)
    np.testing.assert_allclose(np.diag(found), np.diag(truth), rtol=0.03)


def test_a_constant_delay_of_a_sample_is_marked(rig: Path) -> None:
    """Nobody can see it in the arrivals; M is wrong, and the result says so."""
    truth = np.array(json.loads((rig / "t.json").read_text())["M"])
    found, warnings = in_bursts(rig, 0.0, 16, 0.0, 1.0e-3)
    assert np.abs(found - truth).max() > 0.1
    assert {"burst_delay", "mkr_feedthrough_misfit", "mkr_residual"} <= set(warnings)
