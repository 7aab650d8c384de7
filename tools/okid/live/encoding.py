# SPDX-License-Identifier: MIT
"""Arrays in JSON for a browser: base64 of little-endian numbers, which costs both sides little."""

from __future__ import annotations

import base64
from typing import Any

import numpy as np


def packed(array: Any) -> str:
    """float32 (uint8 for an array of that type), row by row; NaN stays NaN."""
    given = np.asarray(array)
    kind = given.dtype if given.dtype == np.uint8 else np.dtype("<f4")
    return base64.b64encode(np.ascontiguousarray(given, dtype=kind).tobytes()).decode("ascii")
