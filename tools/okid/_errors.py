# SPDX-License-Identifier: MIT
"""What can go wrong, as exceptions. All are ValueError, so callers that know nothing of okid catch them too."""

from __future__ import annotations

from okid._shown import shown


class Error(ValueError):
    """Base of every error of this package. `status` is the code of the C library, 0 when Python found the fault.

    Control characters in the message are escaped: it is shown on terminals."""

    def __init__(self, message: str, status: int = 0) -> None:
        super().__init__(shown(message))
        self.status = status


class InputError(Error):
    """An argument, a file or a record is not what was expected: the message says what was found."""


class IdentificationError(Error):
    """The data were read, but no reliable model can be identified (constant input, too short, weak excitation ..)."""
