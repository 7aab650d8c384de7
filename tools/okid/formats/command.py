# SPDX-License-Identifier: MIT
"""okid-convert: the command; the libraries of the formats are loaded when it has been started."""

from __future__ import annotations

import signal
import sys
from collections.abc import Sequence

from okid.data.interrupt import early_end


def main(arguments: Sequence[str] | None = None) -> int:
    """Entry point of okid-convert; returns the exit code 0, 2 or 130 (interrupted)."""
    with early_end("okid-convert"):
        from okid.formats.conversion import convert
    if arguments is None:  # kill ends it in order, as Ctrl-C
        signal.signal(signal.SIGTERM, signal.default_int_handler)
    return convert(arguments)


if __name__ == "__main__":
    sys.exit(main())
