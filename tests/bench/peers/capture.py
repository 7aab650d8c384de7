# SPDX-License-Identifier: MIT
"""One way of decoding a candump log to channels, in a process of its own.

usage: capture.py make FOLDER SECONDS | capture.py WAY FOLDER OUT.json

`make` writes rig.log (W2's channels, three messages, 3,000 frames/s), its DBC, config and truth with `okid simulate`.
Functions are timed inside the process, programs from start to end; seconds are those of the processor, least of three.
Every way has to give the values that python-can and cantools give, or it fails.
"""

from __future__ import annotations

import importlib
import json
import os
import resource
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

OKID = str(Path(given).resolve()) if (given := os.environ.get("OKID_PROGRAM")) else "okid"
INPUTS = ["Force1", "Force4"]
OUTPUTS = [f"Accel{k}" for k in range(1, 7)]
RIG = """rate_hz = 1000.0
duration_s = {seconds}.0
seed = 1
masses = [2.0, 1.5, 1.8, 1.2, 1.6, 1.0]
springs = [8e4, 6e4, 7e4, 5e4, 5.5e4, 4e4]
zeta = [0.01, 0.01]
force_dofs = [1, 4]
sense_dofs = [1, 2, 3, 4, 5, 6]
noise_percent = 1.0
bits = 16
"""
Table = dict[str, Any]


def make(folder: Path, seconds: int) -> None:
    (folder / "rig.toml").write_text(RIG.format(seconds=seconds), encoding="utf-8")
    files = ("--log", "rig.log", "--truth", "truth.json", "--config", "rig-config.toml", "--quiet")
    subprocess.run([OKID, "simulate", "rig.toml", *files], cwd=folder, check=True)


def by_cantools(folder: Path) -> Table:
    """python-can's LogReader and cantools' decode_message, frame by frame, as scripts/decode_log.py."""
    decode = importlib.import_module("scripts.decode_log")
    u, y = decode.read(str(folder / "rig.log"), str(folder / "rig-config.dbc"), INPUTS, OUTPUTS)
    return dict(zip(INPUTS + OUTPUTS, np.hstack([u, y]).T, strict=True))


def by_asammdf(folder: Path) -> Table:
    """asammdf's extract_bus_logging from an MF4 of the same frames (written before by python-can, not timed)."""
    import asammdf

    with asammdf.MDF(folder / "rig.mf4") as held:
        out = held.extract_bus_logging({"CAN": [(folder / "rig-config.dbc", 0)]})
        return {name: out.get(name).samples for name in INPUTS + OUTPUTS}


def write_mf4(folder: Path) -> None:
    import can

    with can.MF4Writer(folder / "rig.mf4", database=None) as writer:
        for frame in can.LogReader(folder / "rig.log"):
            writer.on_message_received(frame)


def by_okid_convert(folder: Path) -> Table:
    """okid convert: decoded, aligned on the sample grid with gaps marked, written as CSV."""
    subprocess.run([OKID, "convert", "rig.log", "out.csv", "-c", "rig-config.toml"], cwd=folder, check=True,
                   stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)  # fmt: skip
    return {}


def csv_table(folder: Path) -> Table:
    values = np.loadtxt(folder / "out.csv", delimiter=",", skiprows=3)
    return dict(zip(INPUTS + OUTPUTS, values.T, strict=True))


def by_cantools_program(folder: Path) -> Table:
    """python -m cantools decode --single-line: text in, text out."""
    with open(folder / "rig.log", encoding="ascii") as log:
        subprocess.run([sys.executable, "-m", "cantools", "decode", "--single-line", "rig-config.dbc"], cwd=folder,
                       stdin=log, stdout=subprocess.DEVNULL, check=True)  # fmt: skip
    return {}


WAYS: dict[str, Callable[[Path], Table]] = {
    "okid convert": by_okid_convert,
    "python-can + cantools": by_cantools,
    "cantools decode": by_cantools_program,
    "asammdf extract_bus_logging": by_asammdf,
}


def spent() -> float:
    """Seconds of the processor, those of ended children too."""
    children = resource.getrusage(resource.RUSAGE_CHILDREN)
    return time.process_time() + children.ru_utime + children.ru_stime


def measure(way: str, folder: Path) -> Table:
    frames = (folder / "rig.log").read_bytes().count(b"\n")
    if way.startswith("asammdf"):
        write_mf4(folder)
    took: list[float] = []
    table: Table = {}
    for _ in range(3):
        begin = spent()
        table = WAYS[way](folder)
        took.append(spent() - begin)
    if way == "okid convert":
        table = csv_table(folder)
    row: Table = {"peer": way, "frames": frames, "seconds": min(took), "frames_per_second": frames / min(took)}
    if table:
        right = by_cantools(folder)
        row["largest_difference"] = max(float(np.max(np.abs(table[n] - right[n]))) for n in INPUTS + OUTPUTS)
        if not row["largest_difference"] <= 1e-4 * max(float(np.max(np.abs(v))) for v in right.values()):
            row["failed"] = f"other values than cantools: up to {row['largest_difference']:g}"
    return row


def main() -> None:
    if sys.argv[1] == "make":
        make(Path(sys.argv[2]), int(sys.argv[3]))
        return
    try:
        row = measure(sys.argv[1], Path(sys.argv[2]))
    except Exception as fault:  # a peer may raise anything: it is its result
        said = str(fault).strip().splitlines()
        row = {"peer": sys.argv[1], "failed": f"{type(fault).__name__}: {said[0] if said else ''}"[:200]}
    Path(sys.argv[3]).write_text(json.dumps(row), encoding="utf-8")


if __name__ == "__main__":
    main()
