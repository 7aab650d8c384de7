# SPDX-License-Identifier: MIT
"""A socket that speaks as `[publish] socket` does: what okid cannot be made to say (damage, silence, odd names)."""

from __future__ import annotations

import contextlib
import json
import socket
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

# A config that is whole but for what a test adds.
WHOLE = """[acquisition]
rate_hz = 1000.0
[[bus]]
name = "can0"
interface = "can0"
[[channel]]
name = "f"
role = "force"
can_id = 1
start_bit = 0
length = 16
[[channel]]
name = "a"
role = "acceleration"
can_id = 1
start_bit = 16
length = 16
"""


def channel(name: str, role: str, unit: str = "", dof: int | None = None) -> dict[str, Any]:
    return {"name": name, "role": role, "unit": unit, "dof": dof}


def start(channels: list[dict[str, Any]], rate_hz: float = 1000.0, number: int = 0) -> dict[str, Any]:
    when = f"2026-11-21T12:00:{number:02d}.000000Z"
    return {"type": "start", "t": 0.0, "config": "a.toml", "wall_time": when, "rate_hz": rate_hz, "channels": channels}


def samples(first: int, values: NDArray[np.float64], rate_hz: float = 1000.0) -> dict[str, Any]:
    """values (m, count), NaN = missing."""
    rows = [[None if np.isnan(x) else round(float(x), 5) for x in row] for row in values]
    count = values.shape[1]
    return {"type": "samples", "t": (first + count) / rate_hz, "first": first, "count": count, "values": rows}


def mode(track: int, f: float, alarm: bool = False, n_y: int = 2) -> dict[str, Any]:
    return {"frequency_hz": f, "damping_ratio": 0.01, "shape_re": [1.0] * n_y, "shape_im": [0.0] * n_y,
            "frequency_std_hz": 0.001, "damping_ratio_std": 0.0001, "mpc": 0.999, "emac": 0.99, "track": track,
            "alarm": alarm}  # fmt: skip


def modes(t: float, frequencies: list[float], settled: bool = True) -> dict[str, Any]:
    listed = [mode(k, f) for k, f in enumerate(frequencies, 1)]
    return {"type": "modes", "t": t, "modes": listed, "window_s": 5.0, "samples": 5000, "settled": settled}


class OkidFeed:
    """One subscriber at a time."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self._listener = socket.socket(socket.AF_UNIX)
        self._listener.bind(str(path))
        self._listener.listen(1)
        self._listener.settimeout(1800)
        self._wire: socket.socket | None = None

    def accept(self) -> None:
        """Wait for the page's server."""
        self._wire, _ = self._listener.accept()

    def raw(self, data: bytes) -> None:
        assert self._wire is not None
        self._wire.sendall(data)

    def send(self, *events: dict[str, Any]) -> None:
        self.raw(b"".join(json.dumps(event, separators=(",", ":")).encode() + b"\n" for event in events))

    def hang_up(self) -> None:
        if self._wire is not None:
            self._wire.close()
            self._wire = None

    def close(self) -> None:
        self.hang_up()
        self._listener.close()
        with contextlib.suppress(OSError):
            self.path.unlink()
