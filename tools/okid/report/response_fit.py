# SPDX-License-Identifier: MIT
"""How well the model explains measured responses, and up to which frequency that is asked."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from okid.frf import synthesise
from okid.report.loaded import Loaded
from okid.report.measured import Measured

Real = NDArray[np.float64]
Complex = NDArray[np.complex128]
LINES = 1200  # of a synthesised response


def picture_lines(top_hz: float) -> Real:
    """The frequencies of a synthesised response in a picture."""
    return np.linspace(top_hz / 2000.0, top_hz, LINES)


def synthesised_at(result: Loaded, top_hz: float) -> tuple[Real, Complex]:
    """The lines of a picture, and the responses of the model there."""
    a, line = result.matrices, picture_lines(top_hz)
    return line, synthesise(a["A"], a["B"], a["C"], a["D"], float(result.raw["model"]["dt"]), line)


def reach_hz(result: Loaded) -> float:
    """Just above the highest confident mode."""
    sure = result.frequency_hz[result.confident]
    return min(result.shown_hz, 1.15 * float(np.max(sure))) if len(sure) else result.shown_hz


def explained_percent(measured: Measured, result: Loaded) -> Real:
    """100 (1 - |H - made| / |H|) of every output and input, (n_y, n_u), up to reach_hz()."""
    data = measured.frf
    assert data is not None
    used = (data.frequency_hz > 0.0) & (data.frequency_hz <= reach_hz(result))
    if measured.simulated is None:
        a = result.matrices
        dt = float(result.raw["model"]["dt"])
        made = synthesise(a["A"], a["B"], a["C"], a["D"], dt, data.frequency_hz[used])
    else:
        made = measured.simulated.response[used]
    size = np.linalg.norm(data.response[used], axis=0)
    left = np.linalg.norm(data.response[used] - made, axis=0)
    return np.asarray(100.0 * (1.0 - left / np.maximum(size, 1e-300)), dtype=np.float64)
