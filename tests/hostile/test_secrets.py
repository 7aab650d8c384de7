# SPDX-License-Identifier: MIT
"""A password of a config is in no file the programs write, in no word they say and in no list of processes."""

from __future__ import annotations

import os
import pathlib
import subprocess
import sys

import pytest
from program import PROGRAM, okid
from two_masses import rig_text, simulate_rig

PLAIN = "Tr0ub4dor"
HARD = r"Tr0ub4dor #$@\x&;%41"  # all that a line of TOML can hold between single quotes, but a quote


@pytest.fixture(scope="module")
def rig(tmp_path_factory: pytest.TempPathFactory) -> pathlib.Path:
    return simulate_rig(tmp_path_factory.mktemp("rig"), rig_text(8.0))


def with_secret(rig: pathlib.Path, folder: pathlib.Path, mqtt: str) -> pathlib.Path:
    """A live config that records, plays the log of the rig and speaks to a broker that is not there."""
    text = (rig / "a.toml").read_text().replace('type = "socketcan"', f'type = "replay"\nfile = "{rig}/a.log"')
    text = text.replace('dbc = "', f'dbc = "{rig}/')
    text += f'[publish]\n{mqtt}\n[record]\ndirectory = "runs"\n# it was mqtt://someone:{PLAIN}-old@127.0.0.1 before\n'
    (folder / "secret.toml").write_text(text)
    (folder / "secret.toml").chmod(0o640)
    return folder / "secret.toml"


def everything_said(folder: pathlib.Path, config: pathlib.Path) -> dict[str, bytes]:
    """Run every command that sees the config; what each wrote and said."""
    out: dict[str, bytes] = {}

    def keep(name: str, done: subprocess.CompletedProcess[str]) -> None:
        out[name] = (done.stdout + done.stderr).encode()

    keep("check", okid("check", config))
    keep("check --json", okid("check", config, "--json"))
    keep("doctor", okid("doctor", config))
    keep("support-bundle", okid("support-bundle", config))
    keep("run", okid("run", config, "--events", folder / "e.jsonl", "--json", folder / "r.json"))
    for journal in (folder / "runs").glob("*.okj"):
        keep("replay", okid("replay", journal, "--events", folder / "e2.jsonl", "--json", folder / "r2.json"))
        keep("to csv", okid("convert", journal, folder / "r.csv"))
        keep("to log", okid("convert", journal, folder / "r.log"))
    report = [sys.executable, "-m", "okid.report", str(folder / "r.json"), "--config", str(config), "--events",
              str(folder / "e.jsonl"), "--out", str(folder / "report.html")]  # fmt: skip
    keep("report", subprocess.run(report, capture_output=True, text=True, timeout=1800, check=False))
    for path in folder.rglob("*"):
        if path.is_file() and path != config:
            out[str(path.relative_to(folder))] = path.read_bytes()
    return out


@pytest.mark.parametrize("secret", [PLAIN, HARD])
def test_no_output_holds_the_password(rig: pathlib.Path, tmp_path: pathlib.Path, secret: str) -> None:
    """Release 0.1 wrote the config word for word into every journal."""
    config = with_secret(rig, tmp_path, f"mqtt = 'mqtt://anna:{secret}@127.0.0.1:9/lab'")
    found = everything_said(tmp_path, config)
    assert any(name.endswith(".okj") for name in found) and "report.html" in found, found.keys()
    for name, text in found.items():
        for word in (PLAIN, secret[:9], secret[9:] or PLAIN, "anna"):
            assert word.encode() not in text, f"{name} holds {word}"


def test_a_password_in_escapes_is_no_way_out(rig: pathlib.Path, tmp_path: pathlib.Path) -> None:
    config = with_secret(rig, tmp_path, 'mqtt = "mqtt:\\u002f\\u002fanna:Tr0ub4dor\\u0040127.0.0.1:9"')
    done = okid("run", config, "--json", tmp_path / "r.json")
    assert done.returncode == 0, done.stderr
    for journal in (tmp_path / "runs").glob("*.okj"):
        assert PLAIN.encode() not in journal.read_bytes()
        assert okid("replay", journal, "--json", tmp_path / "r2.json").returncode == 0


