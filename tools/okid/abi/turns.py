# SPDX-License-Identifier: MIT
"""Threads and the library: one call at a time into an object, and none cut off by the end of the interpreter.

ctypes gives the GIL back during a call, so two threads of Python can be in the library at once. An object that the
library reads and writes has a Turn: a second thread waits for the first one, close() too. While Python ends, calls that
other (daemon) threads are in are waited for: their memory must not be taken from under them.
"""

from __future__ import annotations

import atexit
import functools
import os
import threading
import time
from collections.abc import Callable
from contextlib import ExitStack
from typing import Any, Concatenate, ParamSpec, TypeVar

_P = ParamSpec("_P")
_R = TypeVar("_R")
_inside: list[int] = []  # threads that are in a call, once each time
_ending = False


def _leave() -> None:
    _inside.remove(threading.get_ident())


def _enter() -> None:
    _inside.append(threading.get_ident())
    if _ending and threading.current_thread() is not threading.main_thread():
        _leave()
        raise SystemExit  # of this thread: Python ends


def _wait() -> None:
    """Of the main thread at its end, before modules and the library are taken down."""
    global _ending
    _ending = True
    try:
        while _inside:
            time.sleep(0.005)
    except KeyboardInterrupt:
        os._exit(130)  # what still runs must not see the library being taken down


atexit.register(_wait)
os.register_at_fork(after_in_child=_inside.clear)


class Inside:
    """`with Inside():` a call that no object is locked for, such as one that makes an object."""

    __slots__ = ()

    def __enter__(self) -> None:
        _enter()

    def __exit__(self, *_: object) -> None:
        _leave()


class Turn:
    """`with self._turn:` calls on an object, by one thread at a time (which may take it again)."""

    __slots__ = ("_lock",)

    def __init__(self) -> None:
        self._lock = threading.RLock()

    def __enter__(self) -> None:
        self._lock.acquire()
        try:
            _enter()
        except BaseException:
            self._lock.release()
            raise

    def __exit__(self, *_: object) -> None:
        _leave()
        self._lock.release()


def both(first: Turn, second: Turn) -> ExitStack:
    """The turns of two objects, always in the same order, so that two threads do not wait for each other."""
    stack = ExitStack()
    for turn in sorted({first, second}, key=id):
        stack.enter_context(turn)
    return stack


def in_turn(method: Callable[Concatenate[Any, _P], _R]) -> Callable[Concatenate[Any, _P], _R]:
    """A method that takes `self._turn` as long as it runs."""

    @functools.wraps(method)
    def taken(self: Any, /, *arguments: _P.args, **named: _P.kwargs) -> _R:
        with self._turn:
            return method(self, *arguments, **named)

    return taken
