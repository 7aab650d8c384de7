# SPDX-License-Identifier: MIT
"""Identification that takes far longer than update_s, at 1 kHz, beside two busy processors: nothing of the stream waits
for it. And a session whose own thread gets hardly any processor: what it gives up, in which order.

OKID_SLOW=1: for a minute.
"""

from __future__ import annotations

import contextlib
import json
import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import program
import pytest
from lines import Line, Run, line, node_config, of_type, packet
from live_feed import watching
from systems import w2_codes
from test_torn_away import busy_processors

pytestmark = pytest.mark.realtime
RATE, FAST = 1000, 8000
SECONDS = 60 if os.environ.get("OKID_SLOW") else 6
ROLES = ("force",) * 2 + ("acceleration",) * 6
COMMON = 'restart_on_change = true\n[record]\n[publish]\nsocket = "live.sock"\nsamples = true\n'


def played(tty: Line, seconds: float, rate: int = RATE, goes_on: Callable[[], bool] = lambda: False) -> int:
    """W2 in real time, again and again as long as it goes on: who is late makes up for it. @return samples"""
    codes, in_packet = w2_codes(round(seconds * rate)).tolist(), rate // 250
    begin, at = time.monotonic(), 0
    while at < len(codes) or goes_on():
        time.sleep(max(0.0, begin + at / rate - time.monotonic()))
        place = at % len(codes)
        tty.write(packet(at, codes[place : place + in_packet]))
        at += in_packet
    return at


def nothing_is_missing(events: list[dict[str, Any]], samples: int) -> None:
    stats = of_type(events, "stats")[-1]
    bus = stats["bus"]["node"]
    assert not of_type(events, "gap")
    assert [bus[key] for key in ("received", "lost", "out_of_order", "too_late")] == [
        2 * samples,
        0,
        0,
        0,
    ]  # four channels a frame
    assert all(one["received"] == one["expected"] == samples for one in stats["channel"].values())


@pytest.mark.parametrize(
    "keys",
    ['method = "auto"\nupdate_s = 0.1\n', "p = 60\nupdate_s = 0.1\nwindow_s = 4.0\n"],
    ids=["auto", "named"],
)
def test_nothing_waits_for_mathematics(tmp_path: Path, keys: str) -> None:
    path = node_config(tmp_path, "[identification]\n" + keys + COMMON, RATE, ROLES)
    with line(tmp_path / "tty") as tty:
        run = Run(path, "--json", tmp_path / "live.json")
        with watching(tmp_path / "live.sock") as watch, busy_processors(6):
            samples = played(tty, SECONDS)
            while tty.unread():
                time.sleep(0.01)
            time.sleep(0.5)
            run.stop()
            events = run.finish()
    nothing_is_missing(events, samples)
    updates = of_type(events, "stats")[-1]["updates"]
    assert updates["skipped"] > 0 and updates["made"] > 0
    assert [one["step"] for one in of_type(events, "overload") if one["on"]][0] == "updates"
    blocks = np.diff(watch.blocks)
    assert len(watch.blocks) == samples / RATE / 0.05 and blocks.max() < 1.0, blocks.max()
    (first,) = (tmp_path / "runs").glob("*-0001.okj")
    again, said = tmp_path / "again.json", tmp_path / "again.jsonl"
    done = program.okid("replay", first, "--json", again, "--events", said)
    assert done.returncode == 0, done.stderr
    assert again.read_bytes() == (tmp_path / "live.json").read_bytes()
    every = of_type([json.loads(text) for text in said.read_text().splitlines()], "stats")[-1]["updates"]
    assert every == {"made": updates["made"] + updates["skipped"], "skipped": 0}


@contextlib.contextmanager
def hardly_any_processor(pid: int) -> Iterator[Callable[[], None]]:
    """The main thread, which grids and publishes, gets what busy processes leave it, 3 parts of 3,075 (a step of nice
    leaves each of them a fifth less, so there are more); readers and recorder are as before. What is yielded lets it
    breathe: beside other load it would get nothing for longer than the ring holds."""
    command = [sys.executable, "-c", "import os\nos.sched_setaffinity(0, {0})\nwhile True: pass"]
    os.sched_setaffinity(pid, {0})  # of this thread alone
    hogs = [subprocess.Popen(command) for _ in range(round(3 * 1.25 ** os.nice(0)))]

    def share(policy: int, then: int) -> None:
        os.sched_setscheduler(pid, policy, os.sched_param(0))
        for hog in hogs:
            hog.send_signal(then)

    def breathe() -> None:
        share(os.SCHED_OTHER, signal.SIGSTOP)
        time.sleep(0.8)  # still behind: a step for each quarter of a second
        share(os.SCHED_IDLE, signal.SIGCONT)

    share(os.SCHED_IDLE, signal.SIGCONT)
    try:
        yield breathe
    finally:
        share(os.SCHED_OTHER, signal.SIGKILL)
        for hog in hogs:
            hog.wait()


def test_what_is_given_up_and_in_which_order(tmp_path: Path) -> None:
    path = node_config(
        tmp_path, "[identification]\np = 4\nupdate_s = 1.0\nwindow_s = 2.0\nsigma_blocks = 0\n" + COMMON, FAST, ROLES
    )
    with line(tmp_path / "tty") as tty:
        run = Run(path, "--json", tmp_path / "live.json")
        with watching(tmp_path / "live.sock") as watch:
            done: list[int] = []

            def published() -> list[bool]:
                return [one["on"] for one in of_type(run.events(), "overload") if one["step"] == "publishing"]

            until = time.monotonic() + 150  # the stream goes on until publishing was given up and has come back
            sender = threading.Thread(
                target=lambda: done.append(
                    played(tty, SECONDS, FAST, lambda: published()[-1:] != [False] and time.monotonic() < until)
                )
            )
            sender.start()
            time.sleep(1.0)
            with hardly_any_processor(run.process.pid) as breathe:
                for turn in range(1, 1201):
                    if published():
                        break
                    time.sleep(0.1)
                    if turn % 35 == 0:
                        breathe()
            sender.join()
            while tty.unread():
                time.sleep(0.01)
            run.stop()
            events = run.finish()
    nothing_is_missing(events, done[0])
    standing: set[str] = set()
    for one in of_type(events, "overload"):  # updates are left out besides when they alone are too slow
        if one["on"]:
            assert one["step"] != "publishing" or standing == {"pictures", "updates"}
        else:
            assert one["step"] != "pictures" or "publishing" not in standing
        (standing.add if one["on"] else standing.remove)(one["step"])
    told = published()
    assert told and not told[-1]  # a slow machine may still leave out pictures in the end
    assert len(watch.blocks) < done[0] / FAST / 0.05 - 3
    (first,) = (tmp_path / "runs").glob("*-0001.okj")
    again = tmp_path / "again.json"
    assert program.okid("replay", first, "--json", again).returncode == 0
    assert again.read_bytes() == (tmp_path / "live.json").read_bytes()
