# SPDX-License-Identifier: MIT
"""How objects of any room show themselves."""
