# SPDX-License-Identifier: MIT
"""A multiplexed node of CAN FD without a bus: what okid init proposes for it, samples in their places whatever its
counter counts, and frames that okid packs, all against cantools."""

from __future__ import annotations

import json
import random
import tomllib
from pathlib import Path

import can
import fd_sensor
import numpy as np
import pytest
from numpy.typing import NDArray
from program import okid

RATE, SAMPLES = 500, 1200


@pytest.fixture(params=["samples", "frames"])
def node(request: pytest.FixtureRequest, tmp_path: Path) -> tuple[Path, list[bytes]]:
    data = fd_sensor.frames(SAMPLES, request.param)
    fd_sensor.write_config(tmp_path, RATE)
    fd_sensor.write_log(tmp_path / "a.log", fd_sensor.messages(data, RATE))
    return tmp_path, data


def samples_of(log: Path, config: Path) -> NDArray[np.float64]:
    """What okid convert makes of a log, in the order of NAMES."""
    okid("convert", log, log.with_suffix(".csv"), "-c", config, status=0)
    rows = [line.split(",") for line in log.with_suffix(".csv").read_text().splitlines() if line[0] != "#"]
    return np.array(rows[1:], float)[:, [rows[0].index(name) for name in fd_sensor.NAMES]]


def events_of(log: Path, config: Path) -> list[dict]:
    okid("replay", log, "-c", config, "--events", log.with_suffix(".ev"), status=0)
    return [json.loads(line) for line in log.with_suffix(".ev").read_text().splitlines()]


def test_every_number_is_that_of_cantools(node: tuple[Path, list[bytes]]) -> None:
    folder, data = node
    found, wanted = samples_of(folder / "a.log", folder / "a.toml"), fd_sensor.decoded(data)
    assert found.shape == wanted.shape and np.allclose(found, wanted, rtol=1e-9, atol=1e-9)
    events = events_of(folder / "a.log", folder / "a.toml")
    counts = [event for event in events if event["type"] == "stats"][-1]["bus"]["can0"]
    assert (counts["received"], counts["lost"], counts["duplicate"]) == (len(data), 0, 0)
    assert "counter_erratic" not in [warning["code"] for warning in events[-1]["result"]["warnings"]]


def test_lost_frames_are_gaps_of_their_pages(node: tuple[Path, list[bytes]]) -> None:
    folder, data = node
    draw = random.Random(2)
    lost = {at for at in range(900, len(data) - 90) if draw.random() < 0.02}
    sent = fd_sensor.messages(data, RATE)
    fd_sensor.write_log(folder / "b.log", [each for at, each in enumerate(sent) if at not in lost])
    found, wanted = samples_of(folder / "b.log", folder / "a.toml"), fd_sensor.decoded(data)
    for at in lost:
        names = fd_sensor.PLACES[at % fd_sensor.PAGES]
        wanted[at // fd_sensor.PAGES, [fd_sensor.NAMES.index(name) for name in names]] = np.nan
    responses = slice(0, len(fd_sensor.NAMES) - 1)
    assert found.shape == wanted.shape
    assert np.allclose(found[:, responses], wanted[:, responses], rtol=1e-9, atol=1e-9, equal_nan=True)


def test_init_proposes_a_config_that_reads_it(node: tuple[Path, list[bytes]]) -> None:
    """The rate is that of a page, not of the frames."""
    folder, data = node
    okid("init", folder / "made.toml", "--dbc", folder / "node.dbc", "--log", folder / "a.log", status=0)
    made = tomllib.loads((folder / "made.toml").read_text())
    assert made["acquisition"]["rate_hz"] == RATE and made["bus"][0]["fd"] is True
    okid("check", folder / "made.toml", status=0)
    okid("convert", folder / "a.log", folder / "made.csv", "-c", folder / "made.toml", status=0)
    rows = [line.split(",") for line in (folder / "made.csv").read_text().splitlines() if line[0] != "#"]
    found = np.array(rows[1:], float)
    assert rows[0] == fd_sensor.NAMES[:-1]
    assert np.allclose(found, fd_sensor.decoded(data)[:, :-1], rtol=1e-9, atol=1e-9)


def test_frames_that_okid_packs(node: tuple[Path, list[bytes]]) -> None:
    """A table to a log: 64 bytes with bit rate switch, which cantools reads back."""
    folder, data = node
    samples_of(folder / "a.log", folder / "a.toml")
    okid("convert", folder / "a.csv", folder / "packed.log", "-c", folder / "a.toml", status=0)
    packed = list(can.CanutilsLogReader(folder / "packed.log"))
    assert {(len(each.data), each.is_fd, each.bitrate_switch) for each in packed} == {(64, True, True)}
    assert len(packed) == len(data)
    found = fd_sensor.decoded([bytes(each.data) for each in packed])
    assert np.allclose(found, fd_sensor.decoded(data), rtol=1e-9, atol=1e-9)
