# SPDX-License-Identifier: MIT
"""okid-capture can --config: the result of `okid replay`, from a log and from a bus, whatever ends the run."""

from __future__ import annotations

import functools
import itertools
import json
import os
import signal
import subprocess
import threading
from collections.abc import Iterator
from pathlib import Path

import can
import pytest
from captured import assert_same_result, assert_truth, edited, frames
from okid import capture
from okid.capture import command_can
from okid.capture.recording import Recorder
from waiting import until

_numbers = itertools.count()


@pytest.fixture
def sender() -> Iterator[tuple[str, can.BusABC]]:
    """The far end of a virtual bus of this process, which keeps the time stamps that it is given."""
    name = f"okid-capture-{os.getpid()}-{next(_numbers)}"
    bus = can.Bus(interface="virtual", channel=name, preserve_timestamps=True)
    yield name, bus
    bus.shutdown()


def when_heard(bus: can.BusABC, messages: list[can.Message], after: int = 2) -> threading.Thread:
    """Send once somebody listens (a virtual bus drops what nobody hears)."""
    from can.interfaces.virtual import channels

    def send() -> None:
        until(lambda: len(channels[bus.channel_id]) >= after)
        for message in messages:
            bus.send(message)

    thread = threading.Thread(target=send, daemon=True)
    thread.start()
    return thread


def run(*arguments: object) -> int:
    return capture.main([str(argument) for argument in arguments])


