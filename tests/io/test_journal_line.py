# SPDX-License-Identifier: MIT
"""Recording a live line: killed at random instants, on disks that stall, fill up or fail. Frames are numbered, so every
one is accounted for."""

from __future__ import annotations

import errno
import json
import os
import random
import signal
import struct
import subprocess
import tempfile
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import journal
import program
import pytest
from lines import Line, Run, line, node_config, of_type, packet
from waiting import VIRTUAL, until

RATE = 4000
CHUNK_S = 0.25
DISK = Path(program.PROGRAM).parent / "tests" / "libjournal_disk.so"


def samples() -> list[list[int]]:
    """A noisy force and what two modes make of it, as codes; no two samples alike."""
    draw, out = random.Random(1), []
    one = two = [0.0, 0.0]
    for _ in range(110000):
        force = draw.gauss(0, 3000)
        one = [1.90 * one[0] - 0.98 * one[1] + 0.1 * force, one[0]]
        two = [1.20 * two[0] - 0.97 * two[1] + 0.1 * force, two[0]]
        out.append([round(x) for x in (force, one[0] + two[0], one[0] - two[0])])
    return out


SAMPLES = samples()


def rows(first: int, count: int) -> list[list[int]]:
    return SAMPLES[first : first + count]


def config(folder: Path, sections: str = "[record]\n", rate: int = RATE) -> Path:
    settings = "[identification]\np = 4\nrows = 8\nupdate_s = 0.5\nsigma_blocks = 0\n"
    return node_config(folder, settings + sections, rate, ("force", "acceleration", "acceleration"))


def recorded(folder: Path) -> list[journal.Frame]:
    out = []
    for path in sorted((folder / "runs").glob("*.okj")):
        out += journal.frames(path)
    return out


def check_frames(frames: list[journal.Frame]) -> list[int]:
    """Every number as it was sent. @return the sample numbers"""
    numbers = []
    for frame in frames:
        number, *values = struct.unpack_from("<I4x3d", frame.data)
        assert values == SAMPLES[number]
        numbers.append(number)
    return numbers


class Killed:
    """One recorder, fed in real time, killed after so many seconds."""

    def __init__(self, folder: Path, seconds: float) -> None:
        folder.mkdir()
        self.sent: list[tuple[float, int]] = []  # when a packet was out, and the sample behind it
        tty = Line(folder / "tty")
        process = subprocess.Popen(
            [program.PROGRAM, "record", str(config(folder))], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL
        )
        until(lambda: list((folder / "runs").glob("*.okj")), process)
        size, begin, number = 20, time.monotonic(), 0
        while time.monotonic() < begin + seconds:
            due = int((time.monotonic() - begin) * RATE)
            while number + size <= due:
                tty.write(packet(number, rows(number, size)))
                number += size
                self.sent.append((time.monotonic(), number))
            time.sleep(0.002)
        self.killed_at = time.monotonic()
        process.send_signal(signal.SIGKILL)
        process.wait()
        tty.unplug()
        (self.path,) = (folder / "runs").glob("*.okj")


def kills() -> int:
    return 1000 if os.environ.get("OKID_SLOW") else 30


def test_killed_at_any_instant() -> None:
    """Every file opens and holds the beginning of what was sent, without what came in its last quarter of a second."""
    draw = random.Random(6)
    # In memory where that can be: a disk that makes a write wait is the matter of the tests below.
    folder = tempfile.TemporaryDirectory(dir="/dev/shm" if os.access("/dev/shm", os.W_OK) else None)

    def one(k: int) -> float:
        run = Killed(Path(folder.name) / str(k), draw.random() * 0.6)
        chunks, rest = journal.read(run.path)
        assert chunks and chunks[0].kind == journal.TEXT and chunks[-1].kind != journal.END
        assert rest < 64 + 65536
        numbers = check_frames(journal.frames(run.path))
        assert numbers == list(range(len(numbers)))
        if k % 10 == 0:
            done = program.okid("convert", run.path, run.path.with_suffix(".log"))
            assert done.returncode == 0 and "was not closed" in done.stderr, done.stderr
            assert len(run.path.with_suffix(".log").read_text().splitlines()) == len(numbers)
        missing = [at for at, behind in run.sent if behind > len(numbers)]
        return run.killed_at - missing[0] if missing else 0.0

    with folder, ThreadPoolExecutor(6) as pool:
        lost_s = sorted(pool.map(one, range(kills())))
    print(f"lost at a kill: median {1e3 * lost_s[len(lost_s) // 2]:.0f} ms, worst {1e3 * lost_s[-1]:.0f} ms")
    assert lost_s[-1] <= CHUNK_S + 0.005 or not VIRTUAL  # its clock and ours are read one after the other


def disk_run(folder: Path, *options: object, rate: int = RATE, samples: int = 0) -> Run:
    os.environ.update(LD_PRELOAD=str(DISK), OKID_STALL=f"{folder}/stall", OKID_DISK_ERROR=f"{folder}/error")
    try:
        return Run(config(folder, rate=rate), "--duration", samples / rate, *options)
    finally:
        for name in ("LD_PRELOAD", "OKID_STALL", "OKID_DISK_ERROR"):
            del os.environ[name]


def feed(tty: Line, first: int, count: int) -> None:
    for number in range(first, first + count, 20):
        tty.write(packet(number, rows(number, min(20, first + count - number))))


