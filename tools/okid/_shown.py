# SPDX-License-Identifier: MIT
"""Words for a terminal, whatever names and foreign texts stand in them: as files/shown_text.cpp of the program."""

from __future__ import annotations

import re

# C0 and C1 controls without tab and new line, what turns or hides text, halves of letters.
_HIDDEN = re.compile("[\x00-\x08\x0b-\x1f\x7f-\x9f\u061c\u200e\u200f\u2028-\u202e\u2066-\u2069\ufeff\ud800-\udfff]")


def shown(text: str) -> str:
    """Control characters and the letters that turn the direction of writing as \\x1b and \\u202e."""
    return _HIDDEN.sub(lambda m: f"\\x{ord(m[0]):02x}" if ord(m[0]) < 0x80 else f"\\u{ord(m[0]):04x}", text)