@pytest.mark.parametrize(
    "mqtt",
    [
        f"mqtt = 'mqtt://anna:{PLAIN}/x@127.0.0.1'", f"mqtt = 'mqtt://anna:{PLAIN}@host:99999'",
        f"mqtt = 'mqtts://anna:{PLAIN}@host'", f"mqtt = 'mqtt://anna:{PLAIN}@'", f"mqtt = 'mqtt://anna:{PLAIN}@host/#'",
        f"mqtt = 'mqtt://anna:{PLAIN}@host'\npassword_file = 'p'", f"udp = 'anna:{PLAIN}@host:1'",
    ],
)  # fmt: skip
def test_a_message_about_it_holds_no_password(rig: pathlib.Path, tmp_path: pathlib.Path, mqtt: str) -> None:
    done = okid("check", with_secret(rig, tmp_path, mqtt))
    assert done.returncode == 2 and "secret.toml: line" in done.stderr
    assert PLAIN not in done.stderr and PLAIN not in done.stdout


def test_password_file(rig: pathlib.Path, tmp_path: pathlib.Path) -> None:
    """Beside the config, or a credential of the service; its faults are said without its content."""
    config = with_secret(rig, tmp_path, 'mqtt = "mqtt://anna@127.0.0.1:9"\npassword_file = "broker-password"')
    missing = okid("run", config, "--json", tmp_path / "r.json")
    assert missing.returncode == 2 and "broker-password" in missing.stderr and not (tmp_path / "r.json").exists()
    (tmp_path / "broker-password").write_text(f"{PLAIN}\nsecond line\n")
    done = okid("run", config)
    assert done.returncode == 2 and "expected one line" in done.stderr and PLAIN not in done.stderr
    (tmp_path / "broker-password").write_text(f"{PLAIN}\n")
    (tmp_path / "broker-password").chmod(0o644)
    done = okid("run", config, "--json", tmp_path / "r.json")
    assert done.returncode == 0 and "every user of this computer can read the password" in done.stderr
    (tmp_path / "broker-password").unlink()
    (tmp_path / "credentials").mkdir()
    (tmp_path / "credentials" / "broker-password").write_text(PLAIN)
    (tmp_path / "credentials" / "broker-password").chmod(0o400)
    done = subprocess.run(
        [PROGRAM, "run", str(config)], capture_output=True, text=True, timeout=1800, check=False,
        env={**os.environ, "CREDENTIALS_DIRECTORY": str(tmp_path / "credentials")},
    )  # fmt: skip
    assert done.returncode == 0 and "every user" not in done.stderr, done.stderr


def test_a_password_that_everybody_can_read_is_remarked(rig: pathlib.Path, tmp_path: pathlib.Path) -> None:
    config = with_secret(rig, tmp_path, f"mqtt = 'mqtt://anna:{PLAIN}@127.0.0.1:9'")
    assert "every user of this computer can read" not in okid("check", config).stdout
    config.chmod(0o644)
    assert "every user of this computer can read the config" in okid("check", config).stdout


def test_no_list_of_processes_shows_it(rig: pathlib.Path, tmp_path: pathlib.Path) -> None:
    config = with_secret(rig, tmp_path, f"mqtt = 'mqtt://anna:{PLAIN}@127.0.0.1:9'")
    with subprocess.Popen([PROGRAM, "run", config], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL) as run:
        while run.poll() is None:
            for name in ("cmdline", "environ"):
                try:
                    assert PLAIN.encode() not in pathlib.Path(f"/proc/{run.pid}/{name}").read_bytes()
                except OSError:
                    break
