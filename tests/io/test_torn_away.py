# SPDX-License-Identifier: MIT
"""The processor is taken away from program and senders: lines that stall, the whole program stopped, processors busy.

Whoever is late is late, and nothing is missing.
OKID_SLOW=1: for a minute.
"""

from __future__ import annotations

import contextlib
import csv
import os
import random
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from pathlib import Path

import program
import pytest
from lines import Line, Run, line, of_type
from sensor import sensor
from waiting import until

SECONDS = 60.0 if os.environ.get("OKID_SLOW") else 4.0
TEXT_BUS = '[[bus]]\nname = "{name}"\ntype = "serial"\nframing = "ascii"\ndevice = "{device}"\n'
SLCAN_BUS = '[[bus]]\nname = "{name}"\ntype = "slcan"\ndevice = "{device}"\n'
IDENTIFICATION = "[identification]\np = 4\nupdate_s = 0.5\nsigma_blocks = 0\n"


def handed_over(tty: Line, rate_hz: float, burst: int, stalls: dict[float, float]) -> int:
    """Lines of text, so many at a time in pieces of 64 bytes; stalls are made up for at once. @return lines"""
    begin, sent = time.monotonic(), 0
    while sent < SECONDS * rate_hz:
        held = max(
            (at + long for at, long in stalls.items() if at <= sent / rate_hz),
            default=0.0,
        )
        due = max((sent + burst) / rate_hz, held)
        time.sleep(max(0.0, begin + due - time.monotonic()))
        data = b"".join(b"%d\r\n" % (n % 30000) for n in range(sent, sent + burst))
        for at in range(0, len(data), 64):
            tty.write(data[at : at + 64])
        sent += burst
    return sent


@pytest.mark.parametrize("burst", [8, 16])
def test_the_next_sample_is_the_next_sample(tmp_path: Path, burst: int) -> None:
    text = "[acquisition]\nrate_hz = 1000\n" + TEXT_BUS.format(name="arduino", device=tmp_path / "tty")
    text += '[[channel]]\nname = "n"\nrole = "aux"\nfield = 0\n[record]\n'
    (tmp_path / "a.toml").write_text(text)
    with line(tmp_path / "tty") as tty:
        command = [program.PROGRAM, "record", str(tmp_path / "a.toml")]
        run = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
        until(lambda: list((tmp_path / "runs").glob("*.okj")), run)
        with sensor():
            sent = handed_over(tty, 1000, burst, {1.0: 0.15, 1.9: 0.3, 2.7: 0.15})
        until(lambda: not tty.unread())
        run.send_signal(signal.SIGINT)
        out, err = run.communicate(timeout=1800)
    assert run.returncode == 0, err
    (journal,) = (tmp_path / "runs").glob("*.okj")
    done = program.okid("convert", journal, tmp_path / "a.csv", "-c", tmp_path / "a.toml")
    assert done.returncode == 0, done.stderr
    with open(tmp_path / "a.csv", newline="") as file:
        rows = [row for row in csv.reader(row for row in file if not row.startswith("#"))]
    values = [float(row[rows[0].index("n")]) for row in rows[1:]]
    assert len(values) >= sent - burst, out
    wrong = [k for k, (a, b) in enumerate(zip(values, values[1:], strict=False)) if b != (a + 1) % 30000]
    assert not wrong, [values[k - 1 : k + 3] for k in wrong[:5]]


@contextlib.contextmanager
def busy_processors(count: int) -> Iterator[None]:
    hogs = [subprocess.Popen([sys.executable, "-c", "while True: pass"]) for _ in range(count)]
    try:
        yield
    finally:
        for hog in hogs:
            hog.kill()
            hog.wait()


def counted(tty: Line, seed: int, begin: float) -> None:
    """Frames of an slcan adapter with a counter, 200 a second."""
    draw = random.Random(seed)
    for n in range(int(200 * SECONDS)):
        time.sleep(max(0.0, begin + n / 200 - time.monotonic()))
        data = (n & 0xFFFF).to_bytes(2, "little") + draw.randrange(60000).to_bytes(2, "little")
        tty.write(b"t1004" + data.hex().encode() + b"\r")


def uncounted(tty: Line, begin: float) -> None:
    with sensor():
        for n in range(int(200 * SECONDS)):
            time.sleep(max(0.0, begin + n / 200 - time.monotonic()))
            tty.write(b"%d\n" % n)


@pytest.mark.parametrize("hogs", [0, *(pytest.param(count, marks=pytest.mark.realtime) for count in (1, 2))])
def test_two_buses_and_a_line_through_stops(tmp_path: Path, hogs: int) -> None:
    """The program is stopped for 1.5 s: the line is late then, the adapters are too, and all of it is in the samples.
    The journal of it gives the same result."""
    counter = "can_id = 0x100\nstart_bit = 16\nlength = 16\nsequence = { start_bit = 0, length = 16 }\n"
    text = "[acquisition]\nrate_hz = 200\n"
    for name in ("can0", "can1"):
        text += SLCAN_BUS.format(name=name, device=tmp_path / name)
    text += TEXT_BUS.format(name="line", device=tmp_path / "line")
    text += f'[[channel]]\nname = "f"\nrole = "force"\nbus = "can0"\n{counter}'
    text += f'[[channel]]\nname = "a"\nrole = "acceleration"\nbus = "can1"\n{counter}'
    text += '[[channel]]\nname = "n"\nrole = "aux"\nbus = "line"\nfield = 0\n'
    (tmp_path / "a.toml").write_text(text + IDENTIFICATION + "[record]\n")
    with contextlib.ExitStack() as ends:
        lines = [ends.enter_context(line(tmp_path / name)) for name in ("can0", "can1", "line")]
        run = Run(tmp_path / "a.toml", "--json", tmp_path / "live.json")
        until(lambda: list((tmp_path / "runs").glob("*.okj")), run.process)
        ends.enter_context(busy_processors(hogs))
        begin = time.monotonic() + 0.1
        senders = [threading.Thread(target=counted, args=(lines[k], k, begin)) for k in (0, 1)]
        senders.append(threading.Thread(target=uncounted, args=(lines[2], begin)))
        for sender in senders:
            sender.start()
        for _ in range(1 if SECONDS < 10 else 6):
            time.sleep(1.0)
            run.process.send_signal(signal.SIGSTOP)
            time.sleep(1.5)
            run.process.send_signal(signal.SIGCONT)
        for sender in senders:
            sender.join()
        until(lambda: not any(each.unread() for each in lines))
        run.stop()
        events = run.finish()
    assert not of_type(events, "gap")
    stats = of_type(events, "stats")[-1]
    for name in ("can0", "can1", "line"):
        bus = stats["bus"][name]
        assert (
            bus["lost"],
            bus["too_late"],
            bus["duplicate"],
            bus["decode_errors"],
        ) == (0, 0, 0, 0)
        assert bus["received"] == 200 * SECONDS - (name == "line")  # the first line of a text may be half of one
    for channel in stats["channel"].values():
        assert channel["missing"] == 0 and channel["expected"] == channel["received"] >= 200 * SECONDS - 3
    (journal,) = (tmp_path / "runs").glob("*.okj")
    done = program.okid("replay", journal, "--json", tmp_path / "again.json")
    assert done.returncode == 0, done.stderr
    assert (tmp_path / "again.json").read_bytes() == (tmp_path / "live.json").read_bytes()
