# SPDX-License-Identifier: MIT
"""What all tests have in common: the helpers of tests/support, signals as a terminal gives them, and one browser for
those that look at pages."""

from __future__ import annotations

import os
import shutil
import signal
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

MARKS = (
    "programs: needs a large program of others (browser, database, broker, shells, emulator): make test-programs",
    "long: takes over a second, named in tests/long: make test-long",
    "realtime: judges the clock on the wall, or how busy the processors are: make test-realtime",
)

TESTS = Path(__file__).resolve().parent
LONG = {line for line in (TESTS / "long").read_text(encoding="utf-8").splitlines() if not line.startswith("#")}

sys.path.insert(0, str(TESTS / "support"))
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # before anything imports NumPy, and for what tests start
# The list of fonts that another checkout has left in the home folder may name fonts that are gone with it.
os.environ.setdefault("MPLCONFIGDIR", str(TESTS.parent / "build" / "matplotlib"))
os.environ["OKID_PROGRESS"] = "0"  # a busy machine would have lines of progress on stderr

# Under nohup, or behind an & of a script, these are ignored, and what the tests start would inherit that.
signal.signal(signal.SIGHUP, signal.SIG_DFL)
signal.signal(signal.SIGINT, signal.default_int_handler)


def pytest_configure(config: pytest.Config) -> None:
    for mark in MARKS:
        config.addinivalue_line("markers", mark)
    # What distributed says of a slow disk is no warning of ours.
    config.addinivalue_line("filterwarnings", "ignore:Creating scratch directories is taking:UserWarning")


@pytest.hookimpl(tryfirst=True)  # before -m chooses
def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    for item in items:
        if "chromium" in getattr(item, "fixturenames", ()):
            item.add_marker("programs")
        if not LONG.isdisjoint((item.nodeid.partition("::")[0], item.nodeid.partition("[")[0])):
            item.add_marker("long")


@pytest.fixture(scope="session")
def chromium() -> str:
    """The program; absent: skipped by hand, a failure in CI."""
    program = shutil.which("chromium")
    if program is None:
        text = "chromium is not installed: apt-get install chromium"
        if os.environ.get("CI") == "true":
            pytest.fail(text)
        pytest.skip(text)
    return program


@pytest.fixture(scope="session")
def one_browser(chromium: str) -> Iterator[Any]:
    """Without a window, driven by playwright, which runs in a process only once: one browser for all tests."""
    from playwright.sync_api import sync_playwright

    with sync_playwright() as driver:
        one = driver.chromium.launch(executable_path=chromium, args=["--no-sandbox", "--disable-dev-shm-usage"])
        yield one
        one.close()


@pytest.fixture
def browser(one_browser: Any) -> Iterator[Any]:
    """Its pages are closed behind each test: a live page goes on drawing."""
    yield one_browser
    for context in one_browser.contexts:
        context.close()
