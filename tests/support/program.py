# SPDX-License-Identifier: MIT
"""The program under test, run as a user runs it."""

from __future__ import annotations

import os
import subprocess
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
PROGRAM = str(Path(os.environ.get("OKID_PROGRAM") or ROOT / "build" / "okid").absolute())


def okid(*arguments: object, status: int | None = None) -> subprocess.CompletedProcess[str]:
    """`okid ARGUMENTS` without a terminal; whatever its exit code is, or with the one that is asked for."""
    done = subprocess.run(
        [PROGRAM, *map(str, arguments)],
        capture_output=True,
        text=True,
        timeout=1800,
        stdin=subprocess.DEVNULL,
        check=False,
    )
    if status is not None:
        assert (
            done.returncode == status
        ), f"okid {' '.join(map(str, arguments))}: {done.returncode}\n{done.stdout}{done.stderr}"
    return done
