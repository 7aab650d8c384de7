# SPDX-License-Identifier: MIT
"""Hypothesis draws the same examples every time: a red test is red everywhere."""

import signal

from hypothesis import settings

settings.register_profile("okid", deadline=None, derandomize=True, database=None, max_examples=40, print_blob=True)
settings.load_profile("okid")
signal.signal(signal.SIGHUP, signal.SIG_DFL)  # under nohup what we start would not hear it
