# SPDX-License-Identifier: MIT
"""Hypothesis draws the same examples every time: a red test is red everywhere."""

from hypothesis import settings

settings.register_profile("okid", deadline=None, derandomize=True, database=None, max_examples=40, print_blob=True)
settings.load_profile("okid")
