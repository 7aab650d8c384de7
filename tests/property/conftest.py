# SPDX-License-Identifier: MIT
"""Hypothesis draws the same examples every time: a red test is red everywhere."""

from hypothesis import HealthCheck, settings

settings.register_profile(
    "okid", deadline=None, derandomize=True, database=None, max_examples=40, print_blob=True,
    suppress_health_check=[HealthCheck.too_slow],
)  # fmt: skip
settings.load_profile("okid")
