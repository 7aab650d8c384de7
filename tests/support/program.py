# SPDX-License-Identifier: MIT
"""The program under test, run as a user runs it."""

from __future__ import annotations

import os
import subprocess
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
PROGRAM = os.environ.get("OKID_PROGRAM") or str(ROOT / "build" / "okid")


def okid(*arguments: object) -> subprocess.CompletedProcess[str]:
    """`okid ARGUMENTS` without a terminal; whatever its exit code is."""
    return subprocess.run(
        [PROGRAM, *map(str, arguments)],
        capture_output=True,
        text=True,
        timeout=300,
        stdin=subprocess.DEVNULL,
        check=False,
    )
