#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""Scores the default identification on measured records whose modes experts signed, beside release 0.1's figures.

`tools/score.py [PROGRAM]` reads measured/reference.json below $OKID_DATA, else ../shared/data. A signed mode is found
when a confident mode lies within its tolerance, one to one; one that is neither signed nor optional is false.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any, NamedTuple

ROOT = Path(__file__).resolve().parents[1]
# found, confident and false of release 0.1 by default
BEFORE = {
    "tower_wn1": (1, 1, 0), "tower_wn2": (0, 1, 1), "tower_wn3": (0, 1, 1), "frame3_flex_quake": (3, 8, 1),
    "frame3_flex_sine10": (3, 4, 0), "frame3_flex_sine15": (3, 3, 0), "frame3_flex_sine20": (3, 6, 1),
    "frame3_flex_decay": (0, 0, 0), "bridge_sim": (6, 6, 0), "ridgecrest_0704": (1, 1, 0),
    "ridgecrest_0706": (1, 4, 3), "ridgecrest_0822": (1, 1, 0), "ridgecrest_200604": (1, 1, 0),
    "ridgecrest_200624": (1, 1, 0), "silverbox_multisine": (1, 1, 0), "silverbox_arrow": (1, 1, 0),
    "plane_lab1_1": (9, 13, 1), "plane_lab1_2": (8, 12, 0), "subframe": (14, 16, 0), "slab_phone": (1, 1, 0),
}  # fmt: skip


class Score(NamedTuple):
    """What a record gave."""

    found: int
    signed: int
    confident: int
    false: int
    damping_right: int
    damping_known: int
    seconds: float


def corpus() -> Path:
    """The folder of the records; it may not exist."""
    return Path(os.environ.get("OKID_DATA") or ROOT.parent / "shared" / "data") / "measured"


def identify(program: str, record: dict[str, Any], *options: str) -> tuple[list[dict[str, Any]], float]:
    """Modes of the default call and the seconds it took; none when it found no model (exit 3)."""
    with tempfile.TemporaryDirectory() as folder:
        out = Path(folder) / "result.json"
        command = [program, "identify", str(corpus() / record["file"]), "--outputs", ",".join(record["outputs"])]
        command += ["--inputs", ",".join(record["inputs"])] if record["inputs"] else []
        begun = time.monotonic()
        done = subprocess.run(
            [*command, "--quiet", "--json", str(out), *options], capture_output=True, text=True, check=False
        )
        seconds = time.monotonic() - begun
        if done.returncode not in (0, 3):
            raise SystemExit(f"{record['id']}: {done.stderr.strip()}")
        return (json.loads(out.read_text())["modes"] if done.returncode == 0 else []), seconds


def judge(record: dict[str, Any], modes: list[dict[str, Any]], seconds: float = 0.0) -> Score:
    """Confident modes against the signed ones, the nearest pairs first."""
    sure = [mode for mode in modes if mode["confident"]]
    pairs = sorted(
        (abs(mode["frequency_hz"] - signed["f"]), i, j)
        for i, signed in enumerate(record["modes"])
        for j, mode in enumerate(sure)
        if abs(mode["frequency_hz"] - signed["f"]) <= signed["f_tol"]
    )
    match: dict[int, int] = {}
    for _, i, j in pairs:
        if i not in match and j not in match.values():
            match[i] = j
    optional = record.get("optional", [])
    false = [
        mode
        for j, mode in enumerate(sure)
        if j not in match.values() and not any(abs(mode["frequency_hz"] - o["f"]) <= o["f_tol"] for o in optional)
    ]
    known = [(record["modes"][i], sure[j]) for i, j in match.items() if record["modes"][i].get("zeta") is not None]
    right = sum(abs(mode["damping_ratio"] - signed["zeta"]) <= signed["zeta_tol"] for signed, mode in known)
    return Score(len(match), len(record["modes"]), len(sure), len(false), right, len(known), seconds)


def main() -> int:
    """The table; exit 1 below 95 % found, above 5 % false or below 90 % of damping right."""
    program = sys.argv[1] if len(sys.argv) > 1 else str(ROOT / "build" / "okid")
    if not (corpus() / "reference.json").is_file():
        print(f"score: no records in {corpus()}: set OKID_DATA to the folder that holds measured/reference.json")
        return 2
    records = json.loads((corpus() / "reference.json").read_text())["records"]
    print(f"{'record':22} {'found':>8} {'false':>8} {'damping':>8} {'s':>6}   release 0.1: found, false")
    scores = []
    for record in records:
        modes, seconds = identify(program, record)
        s = judge(record, modes, seconds)
        scores.append(s)
        before = BEFORE.get(record["id"])
        print(f"{record['id']:22} {s.found:>3} / {s.signed:<2} {s.false:>3} / {s.confident:<2} "
              f"{s.damping_right:>3} / {s.damping_known:<2} {s.seconds:6.2f}   "
              + (f"{before[0]:>3} / {s.signed:<2} {before[2]:>3} / {before[1]:<2}" if before else ""))  # fmt: skip
    t = [sum(getattr(s, key) for s in scores) for key in Score._fields[:6]]
    median = sorted(s.seconds for s in scores)[len(scores) // 2]
    print(f"{'total':22} {t[0]:>3} / {t[1]:<2} {t[3]:>3} / {t[2]:<2} {t[4]:>3} / {t[5]:<2} {median:6.2f} (median)")
    good = t[0] >= 0.95 * t[1] and t[3] <= 0.05 * max(t[2], 1) and t[4] >= 0.9 * t[5]
    return 0 if good else 1


if __name__ == "__main__":
    sys.exit(main())
