# SPDX-License-Identifier: MIT
"""Did every sample come: counts of the channels, and what the buses lost."""

from __future__ import annotations

from okid.report import page
from okid.report.material import Material


def completeness(m: Material) -> list[tuple[str, int, int]]:
    """Channel, samples expected, samples received: of the last `stats` event, else of the record."""
    if m.events is not None and m.events.stats is not None:
        given = m.events.stats.get("channel")
        rows = given.items() if isinstance(given, dict) else ()
        return [
            (str(name), int(one.get("expected", 0)), int(one.get("received", 0)))
            for name, one in rows
            if isinstance(one, dict)
        ]
    if m.measured is not None and m.measured.missing is not None:
        names, total = m.channels, m.measured.samples
        return [(name, total, total - int(gone)) for name, gone in zip(names, m.measured.missing, strict=True)]
    return []


def losses(m: Material) -> str:
    """What the buses counted, and the causes of the gaps."""
    if m.events is None or m.events.stats is None:
        return ""
    words = []
    buses = m.events.stats.get("bus")
    for name, one in buses.items() if isinstance(buses, dict) else ():
        load = one.get("load_percent")
        lost = one.get("lost_by") or {}
        causes = ", ".join(f"{cause} {number}" for cause, number in lost.items() if number)
        words.append(
            f"{name}: {one.get('received', 0)} frames, {one.get('lost', 0)} lost{f' ({causes})' if causes else ''}"
            + ("" if load is None else f", load {load:g} %")
        )
    by_cause: dict[str, int] = {}
    for (_, cause), number in m.events.gaps.items():
        by_cause[cause] = by_cause.get(cause, 0) + number
    if by_cause:
        words.append("gaps: " + ", ".join(f"{number} samples by {cause}" for cause, number in sorted(by_cause.items())))
    if m.events.lost_lines:
        words.append(f"{m.events.lost_lines} lines of the events file were lost")
    return page.note("; ".join(words) + ".") if words else ""


def complete_table(m: Material) -> str:
    rows = completeness(m)
    if not rows and (m.result.raw.get("responses") or m.result.raw.get("set_ups")):
        return ""
    if not rows:
        return page.note("Completeness: give --record FILE or --events FILE.jsonl.")
    cells = []
    for name, expected, received in rows:
        share = f"{100.0 * (expected - received) / expected:.4g}" if expected else "–"
        cells.append([name, str(expected), str(received), share])
    size = len(cells) if len(cells) <= 12 else -(-len(cells) // 2)
    head = ["channel", "expected", "received", "missing [%]"]
    tables = [page.table(head, cells[k : k + size]) for k in range(0, len(cells), size)]
    return page.heading("Completeness of the channels") + page.beside(*tables)
