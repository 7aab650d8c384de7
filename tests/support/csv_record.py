# SPDX-License-Identifier: MIT
"""A record as the CSV file that `okid identify` reads."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray


def write_csv(path: Path, fs: float, columns: dict[str, NDArray[np.float64]]) -> Path:
    """To the last bit of each number. @return the path"""
    np.savetxt(path, np.column_stack(list(columns.values())), delimiter=",", fmt="%.17g", comments="",
               header=f"# fs_hz: {fs!r}\n" + ",".join(columns))  # fmt: skip
    return path
