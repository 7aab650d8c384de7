# SPDX-License-Identifier: MIT
"""[virtual]: replays without a sensor, with a gap of all sensors and without the force, beside the signals that the rig
wrote before anything was taken away."""

from __future__ import annotations

import json
import re
import socket
import subprocess
from pathlib import Path
from typing import Any

import numpy as np
import okid
import pytest
from program import PROGRAM
from program import okid as program_okid
from two_masses import rig_text, simulate_rig
from waiting import until

PUBLISH = '\n[publish]\nsocket = "v.sock"\nsamples = true\n[virtual]\nmodel = "v.json"\n'
RATE = 250.0


@pytest.fixture(scope="module")
def rig(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, np.ndarray]:
    """Files of the rig, and force1, acc1, acc2 as it wrote them."""
    folder = simulate_rig(tmp_path_factory.mktemp("virtual"), rig_text(40.0))
    text = [line for line in (folder / "a.csv").read_text().splitlines() if not line.startswith("#")]
    names = text[0].split(",")
    columns = [names.index(name) for name in ("force1", "acc1", "acc2")]
    return folder, np.array([[float(row.split(",")[k]) for k in columns] for row in text[1:]])


def without(folder: Path, *names: str) -> str:
    """The config less the channels of those names."""
    parts = re.split(r"(?m)^(?=\[)", (folder / "a.toml").read_text())
    return "".join(part for part in parts if not any(f'name = "{name}"' in part for name in names))


def replay(folder: Path, config: str, log: str = "a.log") -> tuple[dict[str, Any], list[dict[str, Any]]]:
    """The event `start`, and the blocks of signals from its socket."""
    (folder / "v.toml").write_text(config)
    command = [PROGRAM, "replay", folder / log, "-c", folder / "v.toml", "--speed", "20", "--quiet"]
    with subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True) as run:
        one = socket.socket(socket.AF_UNIX)
        until(lambda: run.poll() is not None or one.connect_ex(str(folder / "v.sock")) == 0)
        with one, one.makefile("r", encoding="utf-8") as file:
            lines = [json.loads(line) for line in file.read().splitlines()]
        assert run.wait(1800) == 0, run.stderr and run.stderr.read()
    return lines[0], [line for line in lines if line["type"] == "samples"]


def column(blocks: list[dict[str, Any]], k: int, count: int) -> np.ndarray:
    out = np.full(count, np.nan)
    for block in blocks:
        values = np.array(block["values"][k], dtype=np.float64)
        out[block["first"] : block["first"] + len(values)] = values
    return out


def test_lost_sensor_and_gap(rig: tuple[Path, np.ndarray]) -> None:
    folder, truth = rig
    model = okid.identify(truth[:5000, :1], truth[:5000, 1:], fs=RATE, method="okid-era", p=12).model
    sensors = okid.VirtualSensors.of(model, truth[:5000, :1], truth[:5000, 1:])
    sensors.save(folder / "v.json", inputs=["force1"], outputs=["acc1", "acc2"])
    config = without(folder, "acc2") + PUBLISH
    start, blocks = replay(folder, config)
    assert [one["name"] for one in start["channels"]] == ["force1", "acc1", "acc2 (virtual)"]
    assert start["channels"][2]["virtual"] == "acc2" and start["channels"][2]["role"] == "aux"
    assert all(len(block["values"]) == 3 and len(block["std"]) == 1 for block in blocks)
    found = column(blocks, 2, len(truth))
    error = (found - truth[:, 2])[5500:]
    std = np.array([block["std"][0] for block in blocks if block["first"] > 5500])
    assert np.std(error) < 0.06 * np.std(truth[:, 2]) and 0.5 < np.std(error) / np.median(std) < 1.6
    # 20 samples of everything are missing: forces and the sensor are bridged, and the deviation grows
    kept = [line for line in (folder / "a.log").read_text().splitlines() if not 30.0 <= when(line) < 30.08]
    (folder / "gap.log").write_text("\n".join(kept) + "\n")
    start, blocks = replay(folder, config + 'channels = ["acc1"]\n', "gap.log")
    assert [one["name"] for one in start["channels"]][2] == "acc1 (virtual)"
    measured, bridged = column(blocks, 1, len(truth)), column(blocks, 2, len(truth))
    gone = np.flatnonzero(np.isnan(measured[6000:9000])) + 6000
    assert 18 <= len(gone) <= 22 and np.all(np.isfinite(bridged[gone]))
    wide = {block["first"]: block["std"][0] for block in blocks}
    at = max(wide[first] for first in wide if gone[0] <= first <= gone[-1])
    there = [wide[first] for first in wide if first > gone[-1] + 50 and first < 9900]
    assert max(there) == 0.0 and at > 0.2 * np.std(truth[:, 1])
    assert np.sqrt(np.mean((bridged[gone] - truth[gone, 1]) ** 2)) < 3.0 * at
    both = np.isfinite(measured) & np.isfinite(bridged)
    assert np.array_equal(measured[both], bridged[both])


