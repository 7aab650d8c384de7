# SPDX-License-Identifier: MIT
"""Waiting for what another process or thread does. Nothing is judged by how long it takes: the bound only ends a test
that would never end, and a wait is over as soon as what is waited for is there."""

from __future__ import annotations

import subprocess
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

PATIENCE_S = 1800
# In the test kernel (tests/kernel/virtual) nobody is ever late, so lateness is a fault.
VIRTUAL = "time-travel" in Path("/proc/cmdline").read_text()


def until(what: Callable[[], Any], process: subprocess.Popen[Any] | None = None) -> Any:
    """What it gives as soon as that is true. AssertionError when it never is, or when the process has ended before."""
    end = time.monotonic() + PATIENCE_S
    while True:
        found = what()
        if found:
            return found
        assert process is None or process.poll() is None, f"the process ended with {process.returncode}"
        assert time.monotonic() < end, f"it did not come within {PATIENCE_S} s"
        time.sleep(0.01)
