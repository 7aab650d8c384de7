# SPDX-License-Identifier: MIT
"""Lines of okid's socket: cut anyhow, damaged, lost; okid that comes late, goes, comes again."""

from __future__ import annotations

import base64
import contextlib
import json
import random
import threading
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from okid._errors import InputError
from okid.data.line_splitter import LineSplitter
from okid.live.config import read_config
from okid.live.hub import Outbox
from okid.live.session import Session
from okid_feed import WHOLE, OkidFeed, channel, modes, samples, start
from waiting import until

CHANNELS = [
    channel("f", "force", "N", 1),
    channel("a", "acceleration", "m/s^2", 1),
    channel("b", "acceleration", "g", 2),
]
CONFIG = WHOLE + '[publish]\nsocket = "s"\nsamples = true\n'


@pytest.mark.parametrize("seed", range(20))
def test_lines_cut_anywhere(seed: int) -> None:
    lines = [b'{"k":%d,"x":"%s"}' % (k, b"y" * (k % 37)) for k in range(200)]
    data, splitter, draw = b"\n".join([*lines, b""]), LineSplitter(), random.Random(seed)
    got = []
    while data:
        n = draw.randint(1, 500)
        got += splitter.add(data[:n])
        data = data[n:]
    assert got == lines and splitter.dropped == 0


def test_a_line_without_end_is_dropped_and_the_next_is_read() -> None:
    splitter = LineSplitter(longest=1000)
    got = []
    for _ in range(10):
        got += splitter.add(b"x" * 300)
    got += splitter.add(b"x\n\n  \nnext\nla")
    assert got == [b"next"] and splitter.dropped == 1 and splitter.add(b"st\r\n") == [b"last"]


@contextlib.contextmanager
def session(folder: Path, text: str = CONFIG, start_it: bool = True) -> Iterator[Session]:
    (folder / "a.toml").write_text(text)
    one = Session(read_config(folder / "a.toml"))
    if start_it:
        one.start()
    try:
        yield one
    finally:
        one.stop()


class Page:
    """Reads what a browser would get."""

    def __init__(self, one: Session) -> None:
        outbox = one.open_page()
        assert outbox is not None
        self.session, self.outbox = one, outbox
        self.events: list[tuple[str, Any]] = []

    def read(self) -> Page:
        for data in self.outbox.take(0.05):
            head, body = data.decode().strip().split("\n")
            self.events.append((head.removeprefix("event: "), json.loads(body.removeprefix("data: "))))
        return self

    def last(self, kind: str) -> Any:
        found = [event for name, event in self.read().events if name == kind]
        return found[-1] if found else None


def floats(text: str) -> np.ndarray:
    return np.frombuffer(base64.b64decode(text), "<f4")


def texts(one: Session) -> list[str]:
    return [entry["text"] for entry in one.run.log]


def test_okid_comes_late_goes_and_comes_again(tmp_path: Path) -> None:
    with session(tmp_path) as one:
        page = Page(one)
        assert page.last("hello")["state"]["text"] == "waiting for okid"
        first = OkidFeed(tmp_path / "s")
        first.accept()
        first.send(start(CHANNELS), modes(1.0, [10.0, 20.0]))
        until(lambda: (page.last("modes") or {}).get("t") == 1.0)
        assert until(lambda: (page.last("state") or {}).get("link") == "live")
        assert [c["name"] for c in page.last("hello")["facts"]["channels"]] == ["f", "a", "b"]
        first.close()
        until(lambda: "okid ended" in page.last("state")["text"])
        again = OkidFeed(tmp_path / "s")
        again.accept()
        again.send(start(CHANNELS), modes(2.0, [10.0, 20.0]))  # the same run: nothing is forgotten
        until(lambda: (page.last("modes") or {}).get("t") == 2.0)
        assert [u["t"] for u in one.run.tracks.updates] == [1.0, 2.0]
        run = page.last("hello")["run"]
        again.send(start(CHANNELS[:2], number=7), modes(0.5, [11.0]))
        until(lambda: (page.last("modes") or {}).get("t") == 0.5)
        hello = page.last("hello")
        assert hello["run"] != run and len(hello["facts"]["channels"]) == 2 and hello["tracks"]["updates"] == []
        again.send(
            {"type": "result", "t": 3.0, "result": {"order": 2, "modes": [], "method": "okid-era", "model": None}}
        )
        again.close()
        until(lambda: (page.last("state") or {}).get("text") == "ended: result")
        assert page.last("result")["order"] == 2 and "model" not in page.last("result")


