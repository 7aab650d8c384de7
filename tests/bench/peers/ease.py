# SPDX-License-Identifier: MIT
"""Lines of code from a recorded candump log to modes: a script of scripts/ runs on the log, its lines are counted.

usage: ease.py SCRIPT FOLDER OUT.json (FOLDER holds rig.log, rig-config.dbc, truth.json: capture.py makes it)
"""

from __future__ import annotations

import ast
import contextlib
import importlib
import io
import json
import logging
import sys
import warnings
from pathlib import Path
from typing import Any

import numpy as np

HERE = Path(__file__).parent
RATE_HZ = 1000.0
INPUTS = ["Force1", "Force4"]
OUTPUTS = [f"Accel{k}" for k in range(1, 7)]


def code_lines(path: Path) -> int:
    """Lines that hold code: no blank ones, comments or docstrings."""
    text = path.read_text(encoding="utf-8")
    held = {line for line, words in enumerate(text.splitlines(), 1) if words.strip() and words.strip()[0] != "#"}
    for node in ast.walk(ast.parse(text)):
        body = getattr(node, "body", None)
        if (
            isinstance(body, list)
            and body
            and isinstance(body[0], ast.Expr)
            and isinstance(body[0].value, ast.Constant)
        ):
            held -= set(range(body[0].lineno, (body[0].end_lineno or 0) + 1))
    return len(held)


def worst_frequency(found: Any, truth: list[float]) -> float:
    there = np.asarray(found, float)
    return max(float(np.min(np.abs(there - f)) / f) for f in truth) if len(there) else float("inf")


def main() -> None:
    script, folder, out = sys.argv[1], Path(sys.argv[2]), Path(sys.argv[3])
    row: dict[str, Any] = {"peer": script, "lines": code_lines(HERE / "scripts" / f"{script}.py")}
    if script.startswith("with_"):
        warnings.simplefilter("ignore")
        logging.disable(logging.INFO)
        truth = json.loads((folder / "truth.json").read_text(encoding="utf-8"))["frequency_hz"]
        decode = importlib.import_module("scripts.decode_log")
        u, y = decode.read(str(folder / "rig.log"), str(folder / "rig-config.dbc"), INPUTS, OUTPUTS)
        try:
            with contextlib.redirect_stdout(io.StringIO()), contextlib.redirect_stderr(io.StringIO()):
                found = importlib.import_module(f"scripts.{script}").modes(u, y, RATE_HZ)
            row["frequency_error"] = worst_frequency(found, truth)
        except Exception as fault:  # a peer may raise anything: it is its result
            row["failed"] = f"{type(fault).__name__}: {fault}"[:200]
    out.write_text(json.dumps(row), encoding="utf-8")


if __name__ == "__main__":
    main()
