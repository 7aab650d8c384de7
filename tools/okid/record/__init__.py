# SPDX-License-Identifier: MIT
"""Whole records: identified from samples or frequency responses, several set-ups as one, one to try things with."""
