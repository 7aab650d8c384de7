# SPDX-License-Identifier: MIT
"""What the program says to a command line that is not right, and to a file of another kind than expected."""

from __future__ import annotations

from pathlib import Path

import pytest
from program import okid
from two_masses import rig_text, simulate_rig


@pytest.fixture(scope="module")
def rig(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return simulate_rig(tmp_path_factory.mktemp("line"), rig_text(2.0))


@pytest.mark.parametrize(
    ("words", "pieces"),
    [
        ("identfy", ['okid: no command "identfy" (did you mean "identify"?)', "simulate"]),
        ("", ["Usage: okid", "identify", "doctor"]),
        (
            "identify",
            ["okid identify: RECORD.csv is missing", "okid identify frame.csv --inputs"],
        ),
        ("simulate", ["okid simulate: RIG.toml is missing"]),
        ("run --config a.toml", ["okid run: ", "not expected: --config", "okid run frame.toml"]),
        ("identify a.csv --input u", ["not expected: --input", 'did you mean "--inputs"']),
    ],
)
def test_wrong_command_lines(words: str, pieces: list[str]) -> None:
    done = okid(*words.split())
    assert done.returncode == 2 and done.stdout == ""
    for piece in pieces:
        assert piece in done.stderr, done.stderr


@pytest.mark.parametrize("words", ["version", "-v", "-V", "--version"])
def test_version(words: str) -> None:
    done = okid(words)
    assert done.returncode == 0 and done.stdout == okid("--version").stdout
    assert done.stdout.startswith("okid 0.")


def test_help_as_a_word() -> None:
    assert okid("help").stdout == okid("--help").stdout
    assert okid("help", "replay").stdout == okid("replay", "--help").stdout


@pytest.mark.parametrize(
    ("name", "kind"),
    [("a.log", "a log of CAN frames"), ("a.dbc", "a DBC"), ("t.json", "JSON"), ("a.csv", "a CSV")],
)
def test_a_file_that_is_no_config(rig: Path, name: str, kind: str) -> None:
    done = okid("check", rig / name)
    assert done.returncode == 2
    assert f"{name}: it looks like {kind}, expected a CONFIG.toml" in done.stderr, done.stderr


def test_a_log_that_is_no_csv(rig: Path) -> None:
    done = okid("identify", rig / "a.log", "--inputs", "force1", "--outputs", "acc1")
    assert done.returncode == 2 and "it looks like a log of CAN frames, expected a CSV: okid convert" in done.stderr


@pytest.mark.parametrize(
    ("name", "kind"), [("t.json", "JSON"), ("a.toml", "a TOML file"), ("rig.toml", "a TOML file"), ("a.dbc", "a DBC")]
)
def test_other_files_that_are_no_csv(rig: Path, name: str, kind: str) -> None:
    done = okid("identify", rig / name, "--inputs", "force1", "--outputs", "acc1")
    assert done.returncode == 2 and f"{name}: it looks like {kind}, expected a CSV" in done.stderr, done.stderr


def test_a_dbc_that_is_not_there(rig: Path) -> None:
    (rig / "b.toml").write_text((rig / "a.toml").read_text().replace('"a.dbc"', '"b.dbc"'))
    done = okid("check", rig / "b.toml")
    assert done.returncode == 2
    for piece in ('b.toml: [[bus]] "can0", key "dbc"', f"{rig / 'b.dbc'}: cannot be read", "relative name counts from"):
        assert piece in done.stderr, done.stderr


def test_a_unit_of_something_else(rig: Path) -> None:
    (rig / "u.toml").write_text((rig / "a.toml").read_text().replace('unit = "m/s^2"', 'unit = "mm"', 1))
    done = okid("check", rig / "u.toml")
    assert done.returncode == 2
    said = '"mm" is a unit of displacement, but its role is acceleration; expected one like "m/s^2"'
    assert said in done.stderr
    (rig / "u.toml").write_text((rig / "u.toml").read_text().replace("mkr = true", "mkr = false"))  # modes have no unit
    done = okid("check", rig / "u.toml")
    assert done.returncode == 0 and said in done.stdout


def test_frames_longer_than_classic_ones(rig: Path) -> None:
    bits = "can_id = 0x101\nstart_bit = 64\nlength = 16\n"
    text = (rig / "a.toml").read_text().replace('message = "Accel1"\nsignal = "Accel2"\nsequence = "Counter"\n', bits)
    (rig / "f.toml").write_text(text)
    done = okid("check", rig / "f.toml")
    assert done.returncode == 2 and "only CAN FD has" in done.stderr and "fd = true" in done.stderr, done.stderr
    (rig / "f.toml").write_text(text.replace('interface = "vcan0"', 'interface = "vcan0"\nfd = true'))
    assert okid("check", rig / "f.toml").returncode == 0


def test_a_file_on_a_live_bus(rig: Path) -> None:
    (rig / "l.toml").write_text((rig / "a.toml").read_text().replace("[[bus]]", '[[bus]]\nfile = "a.log"', 1))
    done = okid("check", rig / "l.toml")
    assert done.returncode == 2 and "only a bus of type replay reads a file" in done.stderr


def test_p_of_a_method_without_observer(rig: Path) -> None:
    (rig / "p.toml").write_text((rig / "a.toml").read_text().replace('"okid-era"', '"n4sid-cva"'))
    done = okid("check", rig / "p.toml")
    assert done.returncode == 0 and "warning: [identification] p belongs to the observer" in done.stdout


def test_sample_rates_that_disagree(rig: Path) -> None:
    options = ["--inputs", "force1", "--outputs", "acc1,acc2", "--p", 12, "--order", 4]
    done = okid("identify", rig / "a.csv", *options, "--fs", 1000)
    assert done.returncode == 0 and "--fs 1000 is used, " in done.stdout and "says 250 Hz" in done.stdout
    assert "fs_overrides_file" not in okid("identify", rig / "a.csv", *options, "--fs", 250).stdout


def test_a_time_of_another_name(rig: Path) -> None:
    for name in ("Time [s]", "t (s)", "Time", "t"):
        head, *rows = [line for line in (rig / "a.csv").read_text().splitlines()[1:] if not line.startswith("#")]
        timed = [f"{name},{head}", *(f"{k / 250},{row}" for k, row in enumerate(rows))]
        (rig / "s.csv").write_text("\n".join(timed) + "\n")
        done = okid("identify", rig / "s.csv", "--inputs", "force1", "--outputs", "acc1,acc2", "--p", 12, "--order", 4)
        assert done.returncode == 0 and "at 250 Hz" in done.stdout, done.stderr
    (rig / "t.csv").write_text("Timer,u,y\n" + "".join(f"{k / 100},{k % 7},{k % 5}\n" for k in range(99)))
    done = okid("identify", rig / "t.csv", "--inputs", "u", "--outputs", "y")
    assert done.returncode == 2 and '(is "Timer" the time in seconds? Then call it time_s)' in done.stderr
    (rig / "ms.csv").write_text("Time [ms],u,y\n" + "".join(f"{10 * k},{k % 7},{k % 5}\n" for k in range(99)))
    done = okid("identify", rig / "ms.csv", "--inputs", "u", "--outputs", "y")  # by okid-convert
    assert "note: 100 Hz by column 'Time [ms]'" in done.stderr, done.stderr
