# SPDX-License-Identifier: MIT
"""Journals through the program: recorded, replayed, converted, damaged, hostile. The buses are replayed logs."""

from __future__ import annotations

import json
import os
import resource
import shutil
import socket
import subprocess
import tomllib
from pathlib import Path
from typing import Any

import journal
import pytest
from program import PROGRAM, okid
from two_masses import rig_text, simulate_rig

SAMPLES, FRAMES = 2000, 4000


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = simulate_rig(tmp_path_factory.mktemp("rig"), rig_text(8.0))
    text = (folder / "a.toml").read_text()
    (folder / "a.toml").write_text(text.replace("update_s = 1.0", "update_s = 4.0\nsigma_blocks = 0"))
    return folder


@pytest.fixture
def rig(made: Path, tmp_path: Path) -> Path:
    for name in ("a.log", "a.csv", "a.dbc", "a.toml"):
        shutil.copy(made / name, tmp_path / name)
    return tmp_path


def config(rig: Path, sections: str = "[record]\n") -> Path:
    text = (rig / "a.toml").read_text().replace('type = "socketcan"', 'type = "replay"\nfile = "a.log"')
    (rig / "run.toml").write_text(f"{text}\n{sections}")
    return rig / "run.toml"


def run(rig: Path, sections: str = "[record]\n", *options: object) -> tuple[list[dict[str, Any]], bytes, str]:
    """Events, the result as bytes, stderr."""
    done = okid("run", config(rig, sections), "--events", rig / "e", "--json", rig / "r", *options)
    assert done.returncode == 0, done.stderr
    return [json.loads(line) for line in (rig / "e").read_text().splitlines()], (rig / "r").read_bytes(), done.stderr


def journals(rig: Path) -> list[Path]:
    return sorted((rig / "runs").glob("*.okj"))


def replay(path: Path, *options: object) -> tuple[bytes, list[dict[str, Any]], str]:
    out, events = path.parent / "again", path.parent / "again.jsonl"
    out.unlink(missing_ok=True)
    done = okid("replay", path, "--json", out, "--events", events, *options)
    assert done.returncode == 0, done.stderr
    return out.read_bytes(), [json.loads(line) for line in events.read_text().splitlines()], done.stderr


def told(events: list[dict[str, Any]]) -> list[str]:
    return [event["event"] for event in events if event["type"] == "record"]


def test_a_run_and_its_journal(rig: Path) -> None:
    events, result, errors = run(rig)
    assert told(events) == ["started", "finished"] and "4000 frames recorded" in errors
    (path,) = journals(rig)
    chunks, rest = journal.read(path)
    assert rest == 0 and chunks[-1].kind == journal.END and chunks[-1].flags == 0
    assert [chunk.sequence for chunk in chunks] == list(range(len(chunks)))
    assert len({chunk.run for chunk in chunks}) == 1
    assert len(journal.frames(path)) == FRAMES
    inside = journal.texts(path)
    assert inside["config"] == (rig / "run.toml").read_bytes()
    assert inside["dbc:a.dbc"] == (rig / "a.dbc").read_bytes()
    head = tomllib.loads(inside["journal"].decode())
    assert head["bus"] == [{"name": "can0", "interface": "vcan0"}] and head["segment"] == 1
    assert f"{chunks[0].run:016x}" == head["run"]
    (rig / "a.dbc").unlink()  # the journal explains itself
    (rig / "run.toml").unlink()
    assert replay(path)[0] == result
    assert replay(path, "--speed", 16)[0] == result
    assert replay(path, "-c", config_without_dbc(rig))[1][-1]["type"] == "result"


def config_without_dbc(rig: Path) -> Path:
    """Another name for the bus, and channels by their bits."""
    (rig / "other.toml").write_text(
        '[acquisition]\nrate_hz = 250\n[[bus]]\nname = "x"\ntype = "socketcan"\ninterface = "can7"\n'
        '[[channel]]\nname = "f"\nrole = "force"\ncan_id = 256\nstart_bit = 16\nlength = 16\nsigned = true\n'
        '[[channel]]\nname = "a"\nrole = "acceleration"\ncan_id = 257\nstart_bit = 16\nlength = 16\nsigned = true\n'
        "[identification]\np = 12\nsigma_blocks = 0\n"
    )
    return rig / "other.toml"


def test_the_duration_of_the_run_is_that_of_the_replay(rig: Path) -> None:
    _, result, _ = run(rig, "[record]\n", "--duration", 5)
    (path,) = journals(rig)
    assert json.loads(result)["samples"] == 1250
    assert replay(path)[0] == result
    assert json.loads(replay(path, "--duration", 3)[0])["samples"] == 750


