# SPDX-License-Identifier: MIT
"""The report on paper: printed by the Chromium or Chrome that is installed, without a window."""

from __future__ import annotations

import os
import shutil
import subprocess
import tempfile
from pathlib import Path

from okid._errors import InputError
from okid.data.interrupt import halt_if_interrupted
from okid.data.whole_file import safe_part

BROWSERS = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable", "chrome")
TIMEOUT_S = 120.0


def browser() -> str:
    """The program that prints. InputError when none is on PATH."""
    for name in BROWSERS:
        found = shutil.which(name)
        if found is not None:
            return found
    raise InputError(
        "--pdf needs Chromium or Chrome on PATH, found neither: install it (Debian: apt-get install chromium)"
    )


def print_pdf(program: str, page: str | Path, target: str | Path) -> None:
    """Print the HTML file `page` to `target`, whole or not at all. InputError when the browser makes no PDF."""
    goal = Path(target)
    try:
        with tempfile.TemporaryDirectory(prefix="okid-pdf-") as profile, safe_part(goal) as part:
            _print(program, Path(page), part, goal, profile)
            halt_if_interrupted()
    except subprocess.TimeoutExpired:
        raise InputError(f"{goal}: {program} made no PDF in {TIMEOUT_S:g} s") from None
    except OSError as fault:
        raise InputError(f"{goal}: {fault.strerror or fault}") from None


def _print(program: str, page: Path, part: Path, goal: Path, profile: str) -> None:
    command = [
        program, "--headless=new", "--disable-gpu", "--no-first-run", "--disable-extensions",
        "--disable-dev-shm-usage", f"--user-data-dir={profile}", "--no-pdf-header-footer",
        f"--print-to-pdf={part.resolve()}", page.resolve().as_uri(),
    ]  # fmt: skip
    if os.geteuid() == 0:
        command.insert(1, "--no-sandbox")  # Chromium does not run as root otherwise; the page is our own
    done = subprocess.run(command, capture_output=True, text=True, timeout=TIMEOUT_S, errors="replace")
    words = (done.stderr.strip().splitlines() or [""])[-1]
    if done.returncode != 0 or not part.is_file() or part.read_bytes()[:5] != b"%PDF-":
        raise InputError(f"{goal}: {program} made no PDF (exit {done.returncode}): {words}")
