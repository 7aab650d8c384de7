# SPDX-License-Identifier: MIT
"""What a user waits for before anything is identified, beside what others need for the same, in turns within one run:
a table beside pyarrow, a log of frames beside python-can, `import okid` beside `import numpy`.

usage: files.py [BENCH.json to add to]
"""

from __future__ import annotations

import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
from bench_file import keep
from peers.capture import OKID, make

ROWS, COLUMNS, SECONDS = 200_000, 32, 100
READ = """
import re, sys, okid
from okid.abi import host
from okid.data import records
host.library()
def most():
    return int(re.search("VmHWM:\\s*(\\d+) kB", open("/proc/self/status").read())[1])
before = most()
table = okid.read_csv(sys.argv[1])
print(most() - before)
"""


def beside(ours: Callable[[], object], theirs: Callable[[], object], turns: int = 5) -> float:
    """Time of ours over that of theirs, each the least of its turns."""
    took: tuple[list[float], list[float]] = [], []
    for _ in range(turns):
        for work, times in zip((ours, theirs), took, strict=True):
            begun = time.perf_counter()
            work()
            times.append(time.perf_counter() - begun)
    return min(took[0]) / min(took[1])


def run(*words: object) -> str:
    return subprocess.run([str(word) for word in words], check=True, capture_output=True, text=True).stdout


def table(folder: Path) -> dict[str, float]:
    import okid
    import pyarrow.csv

    path = folder / "table.csv"
    values = np.random.default_rng(1).standard_normal((ROWS, COLUMNS))
    names = ",".join(f"c{k}" for k in range(COLUMNS))
    np.savetxt(path, values, fmt="%.6f", delimiter=",", header=names, comments="")
    given = folder / "given.csv"
    given.write_text("# fs_hz: 1000\n" + path.read_text())
    assert np.array_equal(okid.read_csv(given).samples[:, 5], pyarrow.csv.read_csv(path)["c5"].to_numpy())
    kilobytes = int(run(sys.executable, "-c", READ, given))
    return {
        "read_csv_over_pyarrow": beside(lambda: okid.read_csv(given), lambda: pyarrow.csv.read_csv(path)),
        "read_csv_memory_over_numbers": 1024 * kilobytes / values.nbytes,
    }


def log(folder: Path) -> dict[str, float]:
    import can

    make(folder, SECONDS)
    config = folder / "rig-config.toml"
    config.write_text(config.read_text().replace("update_s = 1.0", "update_s = 1000.0"))
    path, out = folder / "rig.log", folder / "result.json"
    frames = sum(1 for _ in can.LogReader(path))

    def by_python_can() -> None:
        for _ in can.LogReader(path):
            pass

    ours = lambda: run(OKID, "replay", path, "-c", config, "--json", out, "--quiet")  # noqa: E731
    shown = beside(ours, by_python_can, 3)
    print(f"{frames} frames: python-can reads them in {1 / shown:.1f} times what okid replay identifies them in")
    return {
        "python_can_over_replay": 1 / shown,
        "python_can_over_convert": 1
        / beside(lambda: run(OKID, "convert", path, folder / "out.csv", "-c", config), by_python_can, 3),
    }


def start(_folder: Path) -> dict[str, float]:
    ours, theirs = (lambda name=name: run(sys.executable, "-c", f"import {name}") for name in ("okid", "numpy"))
    return {"import_okid_over_numpy": beside(ours, theirs)}


def main() -> None:
    ratios: dict[str, float] = {}
    with tempfile.TemporaryDirectory() as folder:
        for part in (start, table, log):
            try:
                ratios |= part(Path(folder))
            except ImportError as without:
                print(f"{part.__name__}: not measured: {without}")
    print("; ".join(f"{name} {value:.2f}" for name, value in ratios.items()))
    keep(ratios)


if __name__ == "__main__":
    main()
