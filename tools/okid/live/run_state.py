# SPDX-License-Identifier: MIT
"""What is known of one run of okid from its events: everything but the samples."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass
from typing import Any

from okid.live.tracks import Tracks
from okid.live.wording import describe

LOG_ENTRIES, HITS, MARKS = 400, 200, 200
RESULT_PARTS = ("method", "fs_hz", "samples", "records", "gaps", "inputs", "outputs", "p", "rows", "order", "modes",
                "mkr", "pdc", "fit", "warnings")  # fmt: skip


@dataclass(frozen=True)
class Channel:
    """One of `values` of a samples event; role force = input, aux = neither input nor output."""

    name: str
    role: str
    unit: str
    dof: int | None


def channels_of(start: dict[str, Any]) -> list[Channel]:
    """The channels of a `start` event in the order of its samples; empty when it does not tell them."""
    listed = start.get("channels")
    out = []
    for each in listed if isinstance(listed, list) else []:
        dof = each.get("dof")
        out.append(Channel(str(each["name"]), str(each.get("role", "aux")), str(each.get("unit") or ""),
                           dof if isinstance(dof, int) and dof >= 1 else None))  # fmt: skip
    return out


class RunState:
    """Events go in by take(); what the page shows comes out as plain JSON values."""

    def __init__(self) -> None:
        self.link = "waiting"  # "live", "ended", "working", "failed"
        self.link_text = "waiting for okid"
        self._begin({})

    def _begin(self, start: dict[str, Any]) -> None:
        self.start = start
        self.channels = channels_of(start)
        rate = start.get("rate_hz")
        self.rate_hz = float(rate) if isinstance(rate, int | float) and rate > 0 else None
        self.t = 0.0
        self.modes: dict[str, Any] | None = None
        self.stats: dict[str, Any] | None = None
        self.result: dict[str, Any] | None = None
        self.whole: dict[str, Any] | None = None
        self.model: dict[str, Any] | None = None
        self.alarm: dict[str, Any] | None = None
        self.tracks = Tracks()
        self.marks: deque[dict[str, Any]] = deque(maxlen=MARKS)
        self.hits: deque[dict[str, Any]] = deque(maxlen=HITS)
        self.log: deque[dict[str, Any]] = deque(maxlen=LOG_ENTRIES)
        self.logged = 0

    def linked(self, there: bool) -> None:
        """okid came or went."""
        if there:
            self.link, self.link_text = "live", "live"
        elif self.result is not None:
            self.link, self.link_text = "ended", "ended: result"
        else:
            again = bool(self.start)
            self.link = "waiting"
            self.link_text = "okid ended without a result; waiting for it" if again else "waiting for okid"

    def working(self, text: str) -> None:
        """What is being done for the page."""
        self.link, self.link_text = "working", text

    def ended(self, text: str) -> None:
        """Nothing more comes."""
        self.link, self.link_text = "ended", text

    def failed(self, text: str) -> None:
        """It came to nothing, and why."""
        self.link, self.link_text = "failed", "failed"
        self.note(text, "bad")

    def take(self, event: dict[str, Any]) -> bool:
        """Take an event in; True when it is the start of another run than the one before.

        Raises KeyError or TypeError for one that is not built as documented: it may have been taken in part.
        """
        kind, t = event["type"], event.get("t")
        if kind in ("modes", "stats", "result") and not isinstance(t, int | float):
            raise TypeError(f"t of {kind} is {t!r}")
        fresh = kind == "start" and event != self.start
        if fresh:
            self._begin(event)
        if isinstance(t, int | float):
            self.t = max(self.t, float(t))
        if kind == "modes":
            self.tracks.add(event)
            self.modes = event
        elif kind == "stats":
            self.stats = event
        elif kind in ("alarm", "alarm_over"):
            self.alarm = event if kind == "alarm" else None
        elif kind == "hit":
            self.hits.append({key: value for key, value in event.items() if key != "type"})
        elif kind == "result":
            self._keep_result(event)
        if kind in ("alarm", "alarm_over", "change", "trigger") or (kind == "change_test" and event.get("alarm")):
            self.marks.append({"kind": kind, "t": self._moment(event)})
        if kind != "start" or fresh:
            self.say(event)
        return fresh

    def _moment(self, event: dict[str, Any]) -> float:
        """When it happened, s: the sample where it names one, else when it was reported."""
        if self.rate_hz and isinstance(event.get("sample"), int):
            return float(event["sample"]) / self.rate_hz
        return float(event.get("t", self.t))

    def _keep_result(self, event: dict[str, Any]) -> None:
        result = event["result"]
        self.result = {"t": event["t"], **{key: result[key] for key in RESULT_PARTS if key in result}}
        self.whole, self.model = result, result.get("model")
        self.link, self.link_text = "ended", "ended: result"

    def say(self, event: dict[str, Any]) -> None:
        """Into the log, unless it is no news."""
        words = describe(event)
        if words is None:
            return
        self.logged += 1
        t = event.get("t", self.t)
        self.log.append({"n": self.logged, "t": t, "type": event["type"], "weight": words[0], "text": words[1]})
        if event["type"] == "gap":
            self.log[-1].update({key: event.get(key) for key in ("channel", "first", "last")})

    def note(self, text: str, weight: str = "warn") -> None:
        """A remark of the page itself into the log."""
        self.logged += 1
        self.log.append({"n": self.logged, "t": self.t, "type": "page", "weight": weight, "text": text})
