# SPDX-License-Identifier: MIT
"""W2 as codes of a converter, and how long it takes live from the frame that completes an update to its modes."""

from __future__ import annotations

import contextlib
import json
import socket
import threading
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from waiting import until

UPDATE_S = 0.5


class Watch:
    """Reads `[publish] socket` and notes when each `modes` event came, and each block of the signals."""

    def __init__(self, path: Path) -> None:
        self.came: list[tuple[float, float]] = []  # (t of the update, seconds since 1970 when its line was here)
        self.blocks: list[float] = []
        self._socket = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
        self._socket.connect(str(path))
        self._thread = threading.Thread(target=self._read, daemon=True)
        self._thread.start()

    def _read(self) -> None:
        rest = b""
        while data := self._socket.recv(1 << 16):
            now = time.time()
            *lines, rest = (rest + data).split(b"\n")
            for line in lines:
                event = json.loads(line)
                if event["type"] == "modes":
                    self.came.append((event["t"], now))
                elif event["type"] == "samples":
                    self.blocks.append(now)

    def end(self) -> list[tuple[float, float]]:
        """After the run has ended."""
        self._thread.join()
        self._socket.close()
        return self.came


@contextlib.contextmanager
def watching(path: Path) -> Iterator[Watch]:
    """Connects as soon as there is a socket."""
    until(path.exists)
    one = Watch(path)
    yield one
    one.end()


def latencies_ms(came: list[tuple[float, float]], stamps_s: NDArray[np.float64], rate_hz: float) -> NDArray[np.float64]:
    """From the time stamp of the frame that completed the last sample of an update to the arrival of its modes.

    @param stamps_s  of each sample, the latest of its frames
    """
    rows = [(now, stamps_s[round(t * rate_hz) - 1]) for t, now in came if round(t * rate_hz) <= len(stamps_s)]
    return np.array([1e3 * (now - stamp) for now, stamp in rows])


def summary(values_ms: NDArray[np.float64]) -> str:
    """Median, p99, maximum and a histogram with a bar for every factor of two."""
    median, p99 = np.percentile(values_ms, [50, 99])
    out = f"{len(values_ms)} updates: median {median:.1f} ms, p99 {p99:.1f} ms, max {values_ms.max():.1f} ms\n"
    first, last = int(np.floor(np.log2(values_ms.min()))), int(np.floor(np.log2(values_ms.max())))
    for power in range(first, last + 1):
        count = int(np.sum(np.floor(np.log2(values_ms)) == power))
        bar = "#" * round(50 * count / len(values_ms))
        out += f"  {2.0**power:8.4g} to {2.0 ** (power + 1):8.4g} ms {count:6d} {bar}\n"
    return out.rstrip()