def test_the_trigger_and_what_came_before_it(rig: Path) -> None:
    section = '[trigger]\nsource = "level"\nlevel = 2.4\npretrigger_s = 0.04\n[record]\npretrigger_s = 0.1\n'
    events, result, _ = run(rig, section)
    (path,) = journals(rig)
    at = next(event["time_s"] for event in events if event["type"] == "trigger")
    first = journal.frames(path)[0].time_ns / 1e9
    assert at - 0.1 <= first < at - 0.1 + 2 / 250
    assert tomllib.loads(journal.texts(path)["journal"].decode())["trigger_ns"] == round(at * 1e9)
    assert replay(path)[0] == result


def test_nothing_is_written_when_the_trigger_never_comes(rig: Path) -> None:
    done = okid("run", config(rig, '[trigger]\nsource = "level"\nlevel = 1e6\n[record]\n'))
    assert done.returncode == 3 and "the trigger never came" in done.stderr
    assert journals(rig) == []
    done = okid("record", rig / "run.toml")
    assert done.returncode == 3 and "the trigger never came" in done.stderr
    assert journals(rig) == []


def long_log(rig: Path, times: int) -> None:
    """The same frames over and over, later and later."""
    lines = (rig / "a.log").read_text().splitlines()
    with (rig / "a.log").open("w") as out:
        for k in range(times):
            for line in lines:
                stamp, rest = line.split(" ", 1)
                out.write(f"({float(stamp[1:-1]) + 8.0 * k:.6f}) {rest}\n")


def test_segments(rig: Path) -> None:
    long_log(rig, 10)
    (rig / "runs").mkdir()
    (rig / "runs" / "notes.txt").write_text("mine")
    (rig / "runs" / "old-0001.okj").write_bytes(b"not of okid" * 100000)
    events, result, _ = run(rig, "[record]\nsegment_mb = 0.3\nmax_mb = 0.8\n")
    kinds = told(events)
    assert kinds.count("segment") >= 2 and "deleted" in kinds
    assert (rig / "runs" / "notes.txt").exists() and (rig / "runs" / "old-0001.okj").exists()
    kept = [path for path in journals(rig) if path.name != "old-0001.okj"]
    assert 1 < len(kept) < 1 + kinds.count("segment")
    assert all(path.stat().st_size <= 300000 for path in kept)
    done = okid("run", config(rig, "[record]\nsegment_mb = 0.3\nmax_mb = 100\n"), "--json", rig / "r")
    assert done.returncode == 0, done.stderr
    mine = [path for path in journals(rig) if path not in kept and path.name != "old-0001.okj"]
    assert len(mine) == 1 + kinds.count("segment")
    again, _, errors = replay(mine[0])
    assert again == result
    assert f"and the {len(mine) - 1} segments behind it" in errors
    assert "not there" not in errors
    mine[1].unlink()
    part, _, errors = replay(mine[0])
    assert json.loads(part)["samples"] < 10 * SAMPLES
    assert "the segment behind the last one read is not there" in errors
    with (rig / "whole.okj").open("wb") as out:
        for path in kept:
            out.write(path.read_bytes())
    assert replay(rig / "whole.okj")[1][-1]["type"] == "result"


def test_a_journal_tells_no_password_and_opens_nothing(rig: Path) -> None:
    section = '[record]\n[publish]\nsocket = "live.sock"\nmqtt = "mqtt://me:secret@127.0.0.1:1/rig"\n'
    run(rig, section)
    (path,) = journals(rig)
    inside = journal.texts(path)["config"].decode()
    assert "secret" not in path.read_bytes().decode("latin-1") and 'mqtt = "mqtt://…@127.0.0.1:1/rig"' in inside
    taken = socket.socket(socket.AF_UNIX)
    taken.bind(str(path.parent / "live.sock"))
    taken.listen(1)
    assert "mqtt" not in replay(path)[2]
    taken.close()


def test_two_runs_in_one_second_do_not_share_a_file(rig: Path) -> None:
    path = config(rig)
    started = [subprocess.Popen([PROGRAM, "record", str(path)], stdout=subprocess.DEVNULL) for _ in range(4)]
    assert [process.wait(1800) for process in started] == [0] * 4
    assert len(journals(rig)) == 4 and not list((rig / "runs").glob("*.part"))
    for one in journals(rig):
        assert len(journal.frames(one)) == FRAMES


def test_record_alone(rig: Path) -> None:
    done = okid("record", config(rig, ""), "--directory", rig / "there")
    assert done.returncode == 0, done.stderr
    assert "channel force1: 2000 of 2000 samples, 100 %" in done.stdout
    (path,) = (rig / "there").glob("*.okj")
    assert len(journal.frames(path)) == FRAMES
    done = okid("record", rig / "run.toml", "--duration", 2, "--directory", rig / "short")
    assert done.returncode == 0 and "force1: 500 of 500" in done.stdout, done.stdout
    (rig / "a.log").write_text("")
    done = okid("record", rig / "run.toml")
    assert done.returncode == 3 and "no frame was received" in done.stderr


