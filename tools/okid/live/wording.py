# SPDX-License-Identifier: MIT
"""What an event is called in the page's log."""

from __future__ import annotations

from typing import Any


def _number(value: Any, form: str = ".6g") -> str:
    return format(value, form) if isinstance(value, int | float) else "?"


def _gap(event: dict[str, Any]) -> tuple[str, str]:
    span = f"samples {event.get('first')} to {event.get('last')}"
    return "bad", f"{event.get('channel')}: {event.get('count')} missing, {span} ({event.get('cause')})"


def _alarm(event: dict[str, Any]) -> tuple[str, str]:
    now, was = _number(event.get("frequency_hz")), _number(event.get("baseline_hz"))
    sigma = _number(event.get("sigma_hz"), ".2g")
    others = len(event.get("modes") or []) - 1
    more = f", {others} more away" if others > 0 else ""
    return "bad", f"alarm: mode {event.get('mode')} at {now} Hz, baseline {was} Hz, σ {sigma} Hz{more}"


def _hit(event: dict[str, Any]) -> tuple[str, str]:
    verdict = "good" if event.get("accepted") else f"rejected ({event.get('reason')})"
    at = f" at point {event['point']}" if "point" in event else ""
    words = f"hit {event.get('number')}{at} {verdict}: {event.get('text')}"
    return ("good" if event.get("accepted") else "warn"), words


def _change(event: dict[str, Any]) -> tuple[str, str]:
    done = "earlier samples were discarded" if event.get("restarted") else "earlier samples are still used"
    return "warn", f"the structure changed at sample {event.get('sample')}; {done}"


def _change_test(event: dict[str, Any]) -> tuple[str, str]:
    if event.get("p_value") is None:
        return "plain", f"change test: {event.get('text')}"
    moved = max(event["modes"], key=lambda mode: abs(mode["shift_percent"]) / mode["sigma_percent"])
    far = f"{moved['frequency_hz']:.4g} Hz {moved['shift_percent']:+.2g} ± {moved['sigma_percent']:.2g} %"
    weight = "bad" if event.get("alarm") else "plain"
    return weight, f"change test: {event.get('text')}, p = {event['p_value']:.2g}; largest shift: {far}"


def _result(event: dict[str, Any]) -> tuple[str, str]:
    result = event.get("result") or {}
    sure = [mode for mode in result.get("modes") or [] if mode.get("confident") is not False]
    return "good", f"result: order {result.get('order')}, {len(sure)} confident modes"


def describe(event: dict[str, Any]) -> tuple[str, str] | None:
    """Weight ("plain", "good", "warn", "bad") and text of an event; None for those that are no news (modes, stats)."""
    kind = event["type"]
    if kind in ("modes", "stats", "samples"):
        return None
    words = {"gap": _gap, "alarm": _alarm, "hit": _hit, "change": _change, "change_test": _change_test}
    words["result"] = _result
    if kind in words:
        return words[kind](event)
    if kind == "start":
        when = f", {event['wall_time']}" if event.get("wall_time") else ""
        return "plain", f"start of {event.get('config')}{when}"
    if kind == "trigger":
        return "plain", f"trigger ({event.get('source')}) at sample {event.get('sample')}"
    if kind == "alarm_over":
        return "good", "alarm cleared: every mode is back at its baseline"
    if kind == "lost":
        return "warn", f"{event.get('count')} lines of okid did not reach this page"
    if kind in ("bus", "record"):
        who = f"{event.get('bus')}: " if kind == "bus" else "recording: "
        return "plain", f"{who}{event.get('event')} {event.get('text') or ''}".rstrip()
    return "plain", f"event {kind!r}"
