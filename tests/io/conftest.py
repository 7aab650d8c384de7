# SPDX-License-Identifier: MIT
"""The same draws every time."""

from hypothesis import settings

settings.register_profile("okid", deadline=None, derandomize=True, database=None, max_examples=40, print_blob=True)
settings.load_profile("okid")
