# SPDX-License-Identifier: MIT
"""The same draws every time, and the helpers of tests/property."""

import signal
import sys
from pathlib import Path

from hypothesis import settings

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "property"))
settings.register_profile("okid", deadline=None, derandomize=True, database=None, max_examples=40, print_blob=True)
settings.load_profile("okid")
signal.signal(signal.SIGHUP, signal.SIG_DFL)  # under nohup what we start would not hear it
