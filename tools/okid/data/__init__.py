# SPDX-License-Identifier: MIT
"""Files, records and names that users hand in."""
