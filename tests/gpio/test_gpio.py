# SPDX-License-Identifier: MIT
"""GPIO lines on simulated chips (gpio-sim): the driver for both APIs of libgpiod, and okid run with trigger and lamps.

Run by tests/kernel/run in the test kernel, where vcan0 is too.
"""

from __future__ import annotations

import json
import os
import re
import signal
import subprocess
import time
from collections.abc import Iterator
from pathlib import Path

import pytest
from methods import by_method
from program import PROGRAM as OKID
from two_masses import rig_text
from waiting import until

BUILD = Path(os.environ.get("OKID_BUILD", str(Path(__file__).parents[2] / "build")))


APIS = [1, 2] if (BUILD / "gpio" / "gpio_lines_1").exists() else [2]  # where the system has 2.x, that alone


@pytest.mark.parametrize("api", APIS)
def test_driver(api: int) -> None:
    """gpio_lines.c: edges with stamps, outputs, refusals."""
    program = BUILD / "gpio" / f"gpio_lines_{api}"
    assert program.exists(), f"{program} was not built: libgpiod 2 could not be had when CMake ran (see its warning)"
    done = subprocess.run([str(program)], capture_output=True, text=True, timeout=1800, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    assert int(re.search(r"(\d+) Tests", done.stdout)[1]) >= 7


class Sim:
    """A simulated chip of eight lines; line 2 is named START."""

    def __init__(self) -> None:
        self.config = Path("/sys/kernel/config/gpio-sim/okid_run")
        (self.config / "bank0" / "line2").mkdir(parents=True)
        (self.config / "bank0" / "num_lines").write_text("8")
        (self.config / "bank0" / "line2" / "name").write_text("START")
        (self.config / "live").write_text("1")
        self.chip = (self.config / "bank0" / "chip_name").read_text().strip()
        device = (self.config / "dev_name").read_text().strip()
        self.lines = Path("/sys/devices/platform") / device / self.chip

    def pull(self, line: int, up: bool) -> None:
        (self.lines / f"sim_gpio{line}" / "pull").write_text("pull-up" if up else "pull-down")

    def value(self, line: int) -> int:
        return int((self.lines / f"sim_gpio{line}" / "value").read_text())

    def wait_for(self, line: int, value: int) -> None:
        until(lambda: self.value(line) == value)

    def remove(self) -> None:
        (self.config / "live").write_text("0")
        for folder in ("bank0/line2", "bank0", ""):
            (self.config / folder).rmdir()


@pytest.fixture
def sim() -> Iterator[Sim]:
    chip = Sim()
    yield chip
    chip.remove()


@pytest.fixture
def rig(tmp_path: Path, sim: Sim) -> Path:
    (tmp_path / "rig.toml").write_text(rig_text(12.0, 100.0, 5, "[3e3, 2e3]"))
    names = {"--log": "a.log", "--truth": "t.json", "--dbc": "a.dbc", "--config": "a.toml"}
    options = [str(part) for option, name in names.items() for part in (option, tmp_path / name)]
    subprocess.run([OKID, "simulate", str(tmp_path / "rig.toml"), *options], check=True, capture_output=True)
    text = by_method((tmp_path / "a.toml").read_text(), p=12, rows=24)
    text = text.replace("update_s = 1.0", "update_s = 0.5")
    text += f'\n[trigger]\nsource = "gpio"\nchip = "{sim.chip}"\nline = "START"\npretrigger_s = 0.5\n'
    text += f'\n[lamps]\narmed = {{ chip = "{sim.chip}", line = 4 }}\n'
    text += f'go = {{ chip = "{sim.chip}", line = 5, active_low = true }}\n'
    (tmp_path / "a.toml").write_text(text)
    return tmp_path


def events_of(folder: Path, kind: str) -> list[dict]:
    lines = (folder / "e").read_text().splitlines()
    return [event for event in map(json.loads, lines) if event["type"] == kind]


def test_run_begins_with_the_edge(rig: Path, sim: Sim) -> None:
    """Armed, then the button: identification begins there, the lamps follow, and the log replays to the same result."""
    dump = subprocess.Popen(
        ["candump", "-L", "-r", "4000000", "vcan0"], stdout=(rig / "live.log").open("w"), stderr=subprocess.DEVNULL
    )
    run = subprocess.Popen(
        [OKID, "run", str(rig / "a.toml"), "--events", str(rig / "e"), "--json", str(rig / "r")],
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        text=True,
    )
    sim.wait_for(4, 1)
    assert sim.value(5) == 1  # active low: not lit
    time.sleep(0.5)
    play = subprocess.Popen([OKID, "replay", str(rig / "a.log"), "--to", "vcan0"], stdout=subprocess.DEVNULL)
    time.sleep(3)
    assert sim.value(4) == 1 and not events_of(rig, "trigger") and not events_of(rig, "modes")
    pressed = time.time()
    sim.pull(2, True)
    sim.wait_for(4, 0)
    assert time.time() - pressed < 2
    sim.wait_for(5, 0)  # the table has come to rest
    sim.pull(2, False)
    time.sleep(0.1)
    sim.pull(2, True)  # once is enough
    assert play.wait(1800) == 0
    time.sleep(0.5)
    run.send_signal(signal.SIGINT)
    assert run.wait(1800) == 0, run.stderr.read() if run.stderr else ""
    dump.terminate()
    dump.wait()
    assert sim.value(4) == 0 and sim.value(5) == 0  # given back as gpio-sim leaves them: pulled down

    [told] = events_of(rig, "trigger")
    assert told["source"] == "gpio"
    assert -0.02 < told["time_s"] - pressed < 0.1
    stamps = [float(line[1 : line.index(")")]) for line in (rig / "live.log").read_text().splitlines()]
    first = next(n for n in range(0, len(stamps), 2) if stamps[n] >= told["time_s"]) // 2  # two frames a sample
    assert told["sample"] == first and told["t"] == pytest.approx(first / 100)
    result = json.loads((rig / "r").read_text())
    assert result["samples"] == 1200 - (first - 50)
    assert all(event["t"] > told["t"] for event in events_of(rig, "modes"))

    again = subprocess.run(
        [OKID, "replay", str(rig / "live.log"), "-c", str(rig / "a.toml"), "--json", str(rig / "r2"), "--events"]
        + [str(rig / "e2"), "--trigger-at", f"{told['time_s']:.6f}"],
        capture_output=True,
        text=True,
        timeout=1800,
        check=False,
    )
    assert again.returncode == 0, again.stderr
    assert (rig / "r").read_bytes() == (rig / "r2").read_bytes()


def test_no_edge_no_result(rig: Path, sim: Sim) -> None:
    run = subprocess.Popen(
        [OKID, "run", str(rig / "a.toml"), "--events", str(rig / "e"), "--json", str(rig / "r"), "--duration", "2"],
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        text=True,
    )
    sim.wait_for(4, 1)
    time.sleep(0.3)
    subprocess.run(
        [OKID, "replay", str(rig / "a.log"), "--to", "vcan0", "--speed", "8"], check=True, capture_output=True
    )
    _, errors = run.communicate(timeout=1800)
    assert run.returncode == 3
    assert f"the trigger never came: waited for an edge of {sim.chip} line START, but none came" in errors
    assert not (rig / "r").exists()
    assert sim.value(4) == 0


def test_doctor_names_who_stands_in_the_way(rig: Path, sim: Sim) -> None:
    """A chip we may not open, and a line that another program has."""
    ask = [OKID, "doctor", str(rig / "a.toml")]
    device = Path("/dev") / sim.chip
    mode = device.stat().st_mode
    device.chmod(0)
    poor = ["setpriv", "--bounding-set=-dac_override,-dac_read_search", "--inh-caps=-all"]
    denied = subprocess.run([*poor, *ask], capture_output=True, text=True, check=False)
    device.chmod(mode)
    assert denied.returncode == 4 and "missing  trigger line" in denied.stdout, denied.stdout
    assert "sudo usermod -aG gpio $USER" in denied.stdout
    with subprocess.Popen(
        [OKID, "run", str(rig / "a.toml")], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL
    ) as run:
        sim.wait_for(4, 1)
        busy = subprocess.run(ask, capture_output=True, text=True, check=False)
        run.terminate()
        run.wait(1800)
    assert busy.returncode == 4 and "missing  trigger line" in busy.stdout, busy.stdout
    assert "end the program that has it" in busy.stdout


def test_lines_that_cannot_be_had(rig: Path, sim: Sim) -> None:
    text = (rig / "a.toml").read_text()
    doctor = subprocess.run([OKID, "doctor", str(rig / "a.toml")], capture_output=True, text=True, check=False)
    assert re.search(rf"ok +trigger line +{sim.chip} line START", doctor.stdout), doctor.stdout
    assert re.search(rf"ok +lamp go +{sim.chip} line 5", doctor.stdout), doctor.stdout
    for old, new, piece in [
        ('line = "START"', 'line = "STOP"', "no line has this name, names found: START. What to do: correct"),
        ('line = "START"', "line = 8", "the chip has lines 0 to 7"),
        (f'"{sim.chip}", line = 4', '"gpiochip77", line = 4', "there is no such chip, found: gpiochip"),
    ]:
        (rig / "b.toml").write_text(text.replace(old, new))
        run = subprocess.run(
            [OKID, "run", str(rig / "b.toml"), "--duration", "1"],
            capture_output=True,
            text=True,
            timeout=1800,
            check=False,
        )
        assert run.returncode == 4 and piece in run.stderr, run.stderr
        doctor = subprocess.run([OKID, "doctor", str(rig / "b.toml")], capture_output=True, text=True, check=False)
        assert doctor.returncode == 4 and piece.split(".")[0] in doctor.stdout, doctor.stdout
