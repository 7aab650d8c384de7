# SPDX-License-Identifier: MIT
"""Waiting for what another process or thread does."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any


def until(what: Callable[[], Any], seconds: float = 30) -> Any:
    """What it gives as soon as that is true; AssertionError when it is not in time."""
    end = time.monotonic() + seconds
    while True:
        found = what()
        if found:
            return found
        assert time.monotonic() < end, f"it did not come within {seconds} s"
        time.sleep(0.01)