RING = 65536


@pytest.mark.parametrize("behind", [16000, 80000])
def test_a_disk_that_stalls(tmp_path: Path, behind: int) -> None:
    """2 s and 10 s of 8,000 frames a second: none is lost, or those beyond the ring, told to the frame. The samples are
    identified all the same, while the disk stands still."""
    rate, before, after = 8000, 8000, 4000
    samples = before + behind + after
    with line(tmp_path / "tty") as tty:
        run = disk_run(tmp_path, rate=rate, samples=samples)
        until(lambda: list((tmp_path / "runs").glob("*.okj")), run.process)
        feed(tty, 0, before)
        until(lambda: len(recorded(tmp_path)) == before, run.process)
        (tmp_path / "stall").touch()
        feed(tty, before, behind)
        until(lambda: any(e["t"] >= (before + behind) / rate for e in of_type(run.events(), "modes")), run.process)
        assert len(recorded(tmp_path)) == before
        (tmp_path / "stall").unlink()
        until(lambda: check_frames(recorded(tmp_path)[-1:]) == [before + behind - 1], run.process)
        feed(tty, before + behind, after)
        events = run.finish()
    frames = recorded(tmp_path)
    numbers = check_frames(frames)
    missing = sorted(set(range(samples)) - set(numbers))
    lost = len(missing)
    assert numbers == sorted(numbers) and lost == samples - len(numbers)
    if behind > RING:  # all but what the ring holds and what the recorder had in hand when the disk stood still
        assert missing == list(range(before + behind - RING - lost, before + behind - RING))
        assert 0 <= missing[0] - before <= 1024
    else:
        assert missing == []
    chunks = [chunk for path in (tmp_path / "runs").glob("*.okj") for chunk in journal.read(path)[0]]
    assert [chunk.lost for chunk in chunks if chunk.lost] == ([lost] if lost else [])
    marked = [n for n, frame in zip(numbers, frames, strict=True) if frame.loss]
    assert marked == ([missing[-1] + 1] if lost else [])
    stats = of_type(events, "stats")[-1]["bus"]["node"]
    assert (stats["received"], stats["lost"]) == (samples, 0)
    assert of_type(events, "gap") == []
    told = [event["event"] for event in of_type(events, "record")]
    assert told == (["started", "lost", "finished"] if lost else ["started", "finished"])


@pytest.mark.parametrize("code", [errno.ENOSPC, errno.EIO])
def test_a_disk_that_fills_up_or_breaks(tmp_path: Path, code: int) -> None:
    """Recording ends and says so, at once; identification goes on to its end; the file is whole."""
    before, after = 4000, 12000
    with line(tmp_path / "tty") as tty:
        run = disk_run(tmp_path, samples=before + after)
        until(lambda: list((tmp_path / "runs").glob("*.okj")), run.process)
        feed(tty, 0, before)
        until(lambda: len(recorded(tmp_path)) == before, run.process)
        (tmp_path / "error").write_text(str(code))
        feed(tty, before, after // 2)
        until(lambda: "stopped" in [e["event"] for e in of_type(run.events(), "record")], run.process)
        feed(tty, before + after // 2, after // 2)
        events = run.finish()
    assert run.stderr.count("recording stopped: ") == 1 and os.strerror(code) in run.stderr
    assert of_type(events, "stats")[-1]["bus"]["node"]["received"] == before + after
    assert events[-1]["type"] == "result"
    (path,) = (tmp_path / "runs").glob("*.okj")
    assert journal.read(path)[1] == 0
    numbers = check_frames(journal.frames(path))
    assert numbers == list(range(len(numbers))) and before <= len(numbers) < before + after


def test_a_live_run_and_its_replay_are_byte_identical(tmp_path: Path) -> None:
    """Ended by --duration while frames still come, and by SIGINT."""
    for k, options in enumerate((("--duration", 2), ())):
        folder = tmp_path / str(k)
        folder.mkdir()
        with line(folder / "tty") as tty:
            run = Run(config(folder), "--json", folder / "live.json", *options)
            until(lambda at=folder: list((at / "runs").glob("*.okj")), run.process)
            feed(tty, 0, 8400)  # those beyond the duration fit into the line, whoever reads them
            if not options:
                until(lambda at=folder: len(recorded(at)) == 8400, run.process)
                run.stop()
            run.finish()
        (path,) = (folder / "runs").glob("*.okj")
        done = program.okid("replay", path, "--json", folder / "again.json")
        assert done.returncode == 0, done.stderr
        assert (folder / "again.json").read_bytes() == (folder / "live.json").read_bytes()
        assert json.loads((folder / "live.json").read_text())["samples"] == (8000 if options else 8400)


def test_a_run_after_a_kill_begins_another_file(tmp_path: Path) -> None:
    first = Killed(tmp_path / "a", 0.4).path
    before = first.read_bytes()
    with line(tmp_path / "a" / "tty") as tty:
        run = Run(tmp_path / "a" / "node.toml", "--duration", 1)
        until(lambda: len(list((tmp_path / "a" / "runs").glob("*.okj"))) == 2, run.process)
        feed(tty, 0, RATE)
        run.finish()
    assert first.read_bytes() == before
    (second,) = set((tmp_path / "a" / "runs").glob("*.okj")) - {first}
    assert len(journal.frames(second)) == RATE
