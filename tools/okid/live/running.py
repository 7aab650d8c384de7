# SPDX-License-Identifier: MIT
"""A run that the start page began: `okid run` of a config, watched through its socket."""

from __future__ import annotations

import threading
from pathlib import Path

from okid.abi.program import needed_program
from okid.live.feed import Feed
from okid.live.finished import Worker
from okid.live.session import Session

LAST_LINES_S = 60.0  # that a feed may need for them once the run has ended


class Running(Worker):
    """`okid run` of a config that names a socket; it ends by finish(), by itself, or with okid-live. `result`: file of
    its okid.result/1."""

    def __init__(self, session: Session, config: Path, result: Path) -> None:
        super().__init__(session)
        assert session.config.socket is not None
        self._config, self._result = config, result
        self._gone = threading.Event()
        self._gone.set()
        self._feed = Feed(session.config.socket, session.line, self._linked)

    @property
    def goes_on(self) -> bool:
        """Has it not ended yet?"""
        return self._thread.is_alive()

    def finish(self) -> None:
        """Ask the run to end with its result, as Ctrl-C does."""
        self.child.finish()

    def stop(self) -> None:
        super().stop()
        self._feed.stop()

    def work(self) -> None:
        self._feed.start()
        try:
            command = [needed_program(), "run", str(self._config), "--quiet", f"--json={self._result}"]
            self.child.run(command)
            self._gone.wait(LAST_LINES_S)
        finally:
            self._feed.stop()
        if self.session.result() is None:
            self.session.ended("ended without a result")

    def _linked(self, there: bool) -> None:
        if there:
            self._gone.clear()
        self.session.linked(there)
        if not there:
            self._gone.set()
