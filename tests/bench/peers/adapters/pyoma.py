# SPDX-License-Identifier: MIT
"""pyOMA-2: SingleSetup(y, fs), SSI(br, ordmax, method): poles of every order up to the true one, the last is taken.

"cov": from the outputs alone, as operational modal analysis does; "IOcov": with the measured force. Settings: br = s
(or 4 s), ordmax = true order, step 1, its limits on damping and mode complexity off (they would hide poles). No B, D.
"""

from __future__ import annotations

import logging
from typing import Any

import numpy as np
from problem import Modes
from pyoma2.algorithms import SSI
from pyoma2.setup import SingleSetup

logging.disable(logging.INFO)


def _pyoma(method: str, times: int = 1) -> Any:
    def way(problem: Any) -> Any:
        limits = {"xi_max": 1.0, "mpc_lim": None, "mpd_lim": None, "CoV_max": None}
        setup = SingleSetup(problem.y, fs=problem.fs)
        ssi = SSI(
            name="ssi", method=method, br=times * problem.rows, ordmax=problem.order, step=1, hc=limits,
            U=problem.u if method == "IOcov" else None,
        )  # fmt: skip
        setup.add_algorithms(ssi)
        setup.run_by_name("ssi")
        f, zeta = ssi.result.Fn_poles[:, -1], ssi.result.Xi_poles[:, -1]
        there = np.isfinite(f)
        return Modes(f[there], zeta[there])

    return way


WAYS = {
    "SSI IOcov": _pyoma("IOcov"),
    "SSI-cov, outputs only": _pyoma("cov"),
    "SSI-cov, outputs only, 4 s": _pyoma("cov", 4),
}
