# SPDX-License-Identifier: MIT
"""A sensor has a clock and a processor of its own, which a busy computer does not take from it.

Frames without a counter have their places by the instants at which they came. A test that plays the sensor on the
computer it makes busy would judge its own lateness: a sensor that sends at half its rate is taken for one that loses
half of its samples, and rightly so.
"""

from __future__ import annotations

import contextlib
import ctypes
import os
from collections.abc import Iterator

from waiting import VIRTUAL


@contextlib.contextmanager
def sensor() -> Iterator[None]:
    """This thread goes before all others, where that is permitted; what it starts does not."""
    before = os.sched_getscheduler(0)
    with contextlib.suppress(PermissionError):
        os.sched_setscheduler(0, os.SCHED_FIFO | os.SCHED_RESET_ON_FORK, os.sched_param(10))
    try:
        yield
    finally:
        os.sched_setscheduler(0, before, os.sched_param(0))


@contextlib.contextmanager
def in_memory() -> Iterator[None]:
    """Nothing of this process is thrown out of memory, where that is permitted. Not with the virtual clock: nobody is
    late there, and all that a long session of tests has mapped would fill the kernel's memory."""
    if VIRTUAL:
        yield
        return
    own = ctypes.CDLL(None)
    own.mlockall(3)  # MCL_CURRENT | MCL_FUTURE
    try:
        yield
    finally:
        own.munlockall()
