# SPDX-License-Identifier: MIT
"""The tables of docs/comparison.md from build/peers.json, as Markdown on stdout. usage: tables.py PEERS.json"""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Any

BASE = ("okid_kernels", "n4sid-moesp")
NAMES = {
    "okid_kernels": "okid, kernels",
    "okid_identify": "okid.identify",
    "slicot_debian": "SLICOT",
    "ctrlsys_slicot": "ctrlsys",
    "sippy": "SIPPY",
    "nfoursid": "nfoursid",
    "strid_csi": "strid",
    "modred_okid": "modred",
    "systemid": "systemID",
    "mdof_methods": "mdof",
    "python_control": "python-control",
    "llsi_moesp": "llsi",
    "pyoma": "pyOMA-2",
    "sdypy_lscf": "sdypy-EMA",
}
Rows = dict[tuple[str, str, str, float], dict[str, Any]]


def number(value: float | None, digits: int = 3) -> str:
    """So many digits, an exponent below 0.01 only."""
    if value is None:
        return "–"
    if abs(value) >= 10 ** (digits - 1):
        return f"{value:,.0f}"
    if value == 0.0 or abs(value) >= 0.01:
        return f"{value:.{digits}g}"
    return f"{value:.1e}".replace("e-0", "e-")


def table(head: list[str], lines: list[list[str]]) -> str:
    rule = ["---"] * len(head)
    return "\n".join(f"| {' | '.join(line)} |" for line in [head, rule, *lines]) + "\n"


def ways(rows: Rows) -> list[tuple[str, str]]:
    return list(dict.fromkeys((adapter, way) for adapter, way, _, _ in rows))


def times(rows: Rows, cases: list[str]) -> str:
    head = ["program", "way", *(f"{c} ms" for c in cases), *(f"{c} × okid" for c in cases), f"{cases[-1]} MB"]
    lines = []
    for adapter, way in ways(rows):
        own = [rows.get((adapter, way, case, 1.0), {}) for case in cases]
        base = [rows.get((*BASE, case, 1.0), {}).get("seconds") for case in cases]
        if not any(row.get("seconds") for row in own):
            continue
        ms = [number(1e3 * row["seconds"]) if row.get("seconds") else "–" for row in own]
        over = [
            number(row["seconds"] / b, 2) if row.get("seconds") and b else "–" for row, b in zip(own, base, strict=True)
        ]
        memory = own[-1].get("memory_mb")
        lines.append([NAMES[adapter], way, *ms, *over, "–" if memory is None else f"{memory:,.0f}"])
    return table(head, lines)


def cell(row: dict[str, Any], key: str) -> str:
    """An error, or how many modes were not found; ¹ when one record is all there was time for."""
    if row.get("missing"):
        return f"{row['missing']} lost"
    if key not in row:
        return "–"
    few = "¹" if row["records"] == 1 and row["noise_percent"] > 0.0 else ""
    return f"{row[key]:.1e}".replace("e-0", "e-").replace("e+0", "e+") + few


def errors(rows: Rows, cases: list[str], key: str) -> str:
    """Without noise the largest of all cases that were done stands for all."""
    head = ["program", "way", "0 %", *(f"{case}, {noise} %" for case in cases for noise in (1, 5))]
    lines = []
    for adapter, way in ways(rows):
        quiet = [rows[adapter, way, case, 0.0] for case in cases if rows[adapter, way, case, 0.0]["records"]]
        cells = [cell(max(quiet, key=lambda row: (row["missing"], row[key]), default={}), key)]
        cells += [cell(rows.get((adapter, way, case, noise), {}), key) for case in cases for noise in (1.0, 5.0)]
        if any(one != "–" for one in cells):
            lines.append([NAMES[adapter], way, *cells])
    return table(head, lines)


def failures(rows: Rows) -> str:
    """What was said, cut to a line, and the cases."""
    cases: dict[tuple[str, str, str], list[str]] = {}
    for (adapter, way, case, _), row in rows.items():
        said = str(row.get("failed") or row.get("note") or "").replace("|", "/")
        if said:
            short = said if len(said) <= 80 else said[:80].rsplit(" ", 1)[0] + " …"
            cases.setdefault((NAMES[adapter], way, short), []).append(case)
    body = [[name, way, ", ".join(dict.fromkeys(own)), said] for (name, way, said), own in cases.items()]
    return table(["program", "way", "cases", "what it said"], body)


def main() -> None:
    found = json.loads(Path(sys.argv[1]).read_text(encoding="utf-8"))
    rows: Rows = {(r["adapter"], r["way"], r["case"], r["noise_percent"]): r for r in found["rows"]}
    cases = list(dict.fromkeys(case for _, _, case, _ in rows))
    print(f"{found['date']}, versions: " + ", ".join(f"{k} {v}" for k, v in found["versions"].items()) + "\n")
    print("Time of the processor at 1 % noise\n\n" + times(rows, cases))
    print("Worst relative error of a damping ratio\n\n" + errors(rows, cases, "damping_error"))
    print("Worst relative error of a frequency\n\n" + errors(rows, cases, "frequency_error"))
    print("What failed\n\n" + failures(rows))
    if found["decoding"]:
        lines = [
            [r["peer"], r["failed"], "–"]
            if "failed" in r
            else [r["peer"], number(1e3 * r["seconds"]), f"{r['frames_per_second']:,.0f}"]
            for r in found["decoding"]
        ]
        print("Decoding\n\n" + table(["way", "ms", "frames/s"], lines))
        lines = [
            [r["peer"], str(r.get("lines", "–")), r.get("failed") or number(r.get("frequency_error"))]
            for r in found["scripts"]
        ]
        print("Lines of code\n\n" + table(["script", "lines", "worst frequency error"], lines))


if __name__ == "__main__":
    main()
