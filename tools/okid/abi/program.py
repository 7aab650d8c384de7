# SPDX-License-Identifier: MIT
"""The program `okid`, where there is one: it simulates rigs and converts logs."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

from okid._errors import InputError


def find_program() -> str | None:
    """$OKID_PROGRAM, else the source tree's build, the command beside this Python or on the path; else None."""
    given = os.environ.get("OKID_PROGRAM")
    if given:
        return given
    built = Path(__file__).resolve().parents[3] / "build" / "okid"
    beside = Path(sys.executable).with_name("okid")
    return next((str(one) for one in (built, beside) if os.access(one, os.X_OK)), None) or shutil.which("okid")


def needed_program() -> str:
    """find_program(). Raises InputError where there is none."""
    program = find_program()
    if program is None:
        raise InputError("the program `okid` is needed and was not found: put it on the path, or set OKID_PROGRAM")
    return program


def run_program(*arguments: str | Path) -> str:
    """Standard output of `okid ARGUMENTS`. Raises InputError with its own message, or when there is no program."""
    program = needed_program()
    try:
        done = subprocess.run(
            [program, *map(str, arguments)], capture_output=True, text=True, stdin=subprocess.DEVNULL, check=False
        )
    except OSError as fault:
        raise InputError(f"{program}: cannot be run: {fault.strerror or fault}") from None
    if done.returncode != 0:
        lines = [line for line in done.stderr.strip().splitlines() if line] or [f"it ended with {done.returncode}"]
        raise InputError(lines[-1].removeprefix("okid: "))
    return done.stdout
