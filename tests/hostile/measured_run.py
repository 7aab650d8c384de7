# SPDX-License-Identifier: MIT
"""The program under test with what it took: exit code, words, memory."""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
from dataclasses import dataclass

from program import PROGRAM


@dataclass
class Measured:
    returncode: int
    stdout: str
    stderr: str
    peak_mb: float  # most memory it held at once


# Begins the program from a small process: Linux counts what the one before an exec() held.
LAUNCHER = """
import os, sys
child = os.fork()
if child == 0:
    os.execvp("timeout", sys.argv[2:])
_, status, usage = os.wait4(child, 0)
print(usage.ru_maxrss, file=open(sys.argv[1], "w"))
sys.exit(os.waitstatus_to_exitcode(status))
"""


def measured(*arguments: object, program: str = PROGRAM, within_s: float = 120) -> Measured:
    """Run to the end. In the realtime tier (OKID_REALTIME) a run that takes longer is killed and fails the test."""
    seconds = within_s if os.environ.get("OKID_REALTIME") else 1800
    with tempfile.NamedTemporaryFile("r") as peak:
        done = subprocess.run(
            [sys.executable, "-S", "-c", LAUNCHER, peak.name, "timeout", "-k", "1", str(seconds), program,
             *map(str, arguments)],
            stdin=subprocess.DEVNULL, capture_output=True, text=True, errors="replace", check=False,
        )  # fmt: skip
        assert done.returncode != 124, f"it was still running after {seconds} s"
        return Measured(done.returncode, done.stdout, done.stderr, int(peak.read()) / 1000)
