# SPDX-License-Identifier: MIT
"""Structures of masses and springs: their model, one of a given pattern fitted to modes, sensors that are not there."""
