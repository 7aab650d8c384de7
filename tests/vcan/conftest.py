# SPDX-License-Identifier: MIT
"""The helpers of tests/property and tests/io."""

import sys
from pathlib import Path

for folder in ("property", "io"):
    sys.path.insert(0, str(Path(__file__).resolve().parents[1] / folder))