def when(line: str) -> float:
    return float(line[1:].split(")")[0]) - 1700000000.0


def test_force_that_nobody_measures(rig: tuple[Path, np.ndarray]) -> None:
    folder, truth = rig
    model = okid.identify(truth[:5000, :1], truth[:5000, 1:], fs=RATE, method="okid-era", p=12).model
    sensors = okid.VirtualSensors.of(model, truth[:5000, :1], truth[:5000, 1:], force_std=float(np.std(truth[:, 0])))
    sensors.save(folder / "v.json", inputs=["force1"], outputs=["acc1", "acc2"])
    config = without(folder, "force1").replace('method = "okid-era"', 'method = "n4sid-cva"')
    config = re.sub(r"(?m)^(p|hold|mkr) = .*\n", "", config)
    start, blocks = replay(folder, config + PUBLISH)
    assert [one["name"] for one in start["channels"]] == ["acc1", "acc2", "force1 (virtual)"]
    found = column(blocks, 2, len(truth))[5500:]
    assert np.corrcoef(found, truth[5500:, 0])[0, 1] > 0.95


def test_what_does_not_go_together(rig: tuple[Path, np.ndarray]) -> None:
    folder, truth = rig
    model = okid.identify(truth[:5000, :1], truth[:5000, 1:], fs=RATE, method="okid-era", p=12).model
    okid.VirtualSensors.of(model, truth[:, :1], truth[:, 1:]).save(
        folder / "v.json", inputs=["force1"], outputs=["acc1", "acc2"]
    )
    plain = (folder / "a.toml").read_text()
    cases = [
        (plain + PUBLISH.replace("samples = true\n", ""), "expected samples = true in [publish]"),
        (plain + PUBLISH.replace('model = "v.json"\n', ""), 'key "model" is missing'),
        (plain + PUBLISH.replace("v.json", "none.json"), "none.json"),
        (plain + PUBLISH.replace("v.json", "a.csv"), "a.csv: no JSON"),
        (plain.replace("rate_hz = 250", "rate_hz = 200") + PUBLISH, "a model at 250 Hz, expected rate_hz = 200"),
        (without(folder, "force1") + PUBLISH, 'its input "force1" is no channel'),
        (plain.replace('name = "acc', 'name = "b') + PUBLISH, "none of its outputs acc1, acc2"),
        (plain + PUBLISH + 'channels = ["acc9"]\n', 'found "acc9", expected outputs of'),
    ]
    for text, words in cases:
        (folder / "bad.toml").write_text(text)
        done = program_okid("check", folder / "bad.toml")
        assert done.returncode == 2 and words in done.stderr, (words, done.stderr)
    (folder / "bad.toml").write_text(plain + PUBLISH.replace("v.json", "none.json"))
    done = program_okid("replay", folder / "a.log", "-c", folder / "bad.toml", "--quiet")
    assert done.returncode == 0 and "warning: no virtual sensors: " in done.stderr, done.stderr
