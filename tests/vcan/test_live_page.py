# SPDX-License-Identifier: MIT
"""okid-live beside `okid run` on vcan0: what a page is sent is what was on the bus, losses included."""

from __future__ import annotations

import base64
import csv
import json
import shutil
import signal
import tempfile
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from event_source import Listener, ask
from live_process import Live
from okid.frf import h1
from test_vcan import OKID, Run, bus, interface, make_record, play, sh  # noqa: F401  (interface is a fixture)

RATE, COLUMN = 500, 5  # samples/s; samples of a column of the lanes
NAMES = ["force1", "acc1", "acc2"]
LOST = range(2000, 2060)  # lines of the log whose second frame is left out: samples 1000 to 1029 of both accelerations


@pytest.fixture
def folder() -> Iterator[Path]:
    """Where sockets can be made: in the memory of the test kernel."""
    sh("ip", "link", "set", "lo", "up")
    made = Path(tempfile.mkdtemp(dir="/dev/shm" if Path("/dev/shm").is_dir() else None))
    make_record(made, 10.0)
    config = (made / "a.toml").read_text().replace("update_s = 1.0", "update_s = 0.5\nwindow_s = 5.0")
    (made / "a.toml").write_text(config + '\n[publish]\nsocket = "okid.sock"\nsamples = true\n')
    lines = (made / "a.log").read_text().splitlines(keepends=True)
    (made / "holes.log").write_text("".join(x for k, x in enumerate(lines) if not (k in LOST and " 101#" in x)))
    yield made
    shutil.rmtree(made)


def samples_of(folder: Path) -> np.ndarray:
    """(3, N) as `okid convert` decodes the log, NaN where frames are missing."""
    sh(OKID, "convert", str(folder / "holes.log"), str(folder / "out.csv"), "-c", str(folder / "a.toml"))
    with (folder / "out.csv").open() as file:
        rows = list(csv.reader(line for line in file if not line.startswith("#")))
    places = [next(k for k, name in enumerate(rows[0]) if name.split()[0] == wanted) for wanted in NAMES]
    return np.array([[float(row[k] or "nan") for k in places] for row in rows[1:]]).T


class Watched:
    """Everything a page was sent until the result, lanes put together."""

    def __init__(self, page: Listener, columns: int) -> None:
        self.low, self.high = np.full((3, columns), np.nan, "f4"), np.full((3, columns), np.nan, "f4")
        self.marks = np.full((3, columns), 255, np.uint8)
        self.kinds: dict[str, int] = {}
        self.log: list[str] = []
        for kind, event in page.events():
            self.kinds[kind] = self.kinds.get(kind, 0) + 1
            if kind == "lanes":
                self._lanes(event)
            elif kind in ("hello", "log"):
                self.log += [entry["text"] for entry in (event["log"] if kind == "hello" else event)["entries"]]
            elif kind == "state" and event["link"] == "ended":
                self.state = event
            elif kind == "stats":
                self.stats = event
            elif kind == "result":
                self.result = event
            if hasattr(self, "state") and hasattr(self, "result"):
                return

    def _lanes(self, event: dict) -> None:
        at = slice(event["first"], event["first"] + event["count"])
        for name, kind in (("low", "<f4"), ("high", "<f4"), ("marks", np.uint8)):
            numbers = np.frombuffer(base64.b64decode(event[name]), kind)
            getattr(self, name)[:, at] = numbers.reshape(3, event["count"])


def test_what_a_page_sees_is_what_was_on_the_bus(folder: Path) -> None:
    live = Live(folder / "a.toml")
    page = Listener(live.port)
    assert page.event()[1]["state"]["text"] == "waiting for okid"
    run = Run(folder)
    next(event for kind, event in page.events() if kind == "state" and event["link"] == "live")
    play(folder / "holes.log")
    events = run.stop()
    seen = Watched(page, 10 * RATE // COLUMN)
    found = json.loads(ask(live.port, "/spectra?channels=0,2&output=1&input=0")[2])
    assert live.end(signal.SIGINT) == (0, "")

    data = samples_of(folder)
    assert data.shape == (3, 10 * RATE) and np.isnan(data[1]).sum() == 30
    check_lanes(seen, data)
    check_response(found, data)
    told = {kind: [event for event in events if event["type"] == kind] for kind in ("modes", "gap", "stats", "result")}
    assert [text for text in seen.log if "missing" in text] == [
        f"{gap['channel']}: 30 missing, samples 1000 to 1029 (sequence)" for gap in told["gap"]
    ]
    assert bus(events)["lost"] == bus(events)["lost_by"]["sequence"] == 30  # to be looked at costs no frame
    assert len(told["gap"]) == 2 and seen.kinds["modes"] > 3 and seen.kinds["tracks"] > 3
    assert seen.stats == told["stats"][-1] and seen.state["text"] == "ended: result" and seen.state["faults"] == 0
    assert seen.result["modes"] == told["result"][0]["result"]["modes"] and "mkr" in seen.result


def check_lanes(seen: Watched, data: np.ndarray) -> None:
    whole = data.reshape(3, -1, COLUMN)
    there = ~np.all(np.isnan(whole), axis=2)
    assert np.array_equal(np.isnan(seen.low), ~there)
    assert np.array_equal(seen.low[there], np.nanmin(whole[there], axis=1).astype("f4"))
    assert np.array_equal(seen.high[there], np.nanmax(whole[there], axis=1).astype("f4"))
    assert np.array_equal(seen.marks, np.where(there, 0, 1))


def check_response(found: dict, data: np.ndarray) -> None:
    """H1 over the unbroken segments, as of the whole record."""
    frequency, magnitude = (
        np.frombuffer(base64.b64decode(x), "<f4") for x in (found["frequency"], found["response"]["magnitude"])
    )
    length = 2 * (len(frequency) - 1)
    expected = h1(data[0], data[2], RATE, nperseg=length)
    peak = int(np.argmax(np.abs(expected.response[:, 0, 0])))
    assert abs(int(np.argmax(magnitude)) - peak) <= 1
    assert magnitude[peak] == pytest.approx(abs(expected.response[peak, 0, 0]), rel=0.15)
