# SPDX-License-Identifier: MIT
"""okid.identify beside SLICOT's MOESP (Cholesky: IB01AD, IB01BD; A, B, C, D, K) on the same arrays, in turns within one
process, one thread; the least processor time of each. usage: identify_beside.py [BENCH.json to add to]

The true order, s block rows (okid methods: p = s, 2 s block rows), 1 % noise; without standard deviations but for one
row. SLICOT works on its own copies in Fortran order, made before; its modes are not computed.
"""

from __future__ import annotations

import os
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
HERE = Path(__file__).resolve().parent
sys.path[:0] = [str(HERE / "peers"), str(HERE.parent / "support")]

import numpy as np  # noqa: E402
import okid  # noqa: E402
import systems  # noqa: E402
from bench_file import keep  # noqa: E402

SIZES = (("W1", 10_000, 10), ("W2", 20_000, 15), ("W3", 100_000, 22), ("W1", 10_000, 40), ("W2", 10_000, 30),
         ("W3", 10_000, 25))  # fmt: skip
SIGMA = "_sigma"  # with standard deviations, analytic
METHODS = ("okid-era", "okid-era-dc", "n4sid-moesp", "n4sid-cva", "n4sid-ssarx", "n4sid-moesp" + SIGMA)


def of_okid(method: str, u: Any, y: Any, fs: float, order: int, s: int) -> Callable[[], object]:
    rows: dict[str, int] = {"rows": s} if method.startswith("n4sid") else {"p": s, "rows": 2 * s}
    sigma = "analytic" if method.endswith(SIGMA) else "none"
    return lambda: okid.identify(
        u, y, fs=fs, method=method.removesuffix(SIGMA), order=order, detrend="none", sigma=sigma, **rows
    )


def least_times(ways: list[Callable[[], object]], turns: int) -> list[float]:
    best = [np.inf] * len(ways)
    for _ in range(turns):
        for k, way in enumerate(ways):
            begin = time.process_time()
            way()
            best[k] = min(best[k], time.process_time() - begin)
    return best


def main() -> None:
    from adapters.slicot_debian import prepared

    ratios: dict[str, float] = {}
    for name, samples, s in SIZES:
        structure: systems.Structure = {
            "W1": systems.w1,
            "W2": systems.w2,
            "W3": systems.w3,
        }[name]()
        u, y = systems.record(structure, samples, 1.0, 1)
        order = 2 * len(structure.M)
        ways = [
            prepared("M", "C", u, y, order, s),
            *(of_okid(m, u, y, structure.fs, order, s) for m in METHODS),
        ]
        slicot, *times = least_times(ways, 7 if samples > 50_000 else 25)
        print(f"okid.identify {name}, s = {s}: SLICOT {1e3 * slicot:.2f} ms")
        for method, took in zip(METHODS, times, strict=True):
            ratios[f"slicot_moesp_over_identify_{method}_{name}_s{s}"] = slicot / took
            print(f"  {method:17} {1e3 * took:7.2f} ms, SLICOT takes {slicot / took:.2f} times as long")
    keep(ratios)


if __name__ == "__main__":
    try:
        main()
    except OSError as without:
        print(f"okid.identify beside SLICOT: not measured: {without}")