def convert(*arguments: object) -> subprocess.CompletedProcess[str]:
    done = okid("convert", *arguments)
    assert done.returncode == 0, done.stderr
    return done


def test_round_trips(rig: Path) -> None:
    log = rig / "a.log"
    lines = log.read_text().splitlines()
    lines[5:5] = ["(1700000000.011000) can9 18F02D05##3" + "AB" * 64, "(1700000000.011000) vcan0 7FF#"]
    log.write_text("\n".join(lines) + "\n")
    convert(log, rig / "b.okj")
    convert(rig / "b.okj", rig / "b.log")
    assert (rig / "b.log").read_bytes() == log.read_bytes()
    assert "config" not in journal.texts(rig / "b.okj")
    convert(log, rig / "c.okj", "-c", rig / "a.toml")
    convert(rig / "c.okj", rig / "c.log")
    assert (rig / "c.log").read_text().splitlines() == [line for line in lines if " can9 " not in line]
    convert(log, rig / "direct.csv", "-c", rig / "a.toml")
    convert(rig / "c.okj", rig / "c.csv")
    convert(rig / "b.okj", rig / "b.csv", "-c", rig / "a.toml")
    assert (rig / "c.csv").read_bytes() == (rig / "b.csv").read_bytes() == (rig / "direct.csv").read_bytes()
    convert(rig / "c.csv", rig / "d.log", "-c", rig / "a.toml")
    convert(rig / "d.log", rig / "d.csv", "-c", rig / "a.toml")
    assert (rig / "d.csv").read_bytes() == (rig / "c.csv").read_bytes()
    assert "holds no config: keep the journal" in convert(rig / "c.okj", rig / "e.log").stderr
    assert not list(rig.glob("*.??????"))  # no temporary is left


@pytest.mark.parametrize(
    ("names", "options", "words"),
    [
        (("a.log", "b.xyz"), (), 'found ".log" to ".xyz", expected .okj to .log'),
        (("a.log", "b.csv"), (), "-c CONFIG.toml is missing"),
        (("bare.okj", "b.csv"), (), "it holds no complete config: give -c CONFIG.toml"),
        (("none.okj", "b.log"), (), "none.okj: cannot be read: No such file"),
        (("text.okj", "b.log"), (), "found no whole chunk of a journal, expected a file of okid record"),
        (("late.okj", "b.log"), (), "a journal of version 2, expected at most version 1: a later okid wrote it"),
        (("empty.log", "b.okj"), (), "found no frame"),
        (("bare.okj", "b.log/c.log"), (), "cannot be written"),
    ],
)
def test_what_cannot_be_converted(rig: Path, names: tuple[str, str], options: tuple[str, ...], words: str) -> None:
    convert(rig / "a.log", rig / "bare.okj")
    (rig / "text.okj").write_text("not a journal\n" * 100)
    (rig / "empty.log").write_text("")
    late = bytearray(journal.seal(journal.END, b""))
    late[8] = 2
    (rig / "late.okj").write_bytes(bytes(late[:60]) + journal.zlib.crc32(bytes(late[:60])).to_bytes(4, "little"))
    done = okid("convert", rig / names[0], rig / names[1], *options)
    assert done.returncode == 2 and words in done.stderr, done.stderr
    assert not (rig / names[1]).exists()
    if names[0].endswith(".okj") and "cannot be written" not in words:
        done = okid("replay", rig / names[0])
        assert done.returncode == 2 and done.stderr.startswith("okid: "), done.stderr


def test_a_damaged_journal(rig: Path) -> None:
    convert(rig / "a.log", rig / "b.okj", "-c", rig / "a.toml")
    whole = (rig / "b.okj").read_bytes()
    chunks, _ = journal.read(rig / "b.okj")
    hit = next(chunk for chunk in chunks if chunk.kind == journal.FRAMES and chunk.sequence > 10)
    bent = bytearray(whole)
    bent[hit.at + 100] ^= 4
    (rig / "b.okj").write_bytes(bent)
    result, events, errors = replay(rig / "b.okj")
    assert "damaged in 1 place: 1 chunks are missing" in errors
    gaps = [event for event in events if event["type"] == "gap" and event["channel"] == "force1"]
    lost = sorted({int.from_bytes(f.data[:2], "little") for f in hit.frames() if f.id == 256})
    assert [gap["cause"] for gap in gaps] == ["driver"]
    assert sum(gap["count"] for gap in gaps) == len(lost)
    assert json.loads(result)["gaps"] == 1
    (rig / "b.okj").write_bytes(whole[: chunks[-3].at + 70])
    _, _, errors = replay(rig / "b.okj")
    assert "was not closed" in errors and "70 bytes behind it were left out" in errors
    bent = bytearray(whole)
    bent[chunks[1].at + 80] ^= 1  # the config itself
    (rig / "b.okj").write_bytes(bent)
    done = okid("replay", rig / "b.okj")
    assert done.returncode == 2 and "the config in it is damaged; give -c CONFIG.toml" in done.stderr
    assert replay(rig / "b.okj", "-c", rig / "a.toml")[1][-1]["result"]["samples"] == SAMPLES


