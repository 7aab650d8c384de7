# SPDX-License-Identifier: MIT
"""The example that reads a serial line, in the test kernel (tests/kernel/virtual): it is open after it says so."""

from __future__ import annotations

import os
import pty
import termios
import threading
import time
from pathlib import Path

import numpy as np
from test_examples import judge, rig, run, script  # noqa: F401  (rig is a fixture)
from waiting import until


def test_live_from_serial_line(rig: Path) -> None:  # noqa: F811
    master, slave = pty.openpty()
    samples = np.fromfile(rig / "doubles").reshape(-1, 4)

    def node() -> None:
        until(lambda: not termios.tcgetattr(slave)[3] & termios.ICANON)  # it opens it: what stands there is thrown away
        time.sleep(0.2)
        lines = b"".join(b"%.6f,%.6f,%.6f,%.6f\n" % tuple(row) for row in samples)
        for start in range(0, len(lines), 1024):
            os.write(master, lines[start : start + 1024])

    sender = threading.Thread(target=node, daemon=True)
    sender.start()
    shown = run([*script("live_from_serial_line.py"), os.ttyname(slave), "921600", "250", str(len(samples))], rig)
    judge(shown, rig)
    sender.join()
    os.close(master), os.close(slave)
