# SPDX-License-Identifier: MIT
"""sdypy-EMA: Model(frf, freq).get_poles(), select_closest_poles: LSCF, of the PolyMAX family.

It starts from frequency responses: H1 by Welch's method (scipy, Hann, half overlapped, an eighth of the record each) of
all pairs of output and input. A user clicks on stable poles; here the clicks are at the true frequencies, which no user
knows so well. Settings: polynomial order up to 60, half-width of the search for the stable
pole 2 Hz (its default of 50 Hz spans all modes here).
"""

from __future__ import annotations

from typing import Any

import numpy as np
import systems
from problem import CASES, Modes
from scipy.signal import csd
from sdypy import EMA


def _responses(problem: Any) -> Any:
    """f (lines), H1 (outputs x inputs, lines)."""
    length = 1 << int(np.log2(len(problem.u) / 8))
    own: dict[str, Any] = {"fs": problem.fs, "nperseg": length, "axis": 0}
    u, y = problem.u, problem.y
    f, s_uu = csd(u[:, :, np.newaxis], u[:, np.newaxis, :], **own)
    _, s_uy = csd(u[:, :, np.newaxis], y[:, np.newaxis, :], **own)
    h = np.linalg.solve(s_uu, s_uy)  # (lines, inputs, outputs)
    return f, h.transpose(2, 1, 0).reshape(-1, len(f))


def _clicks(problem: Any) -> list[float]:
    """The true frequencies of the structure with so many states and this rate."""
    made: list[systems.Structure] = [case.structure() for case in CASES.values()]
    right = next(s for s in made if 2 * len(s.M) == problem.order)
    return [float(f) for f in right.modes()[0]]


def _lscf(problem: Any) -> Any:
    f, frf = _responses(problem)
    model = EMA.Model(frf, f, lower=0.1, upper=0.49 * problem.fs, frf_type="accelerance", pol_order_high=60)
    model.get_poles(show_progress=False)
    model.select_closest_poles(_clicks(problem), f_window=4)
    return Modes(np.array(model.nat_freq), np.array(model.nat_xi))


WAYS = {"LSCF, 3 to 10 clicks": _lscf}
