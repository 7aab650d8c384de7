# SPDX-License-Identifier: MIT
"""[trigger]: identification begins at the sample that the data says, whatever the speed; said when it never does."""

from __future__ import annotations

import json
import pathlib

import numpy as np
import pytest
from program import okid
from two_masses import rig_text, simulate_rig

SAMPLES = 2000
EPOCH_S = 1700000000  # of the simulated log


@pytest.fixture(scope="module")
def rig(tmp_path_factory: pytest.TempPathFactory) -> pathlib.Path:
    return simulate_rig(tmp_path_factory.mktemp("trigger"), rig_text(8.0))


def columns(rig: pathlib.Path) -> np.ndarray:
    return np.loadtxt(rig / "a.csv", delimiter=",", skiprows=3)


def replay(rig: pathlib.Path, section: str, *options: object, log: str = "a.log") -> tuple[int, str, list[dict], str]:
    """Exit status, stderr, events, and the result as text."""
    (rig / "b.toml").write_text((rig / "a.toml").read_text() + section)
    for name in ("e", "r"):
        (rig / name).unlink(missing_ok=True)
    done = okid("replay", rig / log, "-c", rig / "b.toml", "--events", rig / "e", "--json", rig / "r", *options)
    events = [json.loads(line) for line in (rig / "e").read_text().splitlines()] if (rig / "e").exists() else []
    return done.returncode, done.stderr, events, (rig / "r").read_text() if (rig / "r").exists() else ""


def of_type(events: list[dict], kind: str) -> list[dict]:
    return [event for event in events if event["type"] == kind]


def crossing(values: np.ndarray, level: float, edge: str) -> int:
    up = (values[:-1] < level) & (values[1:] >= level)
    down = (values[:-1] > level) & (values[1:] <= level)
    return int(np.flatnonzero({"rising": up, "falling": down, "both": up | down}[edge])[0]) + 1


@pytest.mark.parametrize(
    ("edge", "channel", "level", "pretrigger"),
    [
        ("rising", "force1", 2.4, 0.2),
        ("falling", "force1", -2.4, 0.0),
        ("both", "force1", 2.2, 0.06),
        ("rising", "acc2", 2.0, 0.1),
        ("rising", "force1", 2.0, 60.0),
    ],
)
def test_level(rig: pathlib.Path, edge: str, channel: str, level: float, pretrigger: float) -> None:
    values = columns(rig)[:, ["force1", "acc1", "acc2"].index(channel)]
    sample = crossing(values, level, edge)
    assert 0 < sample < SAMPLES - 500
    section = f'\n[trigger]\nsource = "level"\nchannel = "{channel}"\nlevel = {level}\nedge = "{edge}"\n'
    section += f"pretrigger_s = {pretrigger}\n"
    status, errors, events, text = replay(rig, section)
    assert status == 0, errors
    told = of_type(events, "trigger")
    assert [(event["source"], event["sample"]) for event in told] == [("level", sample)]
    assert told[0]["t"] == pytest.approx(sample / 250)
    assert told[0]["time_s"] == pytest.approx(EPOCH_S + sample / 250, abs=1e-3)
    used = SAMPLES - max(0, sample - round(pretrigger * 250))
    assert json.loads(text)["samples"] == used
    assert all(event["t"] >= sample / 250 for event in of_type(events, "modes"))
    # The same samples alone, without a trigger.
    lines = (rig / "a.log").read_text().splitlines(keepends=True)
    (rig / "cut.log").write_text("".join(lines[2 * (SAMPLES - used) :]))
    assert replay(rig, "", log="cut.log")[3] == text


def test_every_speed_gives_the_same(rig: pathlib.Path) -> None:
    section = '\n[trigger]\nsource = "level"\nlevel = 2.4\npretrigger_s = 0.2\n'
    plain = replay(rig, section)
    slow = replay(rig, section, "--speed", "8")
    assert plain[0] == slow[0] == 0
    assert plain[3] == slow[3] and plain[3]
    assert plain[2] == slow[2]


def test_edge_of_a_line_replayed(rig: pathlib.Path) -> None:
    """A log holds no edge: it is given, and then the result is that of the sample it falls on."""
    section = '\n[trigger]\nsource = "gpio"\nchip = "gpiochip0"\nline = 17\npretrigger_s = 0.1\n'
    status, errors, _, text = replay(rig, section)
    assert status == 2 and "--trigger-at" in errors and not text
    at = EPOCH_S + 400 / 250 - 0.001
    status, errors, events, text = replay(rig, section, "--trigger-at", f"{at:.6f}")
    assert status == 0, errors
    assert [event["sample"] for event in of_type(events, "trigger")] == [400]
    assert json.loads(text)["samples"] == SAMPLES - 400 + 25
    assert replay(rig, section, "--trigger-at", f"{at:.6f}", "--speed", "8")[3] == text
    status, errors, _, text = replay(rig, section, "--trigger-at", str(EPOCH_S + 100))
    assert status == 3 and "came after the last sample" in errors and not text
    assert replay(rig, "", "--trigger-at", "5")[0] == 2
    assert replay(rig, section, "--trigger-at", "soon")[0] == 2


