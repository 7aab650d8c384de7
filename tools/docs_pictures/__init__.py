# SPDX-License-Identifier: MIT
"""The pictures of the documentation, made from real runs."""