@pytest.mark.parametrize(
    ("section", "words"),
    [
        ("segment_mb = 0.1", 'key "segment_mb": found 0.1, expected at least 0.2'),
        ("segment_mb = 5\nmax_mb = 9", 'key "max_mb": found 9, expected room for two segments, 10'),
        ("segmentmb = 5", 'did you mean "segment_mb"?'),
        ('directory = "a.log/x"', "journals cannot be written there: Not a directory"),
        (
            'pretrigger_s = 90000\n[trigger]\nsource = "level"\nlevel = 1.0',
            "[record] pretrigger_s: 90000 s of these buses are up to",
        ),
    ],
)
def test_what_a_config_cannot_ask_for(rig: Path, section: str, words: str) -> None:
    for command in ("run", "record"):
        done = okid(command, config(rig, f"[record]\n{section}\n"))
        assert done.returncode == 2 and words in done.stderr, done.stderr


def limited(rig: Path, command: str, *options: object) -> subprocess.CompletedProcess[str]:
    """No file may grow beyond 40,000 bytes: half of the journal."""

    def limit() -> None:
        resource.setrlimit(resource.RLIMIT_FSIZE, (40000, 40000))

    return subprocess.run(
        [PROGRAM, command, str(config(rig)), *map(str, options)],
        capture_output=True,
        text=True,
        timeout=1800,
        preexec_fn=limit,
        check=False,
    )


def test_a_full_disk_ends_the_recording_and_nothing_else(rig: Path) -> None:
    events, result, _ = run(rig)
    (whole,) = journals(rig)
    done = limited(rig, "run", "--events", rig / "e", "--json", rig / "r")
    assert done.returncode == 0, done.stderr
    assert "recording stopped: " in done.stderr and "File too large" in done.stderr
    assert (rig / "r").read_bytes() == result
    after = [json.loads(line) for line in (rig / "e").read_text().splitlines()]
    assert told(after) == ["started", "stopped"]
    assert [e for e in after if e["type"] == "modes"] == [e for e in events if e["type"] == "modes"]
    (path,) = set(journals(rig)) - {whole}
    chunks, rest = journal.read(path)
    assert rest == 0 and path.stat().st_size <= 40000
    some = journal.frames(path)
    assert some == journal.frames(whole)[: len(some)]
    done = limited(rig, "record")
    assert done.returncode == 4 and done.stderr.count("recording stopped") == 1


@pytest.mark.parametrize("most_s", [None, pytest.param(20, marks=pytest.mark.realtime)], ids=["memory", "time"])
def test_hostile_journals_cost_bounded_memory_and_time(rig: Path, most_s: int | None) -> None:
    convert(rig / "a.log", rig / "good.okj", "-c", rig / "a.toml")
    good = (rig / "good.okj").read_bytes()
    names = b"".join(
        journal.seal(journal.TEXT, b"\4\0\0\0" + b"\xff" * 7 + b"\0" + b"\0" * 8 + k.to_bytes(4, "little"), sequence=k)
        for k in range(100000)
    )
    evil = {
        "magic": journal.MAGIC * 4000000,
        "noise": os.urandom(1 << 24),
        "huge": journal.seal(journal.FRAMES, b"", size=0xFFFFFFFF) * 100000,
        "count": journal.seal(journal.FRAMES, b"\0" * 16, count=0xFFFFFFFF) * 100000,
        "names": names,
        "zeros": bytes(1 << 25),
        "good behind it": os.urandom(1 << 24) + good,
    }

    def limited_to() -> None:
        resource.setrlimit(resource.RLIMIT_AS, (1 << 30, 1 << 30))
        if most_s:
            resource.setrlimit(resource.RLIMIT_CPU, (most_s, most_s))

    for name, data in evil.items():
        (rig / "evil.okj").write_bytes(data)
        done = subprocess.run(
            [PROGRAM, "convert", str(rig / "evil.okj"), str(rig / "evil.log")],
            capture_output=True,
            text=True,
            timeout=1800,
            preexec_fn=limited_to,
            check=False,
        )
        assert done.returncode == (0 if name in ("good behind it", "names") else 2), (name, done.stderr)
    assert len((rig / "evil.log").read_text().splitlines()) == FRAMES
