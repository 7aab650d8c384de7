# SPDX-License-Identifier: MIT
"""An events file of `okid run` or `okid replay` (JSON lines): what the report shows of it."""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple

from okid._errors import InputError
from okid.data.input_file import LONGEST_LINE, open_input, parse_json

ENDS = ("link_up", "restarted")  # events of a bus


class Point(NamedTuple):
    """One mode in one update: t (s, stream time), 1 sigma None = not known."""

    t: float
    frequency_hz: float
    damping_ratio: float
    frequency_std_hz: float | None
    settled: bool


@dataclass
class Events:
    """tracks: updates of each mode by its number. start, stats: the first and last event of their kind, or None.

    alarms (t of the beginning, t of the end or None, text); changes: t of each; gaps: missing samples by channel and
    cause; bus: t, name, event and text of what the buses reported; updates: how many.
    """

    source: str
    start: dict[str, Any] | None = None
    stats: dict[str, Any] | None = None
    tracks: dict[int, list[Point]] = field(default_factory=dict)
    alarms: list[tuple[float, float | None, str]] = field(default_factory=list)
    changes: list[float] = field(default_factory=list)
    gaps: dict[tuple[str, str], int] = field(default_factory=dict)
    bus: list[tuple[float, str, str, str]] = field(default_factory=list)
    updates: int = 0
    lost_lines: int = 0

    @property
    def notes(self) -> dict[str, str]:
        """Title, operator, structure, notes of [acquisition]."""
        given = (self.start or {}).get("notes")
        return {str(key): str(text) for key, text in given.items()} if isinstance(given, dict) else {}

    @property
    def channels(self) -> dict[str, dict[str, Any]]:
        """Name -> role, unit, dof of the channels, as the run had them."""
        given = (self.start or {}).get("channels")
        if not isinstance(given, list):
            return {}
        return {str(one["name"]): one for one in given if isinstance(one, dict) and "name" in one}

    @property
    def rate_hz(self) -> float | None:
        """The sample rate that the run was configured for, None in older files."""
        return _positive((self.start or {}).get("rate_hz"))

    @property
    def stamped_hz(self) -> float | None:
        """Samples a second by the time stamps, of the last `stats`; None when it does not tell."""
        return _positive((self.stats or {}).get("rate_hz_by_stamps"))

    @property
    def stamped_at_s(self) -> float:
        """Stream time of that."""
        return float((self.stats or {}).get("t", 0.0))

    @property
    def bus_trouble(self) -> dict[str, list[str]]:
        """Name of a bus -> kinds of its events, each once; those that only end another are left out."""
        out: dict[str, list[str]] = {}
        for _, name, event, _ in self.bus:
            if event not in ENDS and event not in out.setdefault(name, []):
                out[name].append(event)
        return {name: events for name, events in out.items() if events}


def _positive(value: Any) -> float | None:
    """A number above 0, or None."""
    fits = isinstance(value, int | float) and not isinstance(value, bool) and 0.0 < value < float("inf")
    return float(value) if fits else None


def _lines(path: str | Path) -> Iterator[tuple[int, dict[str, Any]]]:
    """The events with their line numbers; a last line that was cut off (a killed run) is left out."""
    source = str(path)
    try:
        with open_input(path) as file:
            for number, line in enumerate(iter(lambda: file.readline(LONGEST_LINE + 1), b""), 1):
                if len(line) > LONGEST_LINE:
                    raise InputError(f"{source}:{number}: longer than {LONGEST_LINE} bytes, expected an event")
                text = line.decode("utf-8")
                if not text.strip():
                    continue
                try:
                    event = parse_json(text)
                except json.JSONDecodeError as fault:
                    if not text.endswith("\n") and number > 1:
                        return
                    raise InputError(f"{source}:{number}:{fault.colno}: not JSON: {fault.msg}") from None
                if not isinstance(event, dict) or not isinstance(event.get("type"), str):
                    raise InputError(
                        f"{source}:{number}: expected an event with a key 'type', found {text.strip()!r:.60}"
                    )
                yield number, event
    except OSError as fault:
        raise InputError(f"{source}: {fault.strerror or fault}") from None
    except UnicodeDecodeError:
        raise InputError(f"{source}: not UTF-8 text, expected JSON lines of `okid run --events`") from None


def _add_modes(out: Events, event: dict[str, Any], t: float) -> None:
    out.updates += 1
    for place, mode in enumerate(event["modes"], 1):
        track = mode.get("track", place)  # older files have no tracks: then the place counts
        if track is None:
            continue
        std = mode.get("frequency_std_hz")
        out.tracks.setdefault(int(track), []).append(
            Point(t, float(mode["frequency_hz"]), float(mode["damping_ratio"]), None if std is None else float(std),
                  bool(event.get("settled", True)))
        )  # fmt: skip


def _check_stats(event: dict[str, Any]) -> None:
    """KeyError, TypeError or ValueError when the counts are not what the report takes them for."""
    for one in event.get("channel", {}).values():
        int(one["expected"]), int(one["received"])
    for one in event.get("bus", {}).values():
        dict(one.get("lost_by") or {}), int(one.get("received", 0)), float(one.get("load_percent") or 0.0)


def _add(out: Events, event: dict[str, Any]) -> None:
    kind, t = event["type"], float(event.get("t", 0.0))
    if kind == "modes":
        _add_modes(out, event, t)
    elif kind == "stats":
        _check_stats(event)
        out.stats = event
    elif kind == "bus":
        out.bus.append((t, str(event["bus"]), str(event["event"]), str(event.get("text", ""))))
    elif kind == "start":
        out.start = out.start or event
    elif kind == "change":
        out.changes.append(t)
    elif kind == "lost":
        out.lost_lines += int(event.get("count", 1))
    elif kind == "gap":
        key = (str(event["channel"]), str(event.get("cause", "unknown")))
        out.gaps[key] = out.gaps.get(key, 0) + int(event["count"])
    elif kind == "alarm":
        text = f"mode {event.get('mode')}: {float(event['frequency_hz']):.5g} Hz instead of "
        out.alarms.append((t, None, text + f"{float(event['baseline_hz']):.5g} Hz"))
    elif kind == "alarm_over" and out.alarms:
        out.alarms[-1] = (out.alarms[-1][0], t, out.alarms[-1][2])


def read_events(path: str | Path) -> Events:
    """Read an events file line by line; memory: the tracks only. InputError names file and line."""
    out = Events(str(path))
    for number, event in _lines(path):
        try:
            _add(out, event)
        except (AttributeError, KeyError, TypeError, ValueError, ArithmeticError) as fault:
            text = f"not a complete {event['type']!r} event: {type(fault).__name__}: {fault}"
            raise InputError(f"{path}:{number}: {text}") from None
    if out.start is None and not out.updates and out.stats is None:
        raise InputError(f"{path}: no event of okid in it, expected JSON lines of `okid run --events`")
    return out
