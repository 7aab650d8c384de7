# SPDX-License-Identifier: MIT
"""What a user waits for in whole: method "auto" beside n4sid-cva with its standard deviations on the same record, one
thread; a report of 5,000 samples of 4 channels beside as many empty axes written as SVG by matplotlib alone.

usage: whole_answers.py [BENCH.json to add to]
"""

from __future__ import annotations

import io
import os
import sys
import tempfile
from pathlib import Path
from typing import Any

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
sys.path.insert(0, str(Path(__file__).resolve().parent.parent / "support"))

import numpy as np  # noqa: E402
import okid  # noqa: E402
import systems  # noqa: E402
from bench_file import keep  # noqa: E402
from identify_beside import least_times  # noqa: E402
from matplotlib.backends.backend_svg import FigureCanvasSVG  # noqa: E402
from matplotlib.figure import Figure  # noqa: E402
from okid.report import write_report  # noqa: E402

AXES = 36  # of that report, on 11 pictures
Ratios = dict[str, float]


def one_thread(u: Any, y: Any, fs: float) -> float:
    """Time of method auto over that of n4sid-cva."""
    ways: list[dict[str, Any]] = [{"method": "auto", "threads": 1}, {"method": "n4sid-cva"}]
    own, one = least_times([lambda way=way: okid.identify(u, y, fs=fs, **way) for way in ways], 3)  # type: ignore[misc]
    print(f"auto {1e3 * own:.0f} ms, n4sid-cva {1e3 * one:.1f} ms: {len(y)} samples, {u.shape[1]} / {y.shape[1]}")
    return own / one


def auto() -> Ratios:
    w1, w2 = systems.w1(), systems.w2()
    return {
        "auto_over_cva_W1": one_thread(*systems.record(w1, 10_000, 1.0, 1), w1.fs),
        "auto_over_cva_W2": one_thread(*systems.record(w2, 20_000, 1.0, 1), w2.fs),
    }


def report() -> Ratios:
    structure = systems.w1()
    u, y = systems.record(structure, 5000, 1.0, 1)
    names = {"input_names": ["force"], "output_names": ["a1", "a2", "a3"]}
    result = okid.identify(u, y, fs=structure.fs, method="n4sid-moesp", order=6, **names)  # type: ignore[arg-type]
    record = okid.Record(["force", "a1", "a2", "a3"], np.hstack([u, y]), structure.fs)

    def bare() -> None:
        for _ in range(AXES // 3):
            drawing = Figure(figsize=(9.6, 3.0))
            for place in (1, 2, 3):
                drawing.add_subplot(1, 3, place)
            FigureCanvasSVG(drawing).print_svg(io.StringIO())

    with tempfile.TemporaryDirectory() as folder:
        ours, theirs = least_times([lambda: write_report(result, Path(folder) / "out.html", record), bare], 3)
    print(f"report of 5,000 samples x 4 channels: {ours:.2f} s; {AXES} empty axes {theirs:.2f} s")
    return {"report_over_empty_axes": ours / theirs}


if __name__ == "__main__":
    keep(auto() | report())
