# SPDX-License-Identifier: MIT
"""examples/: each at most 60 lines, built, run on the demo rig, and right about its three modes."""

from __future__ import annotations

import contextlib
import json
import re
import subprocess
import sys
import threading
from pathlib import Path

import numpy as np
import program
import pytest
from waiting import until

ROOT = Path(__file__).resolve().parents[2]
EXAMPLES = ROOT / "examples"
PROGRAM = Path(program.PROGRAM)
SCALE = (0.0002, 0.0006, 0.0005, 0.0003)  # of the codes of the rig's frames
CHANNELS = ["force1", "acc1", "acc2", "acc3"]


@pytest.fixture(scope="module")
def rig(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with the demo rig's record as CSV, log, codes and doubles."""
    folder = tmp_path_factory.mktemp("rig")
    files = ["--log", "rig.log", "--truth", "truth.json", "--csv", "rig.csv", "--dbc", "rig.dbc"]
    rig_file = ROOT / "tests" / "replay" / "demo_rig.toml"
    subprocess.run([PROGRAM, "simulate", rig_file, *files], cwd=folder, check=True, capture_output=True)
    samples = np.loadtxt(folder / "rig.csv", delimiter=",", skiprows=3)
    samples.astype("<f8").tofile(folder / "doubles")
    np.round(samples / SCALE).astype("<i2").tofile(folder / "codes")
    return folder


def judge(shown: str, rig: Path, tolerance: float = 1e-3) -> None:
    """The last three frequencies shown are the true ones."""
    truth = json.loads((rig / "truth.json").read_text())["frequency_hz"]
    found = [float(f) for f in re.findall(r"([\d.]+)(?: ± [\d.]+)? Hz", shown)][-3:]
    assert found == pytest.approx(truth, rel=tolerance), shown


def built(source: str, folder: Path) -> Path:
    """An example in C, linked as the page of the C library says; the microcontroller's bounds are those of Eigen."""
    archive = PROGRAM.parent / "libokid.a"
    if source == "microcontroller":
        archive = PROGRAM.parent / "lib" / "libokid_eigen.a"
        subprocess.run(["cmake", "--build", PROGRAM.parent, "--target", "okid_eigen"], check=True, capture_output=True)
    strict = [
        "-std=c99",
        "-pedantic",
        "-Wall",
        "-Wextra",
        "-Werror",
        f"-I{ROOT}/lib/include",
        f"-I{ROOT}/drivers/include",
    ]
    subprocess.run(["cc", *strict, "-c", EXAMPLES / f"{source}.c", "-o", folder / "example.o"], check=True)
    backend = subprocess.run([PROGRAM, "--version"], capture_output=True, text=True, check=True).stdout
    libraries = ["-llapacke", "-lopenblas"] if "lapacke" in backend else []
    drivers = [PROGRAM.parent / "drivers" / "libokid_drivers.a", "-lgpiod"]
    subprocess.run(
        ["c++", folder / "example.o", archive, *drivers, *libraries, "-lm", "-o", folder / source], check=True
    )
    return folder / source


def run(command: list[str | Path], rig: Path, given: str | None = None) -> str:
    with (rig / given).open("rb") if given else contextlib.nullcontext() as stdin:
        done = subprocess.run(command, cwd=rig, stdin=stdin, capture_output=True, text=True, timeout=1800)
    assert done.returncode == 0, done.stderr
    return done.stdout


def script(name: str) -> list[str | Path]:
    return [sys.executable, EXAMPLES / name]


@pytest.mark.parametrize(
    "path", sorted(path for path in EXAMPLES.iterdir() if path.is_file()), ids=lambda path: path.name
)
def test_an_example_has_at_most_60_lines(path: Path) -> None:
    assert len(path.read_text(encoding="utf-8").splitlines()) <= 60


@pytest.mark.parametrize(
    ("source", "arguments", "given"),
    [
        ("modes_from_codes", ["codes", "1", "3", "250"], None),
        ("blocks_from_stream", ["1", "3", "250", "10"], "doubles"),
        ("can_to_modes", ["rig.log", "250"], None),
        ("microcontroller", [], "codes"),
    ],
)
def test_c(source: str, arguments: list[str], given: str | None, rig: Path, tmp_path: Path) -> None:
    judge(run([built(source, tmp_path), *arguments], rig, given), rig)


def test_array_to_modes(rig: Path) -> None:
    shown = run([*script("array_to_modes.py"), "rig.csv", *CHANNELS], rig)
    judge(shown, rig)
    masses = [float(m) for m in shown.rpartition("M, kg:")[2].split()]
    assert masses == pytest.approx(json.loads((rig / "truth.json").read_text())["M"][0][:1] + [0.8, 1.2], rel=0.02)


def test_campaign(rig: Path) -> None:
    judge(run([*script("campaign.py"), CHANNELS[0], ",".join(CHANNELS[1:]), "rig.csv", "rig.csv"], rig), rig)


def test_live_from_python_can(rig: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    """On python-can's virtual bus, which lives inside one process."""
    import runpy

    import can
    from can.interfaces.virtual import channels

    def node() -> None:
        with can.Bus(interface="virtual", channel="example") as bus, can.LogReader(rig / "rig.log") as log:
            until(lambda: len(channels["example"]) >= 2)  # the example listens
            for message in log:
                bus.send(message)

    sender = threading.Thread(target=node, daemon=True)
    sender.start()
    arguments = ["live_from_python_can.py", "virtual", "example", str(rig / "rig.dbc"), "250", "5000"]
    monkeypatch.setattr(sys, "argv", arguments)
    runpy.run_path(str(EXAMPLES / arguments[0]), run_name="__main__")
    judge(capsys.readouterr().out, rig)
