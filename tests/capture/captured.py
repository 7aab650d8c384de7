# SPDX-License-Identifier: MIT
"""What the tests of the acquisition scripts share: frames of a log, results side by side, the program's samples."""

from __future__ import annotations

import json
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import can
import numpy as np
from numpy.typing import NDArray
from okid import capture
from program import okid

COMMAND = [sys.executable, "-m", "okid.capture"]


def frames(path: Path) -> list[can.Message]:
    return list(capture.log_messages(path))


def samples_of(log: Path, config: Path) -> tuple[NDArray[np.float64], capture.Capture]:
    """The samples of a log by the package, and its counts."""
    kept = capture.Capture(config, identify=False)
    blocks = list(capture.can_blocks(capture.log_messages(log), kept.config, samples=kept))
    return np.vstack(blocks), kept


def samples_by_program(log: Path, config: Path) -> NDArray[np.float64]:
    """The same by `okid convert`, in the units of the config."""
    table = log.with_suffix(".csv")
    done = okid("convert", log, table, "-c", config)
    assert done.returncode == 0, done.stderr
    rows = [line for line in table.read_text().splitlines() if not line.startswith("#")]
    columns = [name for name in rows[0].split(",") if name != "time_s"]
    return np.genfromtxt(rows[1:], delimiter=",", ndmin=2)[:, -len(columns) :]


def assert_same_result(one: dict[str, Any], other: dict[str, Any], tolerance: float = 1e-9) -> None:
    """Frequencies, damping, order and counts of two okid.result/1."""
    for key in ("schema", "method", "fs_hz", "samples", "gaps", "inputs", "outputs", "p", "rows", "order"):
        assert one[key] == other[key], key
    assert len(one["modes"]) == len(other["modes"]) > 0
    for a, b in zip(one["modes"], other["modes"], strict=True):
        assert abs(a["frequency_hz"] / b["frequency_hz"] - 1) < tolerance
        assert abs(a["damping_ratio"] / b["damping_ratio"] - 1) < 1e-6
        assert abs(a["frequency_std_hz"] / b["frequency_std_hz"] - 1) < 1e-4


def assert_truth(result: dict[str, Any], truth: Path, tolerance: float = 2e-3) -> None:
    """Every true mode is found."""
    found = [mode["frequency_hz"] for mode in result["modes"]]
    for frequency in json.loads(truth.read_text())["frequency_hz"]:
        assert min(abs(f / frequency - 1) for f in found) < tolerance, (frequency, found)


def edited(source: Path, target: Path, change: Callable[[str], str]) -> Path:
    """A copy of a text file with changes that must have changed something."""
    text = source.read_text()
    assert change(text) != text
    target.write_text(change(text))
    return target
