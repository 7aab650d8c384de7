# SPDX-License-Identifier: MIT
"""okid-live: one web page that shows what a running `okid run` or `okid replay` tells its subscribers."""

from collections.abc import Sequence

from okid.data.interrupt import early_end

__all__ = ["main"]


def main(arguments: Sequence[str] | None = None) -> int:
    """Entry point of okid-live; exit codes: 0 ended by Ctrl-C or SIGTERM, 2 wrong usage, 4 address not available,
    130 interrupted before it began."""
    with early_end("okid-live"):
        from okid.live.command import main as command
    return command(arguments)
