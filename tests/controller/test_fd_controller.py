# SPDX-License-Identifier: MIT
"""okid on a CAN FD controller (CTU CAN FD, driver ctucanfd) with two ports on one bus: frames of 64 bytes, overruns,
down and up.

The emulated bus has no bit timing; the driver reads a state out of this model that says "stopped" whatever happens.
"""

from __future__ import annotations

import csv
import json
import os
import time
from pathlib import Path

import pytest
from can_run import OKID, bus, sh
from conftest import THERE, Witness, batch, end, interrupts, link, listen

OURS, THEIRS = "fd0", "fd1"
SETTINGS = "type can bitrate 500000 dbitrate 4000000 fd on berr-reporting on"
VALUES = 30  # numbers of 16 bits in a frame, behind a counter of 32
RATE = 500
CONFIG = f"""
[acquisition]
rate_hz = {RATE}
[[bus]]
name = "can0"
interface = "{OURS}"
fd = true
bitrate = 500000
dbitrate = 4000000
[identification]
method = "okid-era"
p = 4
rows = 8
sigma = "none"
[record]
directory = "runs"
""" + "".join(
    f'[[channel]]\nname = "c{k}"\nrole = "{"force" if k == 0 else "acceleration"}"\ncan_id = 0x123\n'
    f"start_bit = {32 + 16 * k}\nlength = 16\nsigned = true\nsequence = {{ start_bit = 0, length = 32 }}\n"
    for k in range(VALUES)
)


def values(number: int) -> list[int]:
    return [(1009 * number + 31 * k * k) % 65521 - 32760 for k in range(VALUES)]


def log_line(number: int) -> str:
    data = number.to_bytes(4, "little") + b"".join((v & 0xFFFF).to_bytes(2, "little") for v in values(number))
    return f"({1700000000 + number / RATE:.6f}) {OURS} 123##1{data.hex().upper()}\n"


@pytest.fixture(scope="module")
def ports() -> None:
    sh("modprobe", "-d", os.environ["OKID_STOCK"], "can_dev")
    before = {each.name for each in Path("/sys/class/net").iterdir()}
    for name in ("ctucanfd", "ctucanfd_pci"):
        sh("insmod", f"{os.environ['OKID_CTUCAN']}/{name}.ko")
    made = sorted({each.name for each in Path("/sys/class/net").iterdir()} - before)
    assert len(made) == 2
    batch("netns add sender", force=True)
    batch(f"link set {made[0]} name {OURS}", f"link set {made[1]} name {THEIRS}", f"link set {THEIRS} netns sender")


@pytest.fixture
def folder(ports: None, tmp_path: Path) -> Path:
    for where, name in (((), OURS), (("-n", "sender"), THEIRS)):
        batch(f"link set {name} down", f"link set {name} up txqueuelen 1000 {SETTINGS}", where=where)
    interrupts(OURS, 0)  # both ports have the same
    (tmp_path / "a.toml").write_text(CONFIG)
    return tmp_path


def play(folder: Path, first: int, last: int, *options: str, processor: int = 0) -> None:
    """By the other port; on the processor that takes the interrupts the sender waits for the receiver's driver."""
    (folder / "part.log").write_text("".join(map(log_line, range(first, last))))
    words = ("taskset", "-c", str(processor), OKID, "replay", str(folder / "part.log"), "--to", THEIRS, *options)
    sh(*THERE, *words)


def rows_of(folder: Path) -> list[list[str]]:
    (journal,) = (folder / "runs").glob("*.okj")
    sh(OKID, "convert", str(journal), str(folder / "out.csv"))
    with (folder / "out.csv").open() as text:
        table = list(csv.reader(line for line in text if not line.startswith("#")))
    columns = [table[0].index(next(x for x in table[0] if x.split(" ")[0] == f"c{k}")) for k in range(VALUES)]
    return [[row[at] for at in columns] for row in table[1:]]


def test_frames_of_64_bytes_at_the_rate_of_fd(folder: Path) -> None:
    told = " ".join(sh(OKID, "doctor", str(folder / "a.toml"), check=False).stdout.split())
    assert f"bus can0 ({OURS}) up, 500000 bit/s (data 4000000 bit/s)" in told
    live = listen(folder, interface=OURS)
    play(folder, 0, 2000)
    events = end(live)
    counts = bus(events)
    assert (counts["received"], counts["lost"]) == (2000, 0)
    assert 0 < counts["load_percent"] < 100
    rows = rows_of(folder)
    assert len(rows) == 2000
    for number, row in enumerate(rows):
        assert [float(text) for text in row] == values(number), number


def test_overrun_is_counted_to_the_frame(folder: Path) -> None:
    """What candump has not is what okid marks."""
    live, witness = listen(folder, interface=OURS), Witness(folder, OURS)
    play(folder, 0, 400, "--speed", "4")
    play(folder, 400, 8400, "--speed", "max", processor=1)  # the sender waits for nobody
    play(folder, 8400, 9000, "--speed", "4")
    events = end(live)
    seen = witness.lines()
    frames = [
        line for line in seen if line.startswith("123##")
    ]  # a digit of flags follows: no two drivers set the same
    heard = {int.from_bytes(bytes.fromhex(line[6:14]), "little") for line in frames}
    lost = set(range(9000)) - heard
    counts = bus(events)
    print(f"\n{len(lost)} of 9000 lost, {sum(x.startswith('2') for x in seen)} error frames, {counts['lost_by']}")
    assert heard and lost, f"the controller kept up: this is no overrun; {seen[:3]}"
    marked: set[int] = set()
    for gap in events:
        if gap["type"] == "gap" and gap["channel"] == "c0":
            marked |= set(range(gap["first"], gap["last"] + 1))
    assert marked == lost
    assert (counts["received"], counts["lost"]) == (9000 - len(lost), len(lost))


def test_down_and_up(folder: Path) -> None:
    live = listen(folder, interface=OURS)
    play(folder, 0, 1000, "--speed", "4")
    time.sleep(0.3)
    sh("ip", "link", "set", OURS, "down")
    play(folder, 1000, 1300, "--speed", "4")
    batch(f"link set {OURS} up {SETTINGS}")
    assert link(OURS)["linkinfo"]["info_data"]["data_bittiming"]["bitrate"] == 4_000_000
    time.sleep(0.5)
    play(folder, 1300, 2000, "--speed", "4")
    events = end(live)
    holes = [event for event in events if event["type"] == "gap" and event["channel"] == "c0"]
    assert [(hole["first"], hole["last"], hole["cause"]) for hole in holes] == [(1000, 1299, "link_down")]
    counts = bus(events)
    assert (counts["received"], counts["lost_by"]["link_down"]) == (1700, 300)
    told = [event["event"] for event in events if event["type"] == "bus"]
    assert told == ["link_down", "link_up"], json.dumps(told)
