# SPDX-License-Identifier: MIT
"""The helpers of tests/property, and okid-live as a process of its own."""

from __future__ import annotations

import contextlib
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

if TYPE_CHECKING:
    from live_process import Live

for _folder in ("property", "live"):
    sys.path.insert(0, str(Path(__file__).resolve().parents[1] / _folder))


@pytest.fixture
def okid_live() -> Iterator[Callable[..., Live]]:
    """Starts okid-live with arguments; what still runs is ended."""
    from live_process import Live

    running: list[Live] = []

    def begin(*arguments: object) -> Live:
        running.append(Live(*arguments))
        return running[-1]

    yield begin
    for one in running:
        if one.process.poll() is None:
            one.process.kill()
        with contextlib.suppress(ValueError):
            one.process.communicate()
