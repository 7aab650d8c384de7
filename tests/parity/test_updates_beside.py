# SPDX-License-Identifier: MIT
"""Updates on a thread of their own: a live session fed as fast as a log is read leaves most of them out, says
so, and ends with the result of `okid replay`, which makes every one. Nothing of the stream waits for them."""

from __future__ import annotations

import json
import os
import subprocess
import time
from pathlib import Path
from typing import Any

import pytest
from okid.capture.stream import Capture
from program import PROGRAM
from program import okid as run_okid
from waiting import until

RIG = """rate_hz = 200.0
duration_s = 40.0
seed = 3
masses = [1.0, 0.8]
springs = [3e3, 2e3]
zeta = [0.01, 0.01]
force_dofs = [1]
sense_dofs = [1, 2]
noise_percent = 1.0
bits = 16
[[change]]
at_s = 24.0
springs = [2e3, 2e3]
"""
NAMED = 'method = "okid-era"\np = 12\norder = 4\n'


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A structure that changes, two frames of it lost."""
    folder = tmp_path_factory.mktemp("beside")
    (folder / "rig.toml").write_text(RIG)
    names = {"log": "a.log", "truth": "t.json", "dbc": "a.dbc", "config": "a.toml"}
    run_okid("simulate", folder / "rig.toml", *(x for k, v in names.items() for x in (f"--{k}", folder / v)), status=0)
    lines = (folder / "a.log").read_text().splitlines(keepends=True)
    (folder / "a.log").write_text("".join(lines[:5001] + lines[5003:]))
    return folder


def config(folder: Path, name: str, keys: str) -> Path:
    path = folder / f"{name}.toml"
    path.write_text((folder / "a.toml").read_text().split("[identification]\n")[0] + "[identification]\n" + keys)
    return path


def replayed(folder: Path, path: Path) -> tuple[list[dict[str, Any]], bytes]:
    events, out = folder / "e.jsonl", folder / "r.json"
    run_okid("replay", folder / "a.log", "-c", path, "--events", events, "--json", out, status=0)
    return [json.loads(line) for line in events.read_text().splitlines()], out.read_bytes()


def fed(folder: Path, path: Path, at_once: int = 100000) -> tuple[list[dict[str, Any]], bytes, float]:
    """Live, without waiting for anything. @return events, result, and how long the feeding took"""
    out = folder / "live.json"
    with Capture(path, live=True, json=str(out)) as live:
        live.open(folder / "a.log")
        begun = time.monotonic()
        while live.play(at_once) == at_once:
            live.serve()
        took = time.monotonic() - begun
        live.finish()
        return live.events(), out.read_bytes(), took


def of_type(events: list[dict[str, Any]], kind: str) -> list[dict[str, Any]]:
    return [event for event in events if event["type"] == kind]


@pytest.mark.parametrize(
    "keys",
    [
        NAMED + "window_s = 8.0\n",
        NAMED + "forgetting = 0.9995\n",
        NAMED,
        NAMED + "window_s = 8.0\nrestart_on_change = false\n",
        NAMED + 'window_s = 8.0\nwindow = "auto"\n',
        'method = "auto"\nwindow_s = 8.0\n',
        'method = "auto"\n',
    ],
    ids=["window", "forgetting", "growing", "no restart", "chosen window", "auto window", "auto growing"],
)
def test_the_result_is_that_of_replay(made: Path, keys: str) -> None:
    """A change of the structure is noticed at the same sample, from the same model."""
    path = config(made, "parity", keys + "update_s = 0.05\n")
    before, truth = replayed(made, path)
    events, result, _ = fed(made, path)
    assert result == truth
    said = {warning["code"]: warning["text"] for warning in json.loads(truth)["warnings"]}
    auto = 'method = "auto"' in keys
    mixed = keys in (NAMED, 'method = "auto"\n') or "restart_on_change" in keys  # what was before with what came after
    assert {"changed", "restarted"} & set(said) == {"changed" if mixed else "restarted"}
    assert not mixed or "the structure changed near t = 2" in said["changed"]
    assert keys != NAMED or "A - K C" in said["predictor_unstable"]
    assert json.loads(truth)["modes"] and of_type(before, "change") == of_type(events, "change") != []
    assert of_type(before, "gap") == of_type(events, "gap") != []
    told, all_made = of_type(events, "stats")[-1]["updates"], of_type(before, "stats")[-1]["updates"]
    assert all_made["skipped"] == 0
    if auto:  # follows nothing where it was too late to decide
        assert 0 < told["made"] <= told["made"] + told["skipped"] <= all_made["made"]
    else:
        assert told["made"] + told["skipped"] == all_made["made"]
    modes = {event["t"]: event["modes"] for event in of_type(before, "modes")}
    for event in of_type(events, "modes"):  # what is made is made from the same samples
        assert [m["frequency_hz"] for m in event["modes"]] == [m["frequency_hz"] for m in modes[event["t"]]]
    steps = of_type(events, "overload")
    assert [one["on"] for one in steps] == [k % 2 == 0 for k in range(len(steps))]
    assert (told["skipped"] > 0) == (len(steps) > 0) and {one["step"] for one in steps} <= {"updates"}
    assert told["skipped"] > (0 if auto else all_made["made"] / 2)

    with Capture(path, json=str(made / "unseen.json"), keep_events=False) as unseen:
        unseen.open(made / "a.log")
        unseen.play(1 << 40)
        unseen.finish()
        left_out = unseen.stats()["updates"]["skipped"]
    assert (made / "unseen.json").read_bytes() == truth
    assert left_out > (0 if auto else all_made["made"] / 2)


def test_a_replay_that_nobody_looks_at(made: Path) -> None:
    """Neither --quiet nor /dev/null changes a result; what goes to a pipe has a line for every update."""
    path = config(made, "unseen", NAMED + "window_s = 8.0\nupdate_s = 0.5\n")
    before, truth = replayed(made, path)
    out = made / "quiet.json"
    said = run_okid("replay", made / "a.log", "-c", path, "--json", out, "--quiet", status=0)
    assert said.stdout == "" and out.read_bytes() == truth
    out.unlink()
    with open(os.devnull, "w") as null:
        subprocess.run([PROGRAM, "replay", made / "a.log", "-c", path, "--json", out], stdout=null, check=True)
    assert out.read_bytes() == truth
    said = run_okid("replay", made / "a.log", "-c", path, status=0)
    assert said.stdout.count("\nt ") + said.stdout.startswith("t ") >= len(of_type(before, "modes")) > 70


@pytest.mark.realtime
def test_the_stream_does_not_wait(made: Path) -> None:
    """What replay needs for its updates, a live session does not: samples, gaps and counts are there long before."""
    path = config(made, "fast", 'method = "okid-era"\np = 30\nupdate_s = 2.0\n')
    begun = time.monotonic()
    _, truth = replayed(made, path)
    replay_s = time.monotonic() - begun
    _, result, took = fed(made, path)
    assert result == truth and took < replay_s / 4


def test_the_last_update_is_made(made: Path) -> None:
    path = config(made, "last", NAMED + "update_s = 0.05\n")
    before, _ = replayed(made, path)
    events, _, _ = fed(made, path)
    last = of_type(events, "modes")[-1]
    assert last["t"] == of_type(before, "modes")[-1]["t"]
    assert [one["type"] for one in events[-2:]] == ["stats", "result"]


def test_left_alone_nothing_is_left_out(made: Path) -> None:
    """A session that gets its samples in their own time makes every update."""
    path = config(made, "calm", NAMED + "update_s = 2.0\n")
    before, _ = replayed(made, path)
    with Capture(path, live=True) as live:
        live.open(made / "a.log")
        while live.play(800) == 800:  # two frames a sample: 2 s

            def caught_up() -> bool:
                live.serve()
                return live.stats()["updates"]["made"] >= live.stats()["t"] // 2

            until(caught_up)
        live.finish()
        told = of_type(live.events(), "stats")[-1]["updates"]
    assert told == of_type(before, "stats")[-1]["updates"]