@pytest.mark.parametrize(
    "line",
    [
        b"{",
        b"\xff\xfe\x00",
        b"[]",
        b"17",
        b'{"t":1}',
        b'{"type":7}',
        b'{"type":"modes"}',
        b'{"type":"modes","t":1,"modes":7}',
        b'{"type":"samples","t":1,"first":0,"count":2,"values":[[1,2],[3]]}',
        b'{"type":"samples","t":1,"first":0,"count":2,"values":[[1,2]]}',
        b'{"type":"samples","t":1,"first":-5,"count":1,"values":[[1],[1],[1]]}',
        b'{"type":"samples","t":1,"first":1.5,"count":1,"values":[[1],[1],[1]]}',
        b'{"type":"samples","t":1,"first":0,"count":1,"values":[["x"],[1],[1]]}',
        b'{"type":"samples","t":1,"first":0,"count":1,"values":[[NaN],[1],[1]]}',
        b'{"type":"stats","t":"soon"}',
        b'{"type":"start","t":0,"rate_hz":100,"channels":[7]}',
        b'{"type":"result","t":1,"result":null}',
        b'{"type":"hit","t":1,"accepted":true,"sample":1e999}',
        b'{"type":"alarm","t":1,"modes":7}',
        b"[" * 100000,
    ],
)
def test_a_damaged_line_costs_itself_only(tmp_path: Path, line: bytes) -> None:
    with session(tmp_path, start_it=False) as one:
        Page(one)
        send = [json.dumps(event).encode() for event in (start(CHANNELS), modes(1.0, [10.0]))]
        for each in (*send, line, line, json.dumps(modes(2.0, [10.0])).encode()):
            one.line(each)
        for count in range(1, 21):
            one._frames(count)
        block = np.ones((len(one.run.channels), 20))
        one.line(json.dumps(samples(100, block), separators=(",", ":")).encode())
        assert one.run.modes is not None and one.run.modes["t"] == 2.0
        if one.run.channels:
            assert one.measured is not None and one.measured.recent.end == 120


def test_faults_are_said_three_times_not_a_thousand(tmp_path: Path) -> None:
    with session(tmp_path, start_it=False) as one:
        for _ in range(1000):
            one.line(b"{")
        assert one.faults == 1000 and sum("could not be read" in text for text in texts(one)) == 3


def test_events_are_told_in_words(tmp_path: Path) -> None:
    told = [
        {"type": "gap", "t": 1.0, "channel": "a", "first": 5, "last": 9, "count": 5, "cause": "sequence"},
        {
            "type": "alarm",
            "t": 2.0,
            "mode": 1,
            "frequency_hz": 9.5,
            "baseline_hz": 10.0,
            "sigma_hz": 0.01,
            "modes": [1, 2],
        },
        {"type": "change", "t": 2.5, "sample": 2400, "restarted": True},
        {"type": "alarm_over", "t": 3.0},
        {"type": "lost", "count": 17},
        {"type": "bus", "t": 3.5, "bus": "can0", "event": "down", "text": "link went down"},
        {
            "type": "hit",
            "t": 4.0,
            "number": 2,
            "sample": 5,
            "accepted": False,
            "reason": "double_hit",
            "text": "a second hit",
        },
        {"type": "news of later days", "t": 5.0},
    ]
    with session(tmp_path, start_it=False) as one:
        for event in (start(CHANNELS), *told):
            one.line(json.dumps(event).encode())
        assert texts(one)[1:] == [
            "a: 5 missing, samples 5 to 9 (sequence)",
            "alarm: mode 1 at 9.5 Hz, baseline 10 Hz, σ 0.01 Hz, 1 more away",
            "the structure changed at sample 2400; earlier samples were discarded",
            "alarm cleared: every mode is back at its baseline",
            "17 lines of okid did not reach this page",
            "can0: down link went down",
            "hit 2 rejected (double_hit): a second hit",
            "event 'news of later days'",
        ]
        state = one._state()
        assert state["alarm"] is False and [mark["t"] for mark in state["marks"]] == [2.0, 2.4, 3.0]


