# SPDX-License-Identifier: MIT
"""The same draws every time, and the helpers of tests/property."""

import sys
from pathlib import Path

from hypothesis import settings

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "property"))
settings.register_profile("okid", deadline=None, derandomize=True, database=None, max_examples=40, print_blob=True)
settings.load_profile("okid")
