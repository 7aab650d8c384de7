# SPDX-License-Identifier: MIT
"""What tools/bindings.py writes, used: the crate okid-sys by cargo without a network, okid_identify in GNU Octave.

The mode in both is chosen and simulated in the language itself, so nothing of okid's own simulation is shared.
"""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
BUILD = Path(os.environ.get("OKID_PROGRAM", ROOT / "build" / "okid")).absolute().parent
INCLUDE = [f"-I{ROOT / part}" for part in ("lib/include", "firmware_host/include", "drivers/include")]
RECORD = """
rand ('seed', 3); n = 4000; fs = 100; f = 12.5; zeta = 0.02;
w = 2 * pi * f / fs; r = exp (-zeta * w); u = 2 * rand (n, 1) - 1;
y = filter ([0 1], [1, -2 * r * cos(w * sqrt (1 - zeta^2)), r^2], u) + 1e-3 * (2 * rand (n, 1) - 1);
"""


@pytest.fixture(scope="module")
def written(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("bindings")
    subprocess.run([sys.executable, ROOT / "tools" / "bindings.py", folder], check=True)
    matlab = folder / "matlab"
    library = [f"-L{BUILD}", "-lokid_host", f"-Wl,-rpath,{BUILD}"]
    subprocess.run(["mkoctfile", "--mex", "-Wall", "-Werror", *INCLUDE, "okid_identify_mex.c", *library,
                    "-o", "okid_identify_mex.mex"], cwd=matlab, check=True)  # fmt: skip
    return folder


def octave(written: Path, script: str) -> str:
    command = ["octave-cli", "--norc", "--quiet", "--eval", RECORD + script]
    return subprocess.run(command, cwd=written / "matlab", capture_output=True, text=True, check=True).stdout


def test_rust_finds_a_mode_by_both_libraries(written: Path) -> None:
    crate = written / "rust" / "okid-sys"
    environment = {**os.environ, "OKID_LIB_DIR": str(BUILD), "CARGO_TARGET_DIR": str(written / "target")}
    run = subprocess.run(["cargo", "test", "--offline", "--test", "modes"], cwd=crate, env=environment,
                         capture_output=True, text=True)  # fmt: skip
    assert run.returncode == 0, run.stderr + run.stdout
    assert "test result: ok. 2 passed" in run.stdout
    assert "warning" not in run.stderr


def test_octave_finds_a_mode(written: Path) -> None:
    shown = octave(written, """
        q = okid_identify (u, y, fs, struct ('method', 'okid-era', 'order', 2));
        printf ("%d %.9f %.9f %s\\n", numel (q.modes), q.modes(1).frequency_hz, q.modes(1).damping_ratio, q.schema);
        """)  # fmt: skip
    count, frequency, damping, schema = shown.split()
    assert (count, schema) == ("1", "okid.result/1")
    assert float(frequency) == pytest.approx(12.5, rel=1e-5)
    assert float(damping) == pytest.approx(0.02, rel=1e-3)


@pytest.mark.parametrize(
    ("call", "text"),
    [
        ("okid_identify (u(1:10), y, fs)", "inputs have 10 samples, outputs 4000: expected as many"),
        ("okid_identify (u, y, -1)", 'fs: found "-1", expected a sample rate in Hz above 0'),
        ("okid_identify (u * 0, y, fs)", "constant"),
        ("okid_identify_mex (1, u, y)", "expected text and two real matrices"),
    ],
)
def test_octave_says_what_is_wrong_and_goes_on(written: Path, call: str, text: str) -> None:
    shown = octave(written, f"try, {call}, catch e, disp (e.message), end; q = okid_identify (u, y, fs); disp ('on')")
    assert text in shown
    assert shown.rstrip().endswith("on")
