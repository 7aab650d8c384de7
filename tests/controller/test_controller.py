# SPDX-License-Identifier: MIT
"""okid on two SJA1000 controllers (kvaser_pci of the stock kernel) that share a bus: settings, overruns, links that go.

What comes past the controller is written down by candump, which shares no line with okid. The emulated controllers have
no bit timing: their bus is as fast as the machine, so that overruns are real, and a bus-off cannot be had.
"""

from __future__ import annotations

import re
import struct
import time
from collections.abc import Iterator
from pathlib import Path

import pytest
from can_run import OKID, Run, bus, make_record, sh
from conftest import Witness, bring_up, flood, interrupts, link, listen, load, on_can0, play
from two_masses import rig_text, simulate_rig

SAMPLES = 3000  # of the record, two frames each
FAST = 2500  # the same, of the one with overruns
OVERRUNS = 20


@pytest.fixture(scope="module")
def record(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return on_can0(make_record(tmp_path_factory.mktemp("record"), 6.0))


@pytest.fixture(scope="module")
def fast(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """4,000 frames a second, as struct can_frame too."""
    text = rig_text(1.25, 2000.0, springs="[1.2e6, 8e5]")
    folder = on_can0(simulate_rig(tmp_path_factory.mktemp("fast"), text, lags=20))
    frames = [line.split()[2].split("#") for line in (folder / "a.log").read_text().splitlines()]
    packed = [struct.pack("=IB3x8s", int(i, 16), len(d) // 2, bytes.fromhex(d)) for i, d in frames]
    for name, first, last in (("head", 0, 400), ("middle", 400, 4600), ("tail", 4600, 2 * FAST)):
        (folder / f"{name}.bin").write_bytes(b"".join(packed[first:last]))
    return folder


def part(folder: Path, name: str, first: int, last: int) -> Path:
    lines = (folder / "a.log").read_text().splitlines(keepends=True)
    (folder / name).write_text("".join(lines[first:last]))
    return folder / name


def gaps_of(events: list[dict]) -> list[dict]:
    return [event for event in events if event["type"] == "gap"]


def missing_by_okid(events: list[dict], channel: str) -> set[int]:
    out: set[int] = set()
    for gap in gaps_of(events):
        if gap["channel"] == channel:
            numbers = set(range(gap["first"], gap["last"] + 1))
            assert len(numbers) == gap["count"] and not numbers & out
            out |= numbers
    return out


def test_a_real_interface_for_the_doctor(record: Path) -> None:
    config = str(record / "a.toml")
    assert "up, 1000000 bit/s, error-active" in sh(OKID, "doctor", config).stdout
    bring_up(250_000)
    done = sh(OKID, "doctor", config, check=False)
    assert done.returncode == 4 and "up, 250000 bit/s, error-active, expected 1000000 bit/s" in done.stdout
    (remedy,) = re.findall(r"sudo (ip link set can0 down); sudo (ip link set can0 up .*)", done.stdout)
    for command in remedy:
        sh(*command.split())
    assert link()["linkinfo"]["info_data"]["bittiming"]["bitrate"] == 1_000_000
    assert "up, 1000000 bit/s, error-active" in sh(OKID, "doctor", config).stdout
    sh("ip", "link", "set", "can0", "down")
    down = sh(OKID, "doctor", config, check=False)
    assert down.returncode == 4 and "is down" in down.stdout
    sh("ip", "link", "set", "can0", "type", "can", "restart-ms", "0")
    sh("ip", "link", "set", "can0", "up", "txqueuelen", "10")
    told = sh(OKID, "doctor", config).stdout
    assert "restart-ms is 0" in told and "txqueuelen is 10" in told


@pytest.mark.parametrize(
    ("bitrate", "options"),
    [
        (125_000, ()),
        (250_000, ("berr-reporting", "on")),
        (500_000, ("loopback", "off")),
        (1_000_000, ("sample-point", "0.75")),
    ],
)
def test_rates_and_modes(record: Path, tmp_path: Path, bitrate: int, options: tuple[str, ...]) -> None:
    """The same frames at every rate, the same model to the last byte."""
    bring_up(bitrate, *options)
    head = part(record, "head.log", 0, 2000)
    live = listen(record)
    play(head, "--speed", "4")
    events = live.stop()
    counts = bus(events)
    assert (counts["received"], counts["lost"], counts["state"]) == (2000, 0, "error-active")
    again = tmp_path / "again.json"
    sh(OKID, "replay", str(head), "-c", str(record / "a.toml"), "--json", str(again))
    assert (record / "r.json").read_bytes() == again.read_bytes()


@pytest.mark.parametrize("run", range(OVERRUNS))
def test_overrun_is_counted_to_the_frame(fast: Path, tmp_path: Path, run: int) -> None:
    """Bursts of 64 frames at the pace of the machine, into a controller that holds five. What candump has not is what
    okid marks, in every channel."""
    live, witness = listen(fast), Witness(tmp_path)
    flood(fast / "head.bin", 4000, processor=0)
    interrupts("can1", 1)  # as two computers have them: now the sender waits for nobody
    flood(fast / "middle.bin", 4000, processor=1)
    interrupts("can1", 0)
    flood(fast / "tail.bin", 4000, processor=0)
    events = live.stop()
    seen = witness.lines()
    data = [line.split("#") for line in seen if not line.startswith("2")]
    counters = [(name, int.from_bytes(bytes.fromhex(text[:4]), "little")) for name, text in data]
    truth = {each: set(range(FAST)) - {n for name, n in counters if name == each} for each in ("100", "101")}
    lost = sum(map(len, truth.values()))
    counts = bus(events)
    told = sum(line.startswith("200") for line in seen)
    print(f"\nrun {run}: {lost} of {2 * FAST} lost, {told} error frames, by okid {counts['lost_by']}")
    assert lost > 0, "the controller kept up: this is no overrun"
    for channel, name in (("force1", "100"), ("acc1", "101"), ("acc2", "101")):
        wrong = sorted(missing_by_okid(events, channel) ^ truth[name])
        assert not wrong, f"{channel}: {len(wrong)} of {len(truth[name])}, {wrong[:10]} ..."
    assert counts["lost"] == lost and counts["received"] == 2 * FAST - lost
    assert counts["errors"]["rx_overflow"] > 0
    by_cause = {cause: counts["lost_by"][cause] for cause in ("driver", "sequence")}
    marked = {cause: 0 for cause in by_cause}
    for gap in gaps_of(events):
        marked[gap["cause"]] += gap["count"] * (gap["channel"] != "acc2")  # it shares its frames with acc1
    assert marked == by_cause and marked["driver"] > 0
    assert [event for event in events if event["type"] == "bus" and event["event"] == "driver_loss"]


@pytest.fixture
def broken(record: Path) -> Iterator[tuple[Run, Path]]:
    """Half of the record was heard; what comes next is lost, then the rest."""
    live = listen(record)
    play(part(record, "one.log", 0, 2400), "--speed", "8")
    time.sleep(0.3)
    yield live, record
    if live.process.poll() is None:
        live.process.kill()


def after_the_break(live: Run, record: Path, first: int, last: int) -> None:
    play(part(record, "three.log", last, 2 * SAMPLES), "--speed", "8")
    events = live.stop()
    found = {(gap["channel"], gap["first"], gap["last"], gap["cause"]) for gap in gaps_of(events)}
    assert found == {(name, first // 2, last // 2 - 1, "link_down") for name in ("force1", "acc1", "acc2")}
    assert bus(events)["lost_by"]["link_down"] == last - first
    told = [event["event"] for event in events if event["type"] == "bus"]
    assert told == ["link_down", "link_up"]
    assert events[-1]["result"]["samples"] == SAMPLES


def test_down_while_the_other_sends(broken: tuple[Run, Path]) -> None:
    live, record = broken
    sh("ip", "link", "set", "can0", "down")
    play(part(record, "two.log", 2400, 3000), "--speed", "8")
    sh("ip", "link", "set", "can0", "up")
    time.sleep(0.5)
    after_the_break(live, record, 2400, 3000)


def test_driver_out_and_in_again(broken: tuple[Run, Path]) -> None:
    live, record = broken
    load(False)
    time.sleep(0.3)
    load(True)
    bring_up()
    time.sleep(0.5)
    after_the_break(live, record, 2400, 3000)


def test_another_bit_rate_while_it_runs(broken: tuple[Run, Path]) -> None:
    """As the remedy of okid doctor does it: down, type can bitrate, up."""
    live, record = broken
    bring_up(500_000)
    time.sleep(0.5)
    after_the_break(live, record, 2400, 3000)


def test_replay_onto_the_bus_keeps_its_times(record: Path) -> None:
    log = part(record, "four.log", 0, 4000)
    live = listen(record)
    begin = time.monotonic()
    said = play(log, "--speed", "2")
    took = time.monotonic() - begin
    events = live.stop()
    assert (bus(events)["received"], bus(events)["lost"]) == (4000, 0)
    assert re.search(r"4000 frames played onto can1; late by \d+ us \(mean\)", said)
    assert took >= 1.95, "4 s of stream, at twice their speed"
    print("\n" + said.strip())
