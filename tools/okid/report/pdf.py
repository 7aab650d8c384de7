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
    part = goal.with_name(f".{goal.name}.{os.getpid()}.part")
    with tempfile.TemporaryDirectory(prefix="okid-pdf-") as profile:
        command = [
            program, "--headless=new", "--disable-gpu", "--no-first-run", "--disable-extensions",
            "--disable-dev-shm-usage",
            f"--user-data-dir={profile}", "--no-pdf-header-footer", f"--print-to-pdf={part.resolve()}",
            Path(page).resolve().as_uri(),
        ]  # fmt: skip
        if os.geteuid() == 0:
            command.insert(1, "--no-sandbox")  # Chromium does not run as root otherwise; the page is our own
        try:
            done = subprocess.run(command, capture_output=True, text=True, timeout=TIMEOUT_S, errors="replace")
            words = (done.stderr.strip().splitlines() or [""])[-1]
            if done.returncode != 0 or not part.is_file() or part.read_bytes()[:5] != b"%PDF-":
                raise InputError(f"{goal}: {program} made no PDF (exit {done.returncode}): {words}")
            halt_if_interrupted()
            part.replace(goal)
        except subprocess.TimeoutExpired:
            raise InputError(f"{goal}: {program} made no PDF in {TIMEOUT_S:g} s") from None
        except OSError as fault:
            raise InputError(f"{goal}: {fault.strerror or fault}") from None
        finally:
            part.unlink(missing_ok=True)
