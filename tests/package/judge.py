# SPDX-License-Identifier: MIT
"""Judges what was found inside a clean system by the truth of the rig.

usage: judge.py FOLDER codes | modes FILE | frequencies FILE
"""

from __future__ import annotations

import json
import pathlib
import sys
from typing import Any

import numpy as np


def truth_of(folder: pathlib.Path) -> dict[str, Any]:
    loaded: dict[str, Any] = json.loads((folder / "truth.json").read_text())
    return loaded


def write_codes(folder: pathlib.Path) -> None:
    """The record as 16-bit codes, sample by sample, for the example program."""
    lines = [line for line in (folder / "rig.csv").read_text().splitlines() if not line.startswith("#")]
    samples = np.array([[float(cell) for cell in line.split(",")] for line in lines[1:]])
    samples = samples[:, -4:]  # without a column of time, when there is one
    np.round(samples / np.abs(samples).max(axis=0) * 30000).astype("<i2").tofile(folder / "codes")


def judge_frequencies(found: list[float], truth: dict[str, Any]) -> None:
    assert len(found) == 3, f"{len(found)} modes, expected 3"
    np.testing.assert_allclose(found, truth["frequency_hz"], rtol=1e-3)


def judge_modes(result: dict[str, Any], truth: dict[str, Any]) -> None:
    """Three modes, and M as exact as the issue asks: a percent of its largest entry."""
    judge_frequencies([mode["frequency_hz"] for mode in result["modes"]], truth)
    mass, true_mass = np.array(result["mkr"]["M"]), np.array(truth["M"])
    np.testing.assert_allclose(mass, true_mass, atol=0.01 * true_mass.max(), rtol=0)


def main() -> int:
    folder, task = pathlib.Path(sys.argv[1]), sys.argv[2]
    if task == "codes":
        write_codes(folder)
        return 0
    found = json.loads((folder / sys.argv[3]).read_text())
    if task == "modes":
        judge_modes(found, truth_of(folder))
    else:
        judge_frequencies(found["frequency_hz"], truth_of(folder))
    return 0


if __name__ == "__main__":
    sys.exit(main())
