# SPDX-License-Identifier: MIT
"""The modes of every update: as curves over time, thinned so that weeks stay a picture, and whole at any of them."""

from __future__ import annotations

import json
import zlib
from typing import Any

MOST, MOST_BYTES = 1000, 32 << 20  # updates kept, and what their compressed events may take


class Tracks:
    """The last updates in full, older ones at ever larger steps: at most `most` updates, fewer where their events are
    large.

    `updates`: {"n": number, "t": s, "settled": bool, "modes": [[track, f, std_f, zeta, std_zeta, alarm], ..]}, a
    missing deviation is None. `generation` changes when older ones were thinned out: then copies are made again.
    """

    def __init__(self, most: int = MOST, most_bytes: int = MOST_BYTES) -> None:
        self.updates: list[dict[str, Any]] = []
        self.generation = 0
        self._most, self._most_bytes = most, most_bytes
        self._count = 0
        self._events: dict[int, bytes] = {}  # by the number of the update
        self._bytes = 0

    def add(self, event: dict[str, Any]) -> None:
        """Take a `modes` event; modes without a track have no curve."""
        rows = [
            [mode["track"], mode.get("frequency_hz"), mode.get("frequency_std_hz"), mode.get("damping_ratio"),
             mode.get("damping_ratio_std"), bool(mode.get("alarm"))]
            for mode in event["modes"]
            if isinstance(mode.get("track"), int)
        ]  # fmt: skip
        self._count += 1
        self.updates.append({"n": self._count, "t": event["t"], "settled": bool(event.get("settled")), "modes": rows})
        self._events[self._count] = zlib.compress(json.dumps(event).encode(), 1)
        self._bytes += len(self._events[self._count])
        while len(self.updates) > self._most or (self._bytes > self._most_bytes and len(self.updates) > 2):
            self._thin_out()

    def _thin_out(self) -> None:
        half = len(self.updates) // 2
        for update in self.updates[1:half:2] if half > 1 else self.updates[:1]:
            self._bytes -= len(self._events.pop(update["n"]))
        self.updates = self.updates[:half:2] + self.updates[half:] if half > 1 else self.updates[1:]
        self.generation += 1

    def at(self, t: float) -> dict[str, Any] | None:
        """The event of the last update that is kept at or before stream time t in s; None before the first."""
        before = [update["n"] for update in self.updates if update["t"] <= t + 1e-9]
        if not before:
            return None
        event: dict[str, Any] = json.loads(zlib.decompress(self._events[before[-1]]))
        return event

    def since(self, number: int) -> list[dict[str, Any]]:
        """Updates after the one with that number."""
        newer = len(self.updates)
        while newer > 0 and self.updates[newer - 1]["n"] > number:
            newer -= 1
        return self.updates[newer:]
