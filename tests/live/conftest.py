# SPDX-License-Identifier: MIT
"""okid-live as a process of its own."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Iterator

import pytest
from live_process import Live


@pytest.fixture
def okid_live() -> Iterator[Callable[..., Live]]:
    """Starts okid-live with arguments; what still runs is ended."""
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