def test_lost_frames_before_and_at_the_trigger(rig: pathlib.Path) -> None:
    """A sample that is missing cannot trigger; the next crossing does. Gaps are told on stream samples as ever."""
    sample = crossing(columns(rig)[:, 0], 2.4, "rising")
    lines = (rig / "a.log").read_text().splitlines(keepends=True)
    (rig / "lossy.log").write_text("".join(lines[: 2 * (sample - 3)] + lines[2 * (sample + 2) :]))
    section = '\n[trigger]\nsource = "level"\nlevel = 2.4\npretrigger_s = 0.1\n'
    status, errors, events, text = replay(rig, section, log="lossy.log")
    assert status == 0, errors
    force = columns(rig)[:, 0].copy()
    force[sample - 3 : sample + 2] = np.nan
    kept = np.flatnonzero(np.isfinite(force))
    expected = int(kept[crossing(force[kept], 2.4, "rising")])
    assert of_type(events, "trigger")[0]["sample"] == expected
    assert {event["count"] for event in of_type(events, "gap")} == {5}
    used = json.loads(text)["samples"]
    assert used == SAMPLES - (expected - 25)


def test_it_never_comes(rig: pathlib.Path) -> None:
    status, errors, events, text = replay(rig, '\n[trigger]\nsource = "level"\nlevel = 1e6\n')
    low, high = columns(rig)[:, 0].min(), columns(rig)[:, 0].max()
    assert status == 3 and not text
    assert f"waited for force1 to rise to 1e+06 N, its values lay between {low:.6g} and {high:.6g}" in errors
    assert not of_type(events, "modes") and not of_type(events, "result") and of_type(events, "stats")


@pytest.mark.parametrize(
    ("section", "pieces"),
    [
        ('[trigger]\nsource = "level"', ["[trigger]", '"level" is missing']),
        ('[trigger]\nsource = "level"\nlevel = 1\nchannel = "force2"', ['found "force2"', 'did you mean "force1"']),
        ('[trigger]\nsource = "gpio"\nline = 4', ['"chip" is missing', "gpiodetect"]),
        ('[trigger]\nsource = "gpio"\nchip = "gpiochip0"', ['"line" is missing', "gpioinfo"]),
        ('[trigger]\nsource = "gpio"\nchip = "g"\nline = -1', ["found -1", "from 0 to 65535"]),
        ('[trigger]\nsource = "gpio"\nchip = "g"\nline = ""', ["the number of a line on its chip or its name"]),
        ('[trigger]\nsource = "gpio"\nchip = "g"\nline = 1\nlevel = 2', ['belongs to source = "level"']),
        ("[trigger]\npretrigger_s = 1", ['found source = "immediate"']),
        ('[trigger]\nsource = "level"\nlevel = 1\npretrigger_s = 1e5', ["at most 1 GB"]),
        ('[lamps]\ngreen = { chip = "a", line = 1 }', ["unknown key", "armed", "alarm"]),
        ("[lamps]\ngo = 17", ["found 17", "such as { chip"]),
        ('[lamps]\ngo = { chip = "a", pin = 1 }', ["[lamps] go", '"pin"', "unknown key"]),
        ('[lamps]\ngo = { chip = "a", line = 1 }\narmed = { chip = "a", line = 1 }', ["a line 1 is used already"]),
    ],
)
def test_wrong_keys(rig: pathlib.Path, section: str, pieces: list[str]) -> None:
    text = (rig / "a.toml").read_text().replace("rate_hz = 250", "rate_hz = 250000")  # so that 1e5 s are too much
    (rig / "wrong.toml").write_text(text + "\n" + section + "\n")
    done = okid("check", rig / "wrong.toml")
    assert done.returncode == 2
    for piece in ["wrong.toml", "line ", *pieces]:
        assert piece in done.stderr


def test_check_and_doctor_tell(rig: pathlib.Path) -> None:
    section = (
        '[trigger]\nsource = "gpio"\nchip = "nochip"\nline = "START"\n[lamps]\ngo = { chip = "nochip", line = 3 }\n'
    )
    (rig / "lines.toml").write_text((rig / "a.toml").read_text() + "\n" + section)
    done = okid("check", rig / "lines.toml")
    assert done.returncode == 0
    assert "begins with an edge of nochip line START" in done.stdout and "lamp go: nochip line 3" in done.stdout
    done = okid("doctor", rig / "lines.toml")
    assert done.returncode == 4
    assert "trigger line" in done.stdout and "GPIO chip nochip, line START:" in done.stdout
    assert "lamp go" in done.stdout and "->" in done.stdout
