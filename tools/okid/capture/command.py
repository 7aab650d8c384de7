# SPDX-License-Identifier: MIT
"""okid-capture: the command; what a sub-command needs is loaded when it is chosen."""

from __future__ import annotations

import os
import signal
import sys
import threading
from collections.abc import Sequence
from importlib import import_module
from types import FrameType

from okid.capture.command_line import make_parser
from okid.data.interrupt import early_end


def main(arguments: Sequence[str] | None = None) -> int:
    """Entry point of okid-capture; returns the exit code. Ctrl-C and SIGTERM end a run in order, with its result."""
    with early_end("okid-capture"):
        args = make_parser().parse_args(arguments)
        place, _, name = args.command.partition(":")
        module = import_module(f"okid.capture.{place}")
        command = getattr(module, name)
        getattr(module, "load", id)(args)
        from okid.capture.outcome import guarded
    stop = threading.Event()

    def ask_to_stop(_number: int, _frame: FrameType | None) -> None:
        stop.set()

    before = {number: signal.signal(number, ask_to_stop) for number in (signal.SIGINT, signal.SIGTERM)}
    try:
        code = guarded(command, args, stop)
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
    try:
        sys.stdout.flush()
    except OSError:  # the reader of our lines has gone: nothing is flushed at the end either
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
    return code
