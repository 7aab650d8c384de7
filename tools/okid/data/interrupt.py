# SPDX-License-Identifier: MIT
"""Ctrl-C at any time: one line, exit code 130, and nothing is written any more, even if the exception is swallowed."""

from __future__ import annotations

import os
import signal
import sys
import threading
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from importlib import import_module
from types import FrameType
from typing import Any

EXIT_INTERRUPTED = 130
_seen = threading.Event()  # a library may swallow KeyboardInterrupt (in a callback, a destructor): this one stays


def _note(_number: int, _frame: Any) -> None:
    _seen.set()
    raise KeyboardInterrupt


def halt_if_interrupted() -> None:
    """Raises KeyboardInterrupt when Ctrl-C came earlier: called before anything gets its final name."""
    if _seen.is_set():
        raise KeyboardInterrupt


def _silent(fault: Any) -> None:
    """What Python says of an exception in a destructor or callback, but for the one that Ctrl-C raised there."""
    if not issubclass(fault.exc_type, KeyboardInterrupt):
        sys.__unraisablehook__(fault)


def guarded(program: str, module: str, arguments: Sequence[str] | None) -> int:
    """Import `module` and call its main(arguments); 130 and one line on stderr when Ctrl-C came in between.

    With arguments None the process ends there: Python would end itself by the signal when an import swallowed it.
    """
    ours = threading.current_thread() is threading.main_thread()
    before = signal.getsignal(signal.SIGINT) if ours else None
    ours = ours and before is signal.default_int_handler  # a program with a handler of its own keeps it
    hook = sys.unraisablehook
    _seen.clear()
    try:
        if ours:
            sys.unraisablehook = _silent
            signal.signal(signal.SIGINT, _note)
            if arguments is None:
                signal.signal(signal.SIGTERM, _note)
        return int(import_module(module).main(arguments))
    except BaseException as fault:  # an import that was interrupted ends in ImportError or SystemError as well
        if not _seen.is_set() and not isinstance(fault, KeyboardInterrupt):
            raise
        if ours:
            signal.signal(signal.SIGINT, signal.SIG_IGN)
        print(f"{program}: interrupted", file=sys.stderr, flush=True)
        if arguments is None:  # the command itself: nothing that comes now may be interrupted or change the code
            os._exit(EXIT_INTERRUPTED)
        return EXIT_INTERRUPTED
    finally:
        sys.unraisablehook = hook
        if ours:
            signal.signal(signal.SIGINT, before)


@contextmanager
def early_end(program: str) -> Iterator[None]:
    """While `program` loads its libraries and reads its arguments: nothing is open yet, so the process just ends.

    An exception would not do: C code of libraries that are being loaded swallows it or makes an ImportError of it.
    Only where Ctrl-C is still Python's own.
    """

    def end(_number: int, _frame: FrameType | None) -> None:
        os.write(2, f"{program}: interrupted before it began\n".encode())
        os._exit(EXIT_INTERRUPTED)

    plain = signal.getsignal(signal.SIGINT) is signal.default_int_handler
    if not plain or threading.current_thread() is not threading.main_thread():
        yield
        return
    signal.signal(signal.SIGINT, end)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, signal.default_int_handler)
