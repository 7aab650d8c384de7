# SPDX-License-Identifier: MIT
"""okid.identify: model, modes, B and D of the record, fits of simulation and prediction.

Settings: the true order, p = s lags and 2 s block rows for the okid methods, s block rows for the n4sid methods, no
detrending as no peer does it. "p = 2 s": the observer order of those peers whose OKID cannot set it apart from the
number of Markov parameters. "with sigma": standard deviations too. "as it comes": okid-era, order
found by itself, mean removed, p = 40, 80 block rows, standard deviations from 20 blocks. "outputs only": the force is
not given; s or 4 s block rows.
"""

from __future__ import annotations

from typing import Any

import okid
from adapters.shapes import found_modes


def _same(method: str, lags: int = 1, sigma_blocks: int = 0) -> Any:
    def way(problem: Any) -> Any:
        own: dict[str, int] = {"rows": problem.rows}
        if method.startswith("okid"):
            own = {"p": lags * problem.rows, "rows": 2 * problem.rows}
        result = okid.identify(
            problem.u, problem.y, fs=problem.fs, method=method, order=problem.order, detrend="none",
            sigma_blocks=sigma_blocks, **own,
        )  # fmt: skip
        return found_modes(result.modes)

    return way


def _ambient(times: int) -> Any:
    def way(problem: Any) -> Any:
        result = okid.identify(
            None, problem.y, fs=problem.fs, rows=times * problem.rows, order=problem.order, detrend="none",
            sigma_blocks=0,
        )  # fmt: skip
        return found_modes(result.modes)

    return way


WAYS = {
    "okid-era": _same("okid-era"),
    "okid-era, p = 2 s": _same("okid-era", 2),
    "okid-era-dc": _same("okid-era-dc"),
    "n4sid-moesp": _same("n4sid-moesp"),
    "n4sid-cva": _same("n4sid-cva"),
    "n4sid-ssarx": _same("n4sid-ssarx"),
    "n4sid-moesp with sigma": _same("n4sid-moesp", sigma_blocks=20),
    "okid-era, outputs only": _ambient(1),
    "okid-era, outputs only, 4 s": _ambient(4),
    "as it comes": lambda problem: found_modes(
        okid.identify(problem.u, problem.y, fs=problem.fs, method="okid-era").modes
    ),
    "as it comes, refine": lambda problem: found_modes(
        okid.identify(problem.u, problem.y, fs=problem.fs, refine=True).modes
    ),
}
