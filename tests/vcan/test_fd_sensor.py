# SPDX-License-Identifier: MIT
"""A multiplexed node of CAN FD at the load of a full bus of 8 Mbit/s: the run, its journal and replay, and what other
programs (candump, python-can, cantools) make of the same frames, sample by sample."""

from __future__ import annotations

import signal
import struct
import subprocess
from pathlib import Path

import can
import fd_sensor
import numpy as np
import pytest
from can_run import OKID, Run, bus, sh
from numpy.typing import NDArray
from okid import capture
from systems import w2_frequencies
from test_vcan import interface  # noqa: F401  (a fixture)
from waiting import until
from wire_bits import flexible

FLOOD = Path(OKID).parent / "tests" / "vcan_flood"
RATE, SAMPLES = 2500, 5000
FRAMES = fd_sensor.PAGES * SAMPLES


def raw(data: list[bytes]) -> bytes:
    """struct canfd_frame of each: extended identifier, bit rate switched."""
    return b"".join(struct.pack("=IBBxx64s", fd_sensor.ID | 1 << 31, len(each), 1, each) for each in data)


def columns(table: Path) -> NDArray[np.float64]:
    """What `okid convert` wrote, in the order of NAMES."""
    rows = [line.split(",") for line in table.read_text().splitlines() if not line.startswith("#")]
    order = [rows[0].index(name) for name in fd_sensor.NAMES]
    return np.array(rows[1:], float)[:, order]


def right(result: dict) -> None:
    assert (result["samples"], result["gaps"]) == (SAMPLES, 0)
    found = [mode["frequency_hz"] for mode in result["modes"]]
    assert len(found) == len(w2_frequencies(RATE))
    for f, true in zip(found, w2_frequencies(RATE), strict=True):
        assert abs(f / true - 1) < 5e-4


@pytest.mark.parametrize("counts", ["samples", "frames"])
def test_a_node_that_fills_the_bus(counts: str, tmp_path: Path) -> None:
    data = fd_sensor.frames(SAMPLES, counts)
    (tmp_path / "frames").write_bytes(raw(data))
    config = fd_sensor.write_config(tmp_path, RATE, '[record]\ndirectory = "runs"\n')
    assert "up" in sh(OKID, "doctor", str(config), check=False).stdout
    live = Run(tmp_path)
    with (tmp_path / "seen.log").open("w") as seen:
        watch = subprocess.Popen(["candump", "-L", "-r", "33554432", "vcan0"], stdout=seen)
        until(lambda: Path("/proc/net/can/rcvlist_all").read_text().count("vcan0 ") > 1, watch)
        sh(str(FLOOD), "vcan0", str(FRAMES), str(fd_sensor.PAGES * RATE), f"fd:{tmp_path}/frames")
        events = live.stop()
        watch.send_signal(signal.SIGINT)
        watch.wait(1800)
    stats = [event for event in events if event["type"] == "stats"][-1]
    ours = bus(events)
    assert ours["received"] == FRAMES
    assert [ours[key] for key in ("lost", "duplicate", "too_late", "out_of_order", "decode_errors")] == [0] * 5
    assert {channel["received"] for channel in stats["channel"].values()} == {SAMPLES}
    seconds = sum(flexible(fd_sensor.ID, True, True, each, fd_sensor.BITRATE, fd_sensor.DBITRATE) for each in data)
    print(f"load {ours['load_percent']:.1f} %, by bits {100 * seconds * RATE / SAMPLES:.1f} %")
    assert abs(ours["load_percent"] - 100 * seconds * RATE / SAMPLES) < 1
    assert not [event for event in events if event["type"] == "gap"]
    assert "counter_erratic" not in [warning["code"] for warning in events[-1]["result"]["warnings"]]
    right(events[-1]["result"])

    (journal,) = (tmp_path / "runs").glob("*.okj")
    sh(OKID, "replay", str(journal), "--json", str(tmp_path / "again.json"))
    assert (tmp_path / "again.json").read_bytes() == (tmp_path / "r.json").read_bytes()
    sh(OKID, "convert", str(journal), str(tmp_path / "a.csv"))
    theirs = list(can.CanutilsLogReader(tmp_path / "seen.log"))
    assert all(each.is_fd and each.bitrate_switch and each.is_extended_id for each in theirs)
    table = fd_sensor.decoded([bytes(each.data) for each in theirs])
    assert table.shape == (SAMPLES, len(fd_sensor.NAMES))
    assert np.allclose(columns(tmp_path / "a.csv"), table, rtol=1e-9, atol=1e-9)
    captured = np.vstack(list(capture.can_blocks(theirs, config)))
    assert np.allclose(captured, table[:, :-1], rtol=1e-9, atol=1e-9)  # a block has what is identified