def test_a_log_gives_the_result_of_okid_replay(rig: Path, tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    assert run("can", "--log", rig / "a.log", "--config", rig / "a.toml", "--json", tmp_path / "r.json") == 0
    assert (tmp_path / "r.json").read_bytes() == (rig / "replay.json").read_bytes()
    shown = capfd.readouterr().out
    assert "t 6.000 s: " in shown
    assert "settled" in shown
    assert "can0: 3000 received, 0 lost" in shown
    assert run("can", "--interface", "file", "--channel", rig / "a.log", "--config", rig / "a.toml", "--json", "-") == 0
    assert capfd.readouterr().out == (rig / "replay.json").read_text()


@pytest.mark.parametrize("kind", [".blf", ".asc"])
def test_logs_of_other_makers(rig: Path, tmp_path: Path, kind: str) -> None:
    with can.Logger(tmp_path / f"a{kind}") as logger:
        for message in frames(rig / "a.log"):
            message.channel = 0
            logger(message)
    assert run("can", "--log", tmp_path / f"a{kind}", "--config", rig / "a.toml", "--json", tmp_path / "r.json") == 0
    assert_same_result(json.loads((tmp_path / "r.json").read_text()), json.loads((rig / "replay.json").read_text()))


def test_lost_frames_are_counted_and_change_nothing_else(
    rig: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    lines = (rig / "a.log").read_text().splitlines(keepends=True)
    log = tmp_path / "holes.log"
    log.write_text("".join(line for k, line in enumerate(lines) if not (900 <= k < 921 or k == 1500)))
    assert run("can", "--log", log, "--config", rig / "a.toml", "--json", tmp_path / "r.json") == 0
    done = subprocess.run(
        [capture.find_program(), "replay", log, "-c", rig / "a.toml", "--json", tmp_path / "p.json"],
        capture_output=True, check=True,
    )  # fmt: skip
    assert done.returncode == 0
    ours, program = (json.loads((tmp_path / name).read_text()) for name in ("r.json", "p.json"))
    assert_same_result(ours, program)
    assert ours["gaps"] == 2
    assert "can0: 2978 received, 22 lost (sequence 22)" in capsys.readouterr().out


def test_a_bus_is_recorded_and_identified(rig: Path, tmp_path: Path, sender: tuple[str, can.BusABC]) -> None:
    name, bus = sender
    thread = when_heard(bus, frames(rig / "a.log"))
    outputs = ("--json", tmp_path / "r.json", "--out", tmp_path / "r.log", "--frames", 3000, "--quiet")
    assert run("can", "--interface", "virtual", "--channel", name, "--config", rig / "a.toml", *outputs) == 0
    thread.join()
    assert_same_result(json.loads((tmp_path / "r.json").read_text()), json.loads((rig / "replay.json").read_text()))
    assert (tmp_path / "r.log").read_text() == (rig / "a.log").read_text()


def test_a_duration_is_one_of_samples(rig: Path, tmp_path: Path, sender: tuple[str, can.BusABC]) -> None:
    name, bus = sender
    thread = when_heard(bus, frames(rig / "a.log"))
    outputs = ("--json", tmp_path / "r.json", "--duration", 4, "--quiet")
    assert run("can", "--interface", "virtual", "--channel", name, "--config", rig / "a.toml", *outputs) == 0
    thread.join()
    assert json.loads((tmp_path / "r.json").read_text())["samples"] == 1000


class FailingBus:
    """Gives some frames, then the network is down."""

    def __init__(self, messages: list[can.Message]) -> None:
        self._messages = iter(messages)

    def recv(self, timeout: float | None = None) -> can.Message:
        for message in self._messages:
            return message
        raise can.CanOperationError("Network is down")

    def shutdown(self) -> None:
        pass


def test_a_failing_bus_keeps_everything(
    rig: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    sent = frames(rig / "a.log")[:2000]
    monkeypatch.setattr(capture.command_can, "open_bus", lambda *_, **__: FailingBus(sent))
    outputs = ("--json", tmp_path / "r.json", "--out", tmp_path / "r.log")
    assert run("can", "--interface", "virtual", "--channel", "x", "--config", rig / "a.toml", *outputs) == 4
    assert json.loads((tmp_path / "r.json").read_text())["samples"] == 1000
    assert len((tmp_path / "r.log").read_text().splitlines()) == 2000
    assert "Network is down; what came before is in the result" in capsys.readouterr().err


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_signals_end_a_run_with_its_result(
    rig: Path, tmp_path: Path, sender: tuple[str, can.BusABC], number: signal.Signals
) -> None:
    name, bus = sender
    sent = frames(rig / "a.log")

    def play_then_signal() -> None:
        when_heard(bus, sent[:2600]).join()
        wait_for_lines(tmp_path / "r.log", 2600)
        os.kill(os.getpid(), number)

    thread = threading.Thread(target=play_then_signal, daemon=True)
    thread.start()
    outputs = ("--json", tmp_path / "r.json", "--out", tmp_path / "r.log")
    assert run("can", "--interface", "virtual", "--channel", name, "--config", rig / "a.toml", *outputs) == 0
    thread.join()
    result = json.loads((tmp_path / "r.json").read_text())
    assert result["samples"] == 1300
    assert_truth(result, rig / "t.json")


def wait_for_lines(path: Path, count: int) -> None:
    until(lambda: path.exists() and path.read_bytes().count(b"\n") >= count)


@pytest.mark.parametrize(
    ("flush_s", "said"), [(0.0, ": no longer recorded"), (3600.0, "")], ids=["on the way", "at the end"]
)
def test_a_full_disk_ends_no_measurement(
    rig: Path,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
    flush_s: float,
    said: str,
) -> None:
    monkeypatch.setattr(command_can, "Recorder", functools.partial(Recorder, flush_s=flush_s))
    given = ("--log", rig / "a.log", "--config", rig / "a.toml", "--json", tmp_path / "r.json", "--out", "/dev/full")
    assert run("can", *given) == 2
    assert capsys.readouterr().err == f"okid-capture: /dev/full: No space left on device{said}\n"
    assert_same_result(json.loads((tmp_path / "r.json").read_text()), json.loads((rig / "replay.json").read_text()))


def test_no_frame_of_a_channel_is_told(rig: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    log = tmp_path / "half.log"
    lines = (rig / "a.log").read_text().splitlines(keepends=True)
    log.write_text("".join(line for line in lines if " 100#" in line))
    assert run("can", "--log", log, "--config", rig / "a.toml", "--json", tmp_path / "r.json") == 3
    words = 'channel "acc1" was received (message Accel1, identifier 0x101, bus "can0"): is the sensor on'
    assert words in capsys.readouterr().err
    log.write_text("".join(line.replace(" 101#", " 155#") for line in lines[:200]))
    assert run("can", "--log", log, "--config", rig / "a.toml", "--json", tmp_path / "r.json") == 3
    assert 'bus "can0"): it carries 0x155 (100 frames); is the sensor on' in capsys.readouterr().err
    assert not (tmp_path / "r.json").exists()


def test_too_few_samples_are_no_model(rig: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    log = tmp_path / "short.log"
    log.write_text("".join((rig / "a.log").read_text().splitlines(keepends=True)[:60]))
    assert run("can", "--log", log, "--config", rig / "a.toml", "--json", tmp_path / "r.json") == 3
    assert capsys.readouterr().err.startswith("okid-capture: no model: ")
    assert not (tmp_path / "r.json").exists()


CONFIG_FAULTS = {
    "rate_hz = 250": ("rate_hz = 250\nrats = 1", 'key "rats": unknown key'),
    'role = "force"': ('role = "farce"', 'key "role": found "farce"'),
    'signal = "Force1"': ('signal = "Force9"', 'key "signal": found "Force9"'),
    'message = "Shaker"': ('message = "Shakr"', 'key "message": found "Shakr" (did you mean "Shaker"?)'),
    'bus = "can0"\nmessage = "Shaker"': ('bus = "can1"\nmessage = "Shaker"', 'key "bus": found "can1"'),
    'sequence = "Counter"': ('sequence = "Conter"', 'key "sequence": found "Conter" (did you mean "Counter"?)'),
    "bitrate = 1000000": ('bitrate = "fast"', 'key "bitrate": found'),
    "[identification]": ("[identificaton]", "identificaton"),
    "p = 12": ("p = -1", '"p"'),
    "update_s = 1.0": ("update_s = 0.0001", '"update_s"'),
}


@pytest.mark.parametrize("found", CONFIG_FAULTS)
def test_bad_configs_name_file_and_key(
    rig: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], found: str
) -> None:
    changed, words = CONFIG_FAULTS[found]
    (tmp_path / "a.dbc").write_text((rig / "a.dbc").read_text())
    config = edited(rig / "a.toml", tmp_path / "a.toml", lambda text: text.replace(found, changed, 1))
    assert run("can", "--log", rig / "a.log", "--config", config) == 2
    shown = capsys.readouterr().err
    assert str(config) in shown
    assert words in shown
    assert shown.count("\n") == 1


@pytest.mark.parametrize(
    ("arguments", "code", "words"),
    [
        (["--interface", "virtual", "--channel", "x"], 2, "nothing to do: give --out FILE.log, --config CONFIG.toml"),
        (["--log", "a.log", "--interface", "virtual", "--out", "b.log"], 2, "--log is read instead of a bus"),
        (["--interface", "virtual", "--out", "b.log"], 2, "needs --channel"),
        (["--config", "{rig}/a.toml", "--log", "nowhere.log"], 2, "nowhere.log"),
        (["--config", "nowhere.toml", "--log", "{rig}/a.log"], 2, "nowhere.toml"),
        (["--config", "{rig}/a.toml", "--log", "{rig}/a.dbc"], 2, "expected one of .log"),
        (["--config", "{rig}/a.toml", "--log", "{rig}/a.log", "--json", "/nowhere/r.json"], 2, "/nowhere"),
        (["--config", "{rig}/a.toml", "--log", "{rig}/a.log", "--duration", "nan"], 2, "--duration"),
        (["--config", "{rig}/a.toml", "--interface", "socketcan", "--channel", "nosuchcan9"], 4, "nosuchcan9"),
        (["--config", "{rig}/a.toml", "--bus", "can7"], 2, "can7"),
        (
            ["--json", "r.json", "--out", "b.log", "--interface", "virtual", "--channel", "x"],
            2,
            "--json needs --config",
        ),
    ],
)
def test_refusals(rig: Path, capsys: pytest.CaptureFixture[str], arguments: list[str], code: int, words: str) -> None:
    assert run("can", *[argument.replace("{rig}", str(rig)) for argument in arguments]) == code
    shown = capsys.readouterr().err
    assert words in shown
    assert shown.startswith("okid-capture: ") and shown.count("\n") == 1


def test_a_damaged_log_names_the_line(rig: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    lines = (rig / "a.log").read_text().splitlines(keepends=True)
    (tmp_path / "d.log").write_text("".join(lines[:40]) + "(1700000000.0x) vcan0 100#00\n" + "".join(lines[40:]))
    assert run("can", "--log", tmp_path / "d.log", "--config", rig / "a.toml") == 2
    assert f"{tmp_path}/d.log: line 41, column 14: found " in capsys.readouterr().err
    given = ("--log", tmp_path / "d.log", "--config", rig / "a.toml", "--out", tmp_path / "copy.log")
    assert run("can", *given) == 2  # read frame by frame
    assert f"{tmp_path}/d.log:41: found '(1700000000.0x) vcan0 100#00', expected " in capsys.readouterr().err


def test_a_script_of_ten_lines(rig: Path) -> None:
    with capture.Capture(rig / "a.toml") as stream:
        for _ in capture.feed_messages(can.LogReader(rig / "a.log"), stream):
            pass
        result = stream.finish()
        modes = [event for event in stream.events() if event["type"] == "modes"]
    assert result == json.loads((rig / "replay.json").read_text())
    assert modes[-1]["settled"] and len(modes) == 6
