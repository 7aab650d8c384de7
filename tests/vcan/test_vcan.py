# SPDX-License-Identifier: MIT
"""okid on a real CAN interface (vcan0): can-utils on one side, okid on the other. Run by tests/kernel/run."""

from __future__ import annotations

import json
import re
import signal
import time
from pathlib import Path

import pytest
from can_run import OKID, Run, bus, make_record, sh


@pytest.fixture(scope="module")
def short(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return make_record(tmp_path_factory.mktemp("short"), 6.0)


@pytest.fixture(scope="module")
def long(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return make_record(tmp_path_factory.mktemp("long"), 60.0)


@pytest.fixture(autouse=True)
def interface() -> None:
    """Every test begins with vcan0 up and able to carry FD."""
    sh("ip", "link", "add", "vcan0", "type", "vcan", check=False)
    sh("ip", "link", "set", "vcan0", "mtu", "72", check=False)
    sh("ip", "link", "set", "vcan0", "up")


def play(log: Path, *options: str) -> None:
    sh("canplayer", "-I", str(log), *options)


def replayed(folder: Path, log: str = "a.log") -> bytes:
    sh(
        OKID,
        "replay",
        str(folder / log),
        "-c",
        str(folder / "a.toml"),
        "--speed",
        "max",
        "--json",
        str(folder / "replay.json"),
    )
    return (folder / "replay.json").read_bytes()


def part(folder: Path, name: str, first: int, last: int) -> Path:
    lines = (folder / "a.log").read_text().splitlines(keepends=True)
    (folder / name).write_text("".join(lines[first:last]))
    return folder / name


def test_canplayer_in_real_time_equals_replay(short: Path) -> None:
    live = Run(short)
    play(short / "a.log")
    events = live.stop()
    assert [e["type"] for e in events][0] == "start"
    assert [e["type"] for e in events][-2:] == ["stats", "result"]
    assert bus(events)["received"] == 6000
    assert bus(events)["lost"] == 0
    assert all(c["missing"] == 0 for c in events[-2]["channel"].values())
    assert not [e for e in events if e["type"] == "gap"]
    assert (short / "r.json").read_bytes() == replayed(short)
    assert events[-1]["result"] == json.loads((short / "r.json").read_text())


def test_duration_ends_at_the_exact_sample(short: Path) -> None:
    live = Run(short, "--duration", "4")
    play(short / "a.log", "-t")
    assert live.process.wait(1800) == 0
    events = live.events()
    assert events[-1]["t"] == 4.0
    assert events[-1]["result"]["samples"] == 2000


def test_burst_of_20000_frames_into_a_stopped_reader(long: Path) -> None:
    live = Run(long)
    log = part(long, "burst.log", 0, 20000)
    live.process.send_signal(signal.SIGSTOP)
    play(log, "-t")
    live.process.send_signal(signal.SIGCONT)
    events = live.stop()
    assert bus(events)["received"] == 20000
    assert bus(events)["lost"] == 0
    assert (long / "r.json").read_bytes() == replayed(long, "burst.log")


def test_flat_out_60000_frames(long: Path) -> None:
    live = Run(long)
    play(long / "a.log", "-t")
    events = live.stop(signal.SIGTERM)
    assert bus(events)["received"] == 60000
    assert bus(events)["lost"] == 0
    assert (long / "r.json").read_bytes() == replayed(long)


def test_overflow_is_counted_placed_and_named(long: Path) -> None:
    """More than the buffer of a user without rights holds while nobody reads: every lost frame counted once, the tail
    included."""
    live = Run(long, under=("setpriv", "--bounding-set=-net_admin", "--inh-caps=-net_admin"))
    play(part(long, "head.log", 0, 4000), "-t")
    time.sleep(0.5)
    live.process.send_signal(signal.SIGSTOP)
    play(part(long, "middle.log", 4000, 56000), "-t")
    live.process.send_signal(signal.SIGCONT)
    time.sleep(1.0)
    play(part(long, "tail.log", 56000, 60000), "-t")
    events = live.stop()
    counts = bus(events)
    assert counts["lost_by"]["socket_overflow"] > 1000
    assert counts["received"] + counts["lost"] == 60000
    assert counts["lost"] == counts["lost_by"]["socket_overflow"]
    gaps = [e for e in events if e["type"] == "gap"]
    assert {e["cause"] for e in gaps} == {"socket_overflow"}
    for name, channel in events[-2]["channel"].items():
        assert channel["missing"] == sum(g["count"] for g in gaps if g["channel"] == name)


def test_dropped_frames_are_gaps(short: Path) -> None:
    lines = (short / "a.log").read_text().splitlines(keepends=True)
    lost = [line for i, line in enumerate(lines) if 2000 <= i < 2040 and " 101#" in line]
    (short / "holes.log").write_text("".join(line for line in lines if line not in lost))
    live = Run(short)
    play(short / "holes.log", "-t")
    events = live.stop()
    gaps = [e for e in events if e["type"] == "gap"]
    assert {(g["channel"], g["first"], g["last"], g["count"], g["cause"]) for g in gaps} == {
        (name, 1000, 1019, 20, "sequence") for name in ("acc1", "acc2")
    }
    assert bus(events)["lost_by"]["sequence"] == 20


def test_link_down_and_up(short: Path) -> None:
    live = Run(short)
    play(part(short, "one.log", 0, 2400), "-t")
    time.sleep(0.3)
    sh("ip", "link", "set", "vcan0", "down")
    time.sleep(0.3)
    sh("ip", "link", "set", "vcan0", "up")
    time.sleep(0.3)
    play(part(short, "two.log", 2600, 6000), "-t")
    events = live.stop()
    gaps = [e for e in events if e["type"] == "gap"]
    assert {(g["first"], g["last"], g["cause"]) for g in gaps} == {(1200, 1299, "link_down")}
    assert events[-1]["result"]["samples"] == 3000
    assert "went down" in live.messages()


def test_frames_that_waited_when_the_link_went_down(short: Path) -> None:
    """They are no loss, and the gap is behind them, though the kernel tells of the link before it hands them out."""
    live = Run(short)
    play(part(short, "one.log", 0, 1200), "-t")
    time.sleep(0.3)
    live.process.send_signal(signal.SIGSTOP)
    play(part(short, "two.log", 1200, 2400), "-t")
    sh("ip", "link", "set", "vcan0", "down")
    live.process.send_signal(signal.SIGCONT)
    time.sleep(0.5)
    sh("ip", "link", "set", "vcan0", "up")
    time.sleep(0.3)
    play(part(short, "three.log", 2600, 6000), "-t")
    events = live.stop()
    gaps = {(e["first"], e["last"], e["cause"]) for e in events if e["type"] == "gap"}
    assert gaps == {(1200, 1299, "link_down")}
    assert [e["event"] for e in events if e["type"] == "bus"] == ["link_down", "link_up"]
    assert (bus(events)["received"], bus(events)["lost_by"]["link_down"]) == (5800, 200)


def test_interface_deleted_and_made_anew(short: Path) -> None:
    live = Run(short)
    play(part(short, "one.log", 0, 2400), "-t")
    time.sleep(0.3)
    sh("ip", "link", "delete", "vcan0")
    time.sleep(0.3)
    sh("ip", "link", "add", "vcan0", "type", "vcan")
    sh("ip", "link", "set", "vcan0", "up")
    time.sleep(0.5)
    play(part(short, "two.log", 2600, 6000), "-t")
    events = live.stop()
    gaps = [e for e in events if e["type"] == "gap"]
    assert {(g["first"], g["last"], g["cause"]) for g in gaps} == {(1200, 1299, "link_down")}
    assert events[-1]["result"]["samples"] == 3000


def test_joined_in_the_middle(short: Path) -> None:
    live = Run(short)
    play(part(short, "middle.log", 1001, 6000), "-t")  # begins with the second frame of a sample
    events = live.stop()
    assert bus(events)["lost"] == 0
    assert events[-1]["result"]["samples"] == 2499


def test_unknown_frames_and_error_frames_are_no_data(short: Path) -> None:
    live = Run(short)
    sh("cansend", "vcan0", "7FF#00")
    sh("cansend", "vcan0", "20000040#0000000000000000")  # bus-off
    sh("cansend", "vcan0", "100#R")
    play(short / "a.log", "-t")
    sh("cansend", "vcan0", "101#00")  # too short
    events = live.stop()
    assert bus(events)["received"] == 6001
    assert bus(events)["decode_errors"] == 1
    assert bus(events)["lost"] == 0


def test_replay_onto_the_bus(short: Path) -> None:
    live = Run(short)
    sh(OKID, "replay", str(short / "a.log"), "--to", "vcan0", "--speed", "4")
    events = live.stop()
    assert bus(events)["lost"] == 0
    assert (short / "r.json").read_bytes() == replayed(short)


def test_no_frames_no_result(short: Path) -> None:
    live = Run(short, "--duration", "1")
    assert live.process.wait(1800) == 3
    assert "no usable frame of channel" in live.messages()
    assert [e["type"] for e in live.events()] == ["start", "stats"]
    assert not (short / "r.json").exists()


@pytest.mark.parametrize("filtered", [True, False])
def test_what_comes_instead_is_named(short: Path, filtered: bool) -> None:
    """While it runs: with a filter in the kernel, and with all frames let in for the load of the bus."""
    text = (short / "a.toml").read_text()
    assert "bitrate" in text
    (short / "b.toml").write_text(re.sub(r"bitrate = .*\n", "", text) if filtered else text)
    log = (short / "a.log").read_text()
    (short / "b.log").write_text(log.replace(" 101#", " 155#"))
    live = Run(short, config="b.toml")
    play(short / "b.log")
    events = live.stop(status=3)
    said = [event["text"] for event in events if event["type"] == "bus" and event["event"] == "unheard"]
    assert len(said) == 1 and said[0] in live.messages()
    assert re.fullmatch(r"no frame of 0x101 \(.*\) so far; the bus carries 0x155 \(\d+ frames\)", said[0]), said
    assert "it carries 0x155" in live.messages()


def test_wrong_interfaces(short: Path) -> None:
    text = (short / "a.toml").read_text()
    (short / "b.toml").write_text(text.replace('"vcan0"', '"vcan7"'))
    absent = sh(OKID, "run", str(short / "b.toml"), check=False)
    assert absent.returncode == 4
    assert "vcan7: there is no such interface" in absent.stderr and "CAN interfaces found: vcan0" in absent.stderr
    (short / "b.toml").write_text(text.replace('"vcan0"', '"lo"'))
    other = sh(OKID, "run", str(short / "b.toml"), check=False)
    assert other.returncode == 4 and "is not a CAN interface" in other.stderr
    sh("ip", "link", "set", "vcan0", "down")
    down = sh(OKID, "run", str(short / "a.toml"), check=False)
    assert down.returncode == 4 and "ip link set vcan0 up" in down.stderr
    doctor = sh(OKID, "doctor", str(short / "a.toml"), check=False)
    assert doctor.returncode == 4 and "is down" in doctor.stdout


def test_doctor_is_content(short: Path) -> None:
    assert "AF_CAN and can-raw answer" in sh(OKID, "doctor", str(short / "a.toml")).stdout


def test_fd_frames(tmp_path: Path) -> None:
    """A 16-byte FD frame with a big-endian counter."""
    (tmp_path / "a.toml").write_text(
        """
[acquisition]
rate_hz = 100.0
[[bus]]
name = "can0"
interface = "vcan0"
fd = true
"""
        + "".join(
            f"""
[[channel]]
name = "{name}"
role = "{role}"
can_id = 0x18F02D00
start_bit = {7 + 16 * i}
length = 16
byte_order = "big"
signed = true
scale = 0.01
sequence = {{ start_bit = 7, length = 16, byte_order = "big" }}
"""
            for i, (name, role) in enumerate([("f", "force"), ("a", "acceleration")], start=3)
        )
    )
    rows = ["f,a"] + [f"{((n * 7919) % 211 - 105) / 10},{((n * 104729) % 223 - 111) / 10}" for n in range(300)]
    (tmp_path / "in.csv").write_text("# fs_hz: 100\n" + "\n".join(rows) + "\n")
    sh(OKID, "convert", str(tmp_path / "in.csv"), str(tmp_path / "fd.log"), "-c", str(tmp_path / "a.toml"))
    assert "##0" in (tmp_path / "fd.log").read_text()
    live = Run(tmp_path)
    sh(OKID, "replay", str(tmp_path / "fd.log"), "--to", "vcan0", "--speed", "max")
    time.sleep(0.3)
    live.process.send_signal(signal.SIGINT)
    assert live.process.wait(1800) in (0, 3)  # noise: whether it makes a model does not matter here
    counts = bus(live.events())
    assert (counts["received"], counts["lost"], counts["decode_errors"]) == (300, 0, 0)
