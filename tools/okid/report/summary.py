# SPDX-License-Identifier: MIT
"""The first section: what came out in a few lines, what was measured, whether every channel is complete, warnings."""

from __future__ import annotations

from typing import Any

from okid.report import page
from okid.report.completeness import complete_table, completeness, losses
from okid.report.material import Material
from okid.report.page import count_of
from okid.report.result_warnings import warning_list
from okid.report.verdict import verdict
from okid.result.shape_places import struck_at

WORDS = ("title", "structure", "operator", "notes")


def _notes(m: Material) -> dict[str, str]:
    """Title, operator, structure ... of the record and of the run; the run has the last word."""
    record = None if m.measured is None else m.measured.record
    out = {} if record is None else {**({"title": record.title} if record.title else {}), **record.notes}
    return {**out, **(m.events.notes if m.events is not None else {})}


def _method(r: dict[str, Any]) -> str:
    if r.get("method") in ("plscf", "poser"):
        said = "degrees, weights and normalisations of matrix fractions" if r["method"] == "plscf" else "set-ups"
        return f"{r['method']}: what several {said} agree on; order {r['order']}"
    if r["p"] is None and r["rows"] is None:
        return f"{r.get('method', '–')}: what several methods, horizons and rates agree on; order {r['order']}"
    return f"{r.get('method', '–')}, p = {r['p']}, {r['rows']} block rows, order {r['order']}"


def _amount(m: Material) -> list[tuple[str, str]]:
    """How much was measured."""
    r = m.result.raw
    count, records = int(r["samples"]), r.get("records", 1)
    if r.get("responses"):
        band = r.get("band_hz") or []
        where = f" from {band[0]:.4g} to {band[1]:.4g} Hz" if len(band) == 2 else ""
        return [("Responses", f"{count} lines{where}" + (f", {records} set-ups" if records > 1 else ""))]
    of = count_of(records, "set-up" if r.get("set_ups") else "record")
    seconds = count / m.result.fs
    return [("Samples", f"{count} at {m.result.fs:g} Hz ({seconds:.2f} s) in {of}"), ("Gaps", f"{r.get('gaps', 0)}")]


def _forces(m: Material) -> str:
    if m.struck:
        ends = [struck_at(name) or (name, 0) for name in m.result.inputs]
        return f"{ends[0][0]}, roving over {len(ends)} places ({', '.join(str(place) for _, place in ends)})"
    if m.result.raw.get("set_ups"):
        return "none in the result: the modes of several set-ups"
    return ", ".join(m.result.inputs) or "none: ambient"


def _facts(m: Material) -> list[tuple[str, str]]:
    r: dict[str, Any] = m.result.raw
    notes = _notes(m)
    rows = [(key.capitalize(), notes[key]) for key in WORDS if notes.get(key)]
    rows += [(key.capitalize(), text) for key, text in notes.items() if key not in WORDS]
    start = None if m.events is None or m.events.start is None else m.events.start.get("wall_time")
    record = None if m.measured is None else m.measured.record
    if start:
        rows.append(("Begun", str(start)[:19].replace("T", " ") + " UTC"))
    elif record is not None and record.start_time is not None:
        rows.append(("Begun", record.start_time.isoformat()))
    stamped = None if m.events is None else m.events.stamped_hz
    rows += [*_amount(m), *([] if stamped is None else [("Rate by the stamps", f"{stamped:.6g} Hz")])]
    hits = r.get("hits") or []
    rows += [
        *([("Hits", f"{sum(bool(one.get('accepted')) for one in hits)} of {len(hits)} used")] if hits else []),
        ("Inputs", _forces(m)),
        ("Outputs", ", ".join(m.result.outputs)),
        *([("Left out", f"{', '.join(m.result.left_out)} (screened: see the warnings)")] if m.result.left_out else []),
        ("Method", _method(r)),
    ]
    if not r.get("responses"):
        said = f"hold {r.get('hold', '–')}, detrend {r.get('detrend', '–')}, start {r.get('start', 'moving')}"
        rows.append(("Treatment", said))
    if m.measured is not None:
        rows.append(("File" if r.get("responses") else "Record", m.measured.source))
        rows += [("Looked at", m.measured.part)] if m.measured.part else []
    return rows


def summary_section(m: Material) -> page.Section:
    """Verdict, facts, completeness, warnings."""
    facts, complete, warnings = page.facts(_facts(m)), complete_table(m), warning_list(m)
    if len(completeness(m)) <= 12:
        return page.section("Summary", verdict(m), page.beside(facts, complete), losses(m), warnings)
    return page.section("Summary", verdict(m), facts, warnings, complete, losses(m))
