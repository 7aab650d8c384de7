# SPDX-License-Identifier: MIT
"""What can go wrong, as exceptions. All are ValueError, so callers that know nothing of okid catch them too."""

from __future__ import annotations

import re
import sys

# C0 and C1 controls without tab and new line, what turns or hides text, halves of letters.
_HIDDEN = re.compile("[\x00-\x08\x0b-\x1f\x7f-\x9f\u061c\u200e\u200f\u2028-\u202e\u2066-\u2069\ufeff\ud800-\udfff]")
_LONGEST = 2000  # letters of a message


def shown(text: str) -> str:
    """Words for a terminal, whatever names stand in them, as files/shown_text.cpp of the program: control characters
    and the letters that turn the direction of writing as \\x1b and \\u202e."""
    return _HIDDEN.sub(lambda m: f"\\x{ord(m[0]):02x}" if ord(m[0]) < 0x80 else f"\\u{ord(m[0]):04x}", text)


def one_line(text: object) -> str:
    """shown() with new lines as \\n too: the name of a file makes no second message."""
    return shown(str(text)).replace("\n", "\\n")


def say(text: str, flush: bool = False) -> None:
    """Lines on stdout, as a command has them to tell; names of files and channels may stand in them."""
    print(shown(text), flush=flush)


def complain(program: str, text: object) -> None:
    """One line on stderr."""
    print(f"{program}: {one_line(text)}", file=sys.stderr, flush=True)


class Error(ValueError):
    """Base of every error of this package. `status` is the code of the C library, 0 when Python found the fault.

    Control characters in the message are escaped: it is shown on terminals. What a file says may stand in it: it is cut
    beyond 2000 letters."""

    def __init__(self, message: str, status: int = 0) -> None:
        if len(message) > _LONGEST:
            message = f"{message[: _LONGEST // 2]} … {message[-_LONGEST // 2 :]}"
        super().__init__(shown(message))
        self.status = status


class InputError(Error):
    """An argument, a file or a record is not what was expected: the message says what was found."""


class IdentificationError(Error):
    """The data were read, but no reliable model can be identified (constant input, too short, weak excitation ..)."""
