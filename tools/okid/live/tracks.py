# SPDX-License-Identifier: MIT
"""Frequency and damping of every followed mode over time, thinned so that weeks stay a picture."""

from __future__ import annotations

from typing import Any

MOST = 1000  # updates kept


class Tracks:
    """The last updates in full, older ones at ever larger steps: at most `most` updates.

    `updates`: {"n": number, "t": s, "settled": bool, "modes": [[track, f, std_f, zeta, std_zeta, alarm], ..]}, a
    missing deviation is None. `generation` changes when older ones were thinned out: then copies are made again.
    """

    def __init__(self, most: int = MOST) -> None:
        self.updates: list[dict[str, Any]] = []
        self.generation = 0
        self._most = most
        self._count = 0

    def add(self, event: dict[str, Any]) -> None:
        """Take a `modes` event; modes without a track are not followed."""
        rows = [
            [mode["track"], mode.get("frequency_hz"), mode.get("frequency_std_hz"), mode.get("damping_ratio"),
             mode.get("damping_ratio_std"), bool(mode.get("alarm"))]
            for mode in event["modes"]
            if isinstance(mode.get("track"), int)
        ]  # fmt: skip
        self._count += 1
        self.updates.append({"n": self._count, "t": event["t"], "settled": bool(event.get("settled")), "modes": rows})
        if len(self.updates) > self._most:
            half = len(self.updates) // 2
            self.updates = self.updates[:half:2] + self.updates[half:]
            self.generation += 1

    def since(self, number: int) -> list[dict[str, Any]]:
        """Updates after the one with that number."""
        newer = len(self.updates)
        while newer > 0 and self.updates[newer - 1]["n"] > number:
            newer -= 1
        return self.updates[newer:]
