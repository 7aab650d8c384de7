# SPDX-License-Identifier: MIT
"""A log or a journal, replayed as fast as it goes: all of its signals and modes, at every time of it."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from okid._errors import InputError
from okid.abi.program import needed_program
from okid.data.records import Record, read_csv
from okid.live.finished import Worker, feed_samples
from okid.live.session import Session


class Replayed(Worker):
    """`okid replay` of a log with its config, or of a journal. `options`: more options of it.

    A log becomes a journal in `folder` first: of a journal no listener is opened and no alarm command is run.
    """

    def __init__(self, session: Session, log: Path, config: Path | None, options: Sequence[str], folder: Path) -> None:
        super().__init__(session)
        self._log, self._config, self._options, self._folder = log, config, list(options), folder
        self._record: Record | None = None

    def work(self) -> None:
        page, okid, journal = self.session.config, needed_program(), self._log
        if self._config is not None:
            journal = self._folder / "log.okj"
            self._step([okid, "convert", str(self._log), str(journal), f"--config={self._config}"], "reading")
        table, length_s = self._folder / "samples.csv", 0.0
        self._step([okid, "convert", str(journal), str(table)], "decoding")
        try:
            self._record = read_csv(table)
            length_s = len(self._record.samples) / (self._record.fs_hz or 1.0)
        except InputError as fault:
            page = replace(page, samples=False, absent=f"no signals: {fault}")
        table.unlink()
        events = self._folder / "events.jsonl"
        self.session.describe(replace(page, length_s=length_s, report=replace(page.report, events=events)))
        self._replay([okid, "replay", str(journal), *self._options, "--events=-"], events)

    def _step(self, command: list[str], word: str) -> None:
        self.session.working(f"{word} {self._log.name}")
        self.child.run(command, self.session.working)

    def _replay(self, command: list[str], events: Path) -> None:
        with events.open("w", encoding="utf-8") as kept:

            def take(line: str) -> None:
                kept.write(line)
                event = json.loads(line)
                if event["type"] == "start":
                    self._start(event)
                    return
                self.session.line(line.encode())

            self.session.working(f"replaying {self._log.name}")
            self.child.run(command, self.session.working, take)
        there = self.session.result() is not None
        self.session.ended("ended: result" if there else "ended without a result")

    def _start(self, event: dict[str, object]) -> None:
        """The `start` event with the channels that are in the log, then their samples."""
        record, listed = self._record, event.get("channels")
        event = {**event, "config": self._log.name}
        if record is None or not isinstance(listed, list):
            self.session.event(event)
            return
        at = {name: k for k, name in enumerate(record.names)}
        kept = [one for one in listed if one["name"] in at]  # virtual sensors are not
        self.session.event({**event, "channels": kept})
        if kept:
            feed_samples(self.session, np.ascontiguousarray(record.samples[:, [at[one["name"]] for one in kept]]))
        self._record = None