def test_nothing_is_computed_while_no_page_is_open_and_nothing_is_missing_then(tmp_path: Path) -> None:
    data = np.random.default_rng(0).standard_normal((3, 8000)).round(5)
    lines = [json.dumps(samples(k, data[:, k : k + 50]), separators=(",", ":")).encode() for k in range(0, 8000, 50)]
    with session(tmp_path, start_it=False) as one:
        one.line(json.dumps(start(CHANNELS)).encode())
        for line in lines[:100]:
            one.line(line)
        assert one.measured is not None and one.measured.recent.end == 0
        page = Page(one)
        lanes = page.last("lanes")
        assert (lanes["first"], lanes["count"]) == (0, 500)
        assert np.array_equal(
            floats(lanes["low"]).reshape(3, 500), data[:, :5000].reshape(3, 500, 10).min(axis=2).astype("f4")
        )
        for line in lines[100:120]:
            one.line(line)
        one.hub.leave(page.outbox)
        for line in lines[120:]:
            one.line(line)
        assert one.measured.recent.end == 6000
        assert Page(one).last("lanes")["count"] == 800 and np.array_equal(one.measured.recent.read(0, 8000), data.T)


def test_sleep_is_bounded(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("okid.live.session.ASLEEP_BYTES", 20_000)
    with session(tmp_path, start_it=False) as one:
        one.line(json.dumps(start(CHANNELS)).encode())
        for k in range(0, 5000, 50):
            one.line(json.dumps(samples(k, np.full((3, 50), float(k))), separators=(",", ":")).encode())
        assert sum(map(len, one._asleep)) <= 20_000
        lanes = Page(one).last("lanes")
        assert lanes["first"] > 0 and lanes["first"] + lanes["count"] == 500


def test_without_samples_everything_else_is_there(tmp_path: Path) -> None:
    with session(tmp_path, WHOLE + '[publish]\nsocket = "s"\n', start_it=False) as one:
        page = Page(one)
        one.line(json.dumps(start(CHANNELS)).encode())
        one.line(json.dumps(modes(1.0, [10.0])).encode())
        assert one._state()["samples"] == "off"
        for count in range(1, 11):
            for frame in one._frames(count):
                one.hub.send(frame)
        kinds = [kind for kind, _ in page.read().events]
        assert "modes" in kinds and "tracks" in kinds and "lanes" not in kinds


def test_spectra_of_channels_that_are_not_there(tmp_path: Path) -> None:
    with session(tmp_path, start_it=False) as one:
        assert one.spectra([0], 0, 0) == {"text": "no samples yet"}
        Page(one)
        one.line(json.dumps(start(CHANNELS)).encode())
        for k in range(0, 9000, 50):
            one.line(
                json.dumps(
                    samples(k, np.random.default_rng(k).standard_normal((3, 50))), separators=(",", ":")
                ).encode()
            )
        found = one.spectra([0, 2], 1, 0)
        assert len(floats(found["frequency"])) == len(floats(found["spectra"][1])) == 2049
        assert found["response"]["averages"] == 3 and np.isfinite(floats(found["response"]["coherence"])).all()
        for wrong in (([3], 0, 0), ([0], 2, 0), ([0], 0, 1), ([-1], 0, 0)):
            with pytest.raises(ValueError, match="0 to"):
                one.spectra(*wrong)


def test_weeks_of_updates_stay_a_thousand(tmp_path: Path) -> None:
    with session(tmp_path, start_it=False) as one:
        one.line(json.dumps(start(CHANNELS)).encode())
        for k in range(5000):
            one.line(json.dumps(modes(float(k), [10.0])).encode())
        times = [update["t"] for update in one.run.tracks.updates]
        assert len(times) <= 1000 and times[0] == 0.0 and times[-500:] == [float(k) for k in range(4500, 5000)]
        assert times == sorted(times) and one.run.tracks.generation > 5


def test_many_threads_at_once(tmp_path: Path) -> None:
    """Pages come and go while lines come in: every page begins with a whole picture of one moment."""
    with session(tmp_path) as one:
        feed = OkidFeed(tmp_path / "s")
        feed.accept()
        feed.send(start(CHANNELS))
        seen: list[int] = []

        def look() -> None:
            for _ in range(20):
                page = Page(one)
                hello = page.last("hello")
                assert hello["tracks"]["updates"] == [] or hello["modes"]["t"] == hello["tracks"]["updates"][-1]["t"]
                one.hub.leave(page.outbox)
                seen.append(1)

        threads = [threading.Thread(target=look) for _ in range(4)]
        for thread in threads:
            thread.start()
        for k in range(300):
            feed.send(modes(float(k), [10.0, 20.0]), samples(50 * k, np.zeros((3, 50))))
        for thread in threads:
            thread.join()
        feed.close()
        assert len(seen) == 80 and len(one.hub) == 0


@pytest.mark.parametrize(
    ("text", "found"),
    [
        ("[publish]\n", '"socket" is missing'),
        ("", '"socket" is missing'),
        ("[publish]\nsocket = 7\n", '"socket"'),
        ('[publish]\nsocket = "s"\nsamples = 1\n', '"samples": found 1, expected true or false'),
        ('[publish]\nsocket = "s"\n[identification]\np = -1\n', '"p": found -1'),
        ('[publish]\nsocket = "s"\n[identification]\nwindow_s = "x"\n', '"window_s"'),
        ('[publish]\nsocket = "s"\n[geometry]\nnodes = [[0, 0]]\ndofs = [[1,"x"]]\n', '"nodes": entry 1'),
        ('[publish]\nsocket = "s"\n[geometry]\nnodes = [[0,0,0]]\ndofs = [[1,"x"]]\nlines = [[1,2]]', 'lines": entry'),
        ('[publish]\nsocket = "s"\n[geometry]\nnodes = [[0, 0, 0]]\ndofs = [[1, "q"]]\n', '"dofs": entry 1'),
        (f'[publish]\nsocket = "{"x" * 120}"\n', "at most 107"),
        ("[publish\n", "line "),
    ],
)  # fmt: skip
def test_configs_that_are_wrong(tmp_path: Path, text: str, found: str) -> None:
    (tmp_path / "a.toml").write_text(WHOLE + text)
    with pytest.raises(InputError) as fault:
        read_config(tmp_path / "a.toml")
    assert found in str(fault.value) and "\n" not in str(fault.value).strip()


def test_a_config_that_is_right(tmp_path: Path) -> None:
    (tmp_path / "a.toml").write_text(
        "\ufeff" + WHOLE + '[publish]\nsocket = "run/s"\n[identification]\np = 12\n'
        '[hammer]\nchannel = "f"\nlevel = 3\nlength_s = 1.5\n'
        '[geometry]\nnodes = [[0, 0, 0], [1, 0, 0]]\nlines = [[1, 2]]\ndofs = [[2, "-z"]]\n'
    )
    config = read_config(tmp_path / "a.toml")
    assert config.socket == tmp_path / "run/s" and not config.samples and config.hammer and config.hit_s == 1.5
    assert config.identification.window_s is None and config.identification.p == 12
    assert config.geometry is not None and config.geometry.dofs == [(2, "-z")]
    assert set(Session(config)._facts()["geometry"]) == {
        "nodes",
        "lines",
        "surfaces",
        "fixed",
        "dofs",
    }  # what shapes.js takes
    assert read_config(tmp_path / "a.toml", "other").socket == Path("other")


def test_a_page_that_is_never_read_ends_with_what_is_newest(tmp_path: Path) -> None:
    with session(tmp_path, start_it=False) as one:
        one.line(json.dumps(start(CHANNELS)).encode())
        lazy = Page(one)
        assert isinstance(lazy.outbox, Outbox)
        for k in range(2000):
            one.line(json.dumps(modes(float(k), [10.0])).encode())
            for frame in one._frames(5):
                one.hub.send(frame)
        lazy.read()
        assert len(lazy.events) < 600 and lazy.outbox.dropped > 0
        newest = [
            e["modes"]["t"] if kind == "hello" else e["t"] for kind, e in lazy.events if kind in ("hello", "modes")
        ]
        assert newest[-1] == 1999.0
