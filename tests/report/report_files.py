# SPDX-License-Identifier: MIT
"""Files of a run as the tests need them."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

FS = 1000.0  # of okid.demo_record()


def write_csv(path: Path, names: list[str], rows: NDArray[np.float64], fs: float) -> Path:
    """A record with quoted names."""
    head = ",".join('"' + name.replace('"', '""') + '"' for name in names)
    body = "\n".join(",".join(f"{x:.7g}" for x in row) for row in rows)
    path.write_text(f"# fs_hz = {fs}\n{head}\n{body}\n", encoding="utf-8")
    return path


def write_events(path: Path, names: list[str], hz: list[float]) -> Path:
    """A run of 60 updates with an alarm, a change and lost samples; "force" and `names` are its channels."""
    rng = np.random.default_rng(3)
    channels = [{"name": n, "role": "aux", "unit": "m/s^2", "dof": k + 1} for k, n in enumerate(names)]
    lines: list[dict[str, Any]] = [
        {
            "type": "start", "t": 0.0, "config": "<b>rig</b>.toml", "wall_time": "2026-01-02T03:04:05.000000Z",
            "channels": [*channels, {"name": "force", "role": "force", "unit": "N", "dof": None}],
            "notes": {"title": "<b>frame</b> & shaker", "operator": "<i>me</i>"},
        }
    ]  # fmt: skip
    for n in range(60):
        drop = 0.98 if n > 40 else 1.0
        modes = [
            {"track": k + 1, "frequency_hz": drop * f + 0.01 * rng.standard_normal(), "damping_ratio": 0.01,
             "frequency_std_hz": 0.01}
            for k, f in enumerate(hz)
        ]  # fmt: skip
        lines.append({"type": "modes", "t": n + 1.0, "modes": modes, "settled": n > 3})
    lines.append({"type": "change", "t": 41.5, "sample": 20750, "restarted": True})
    lines.append({"type": "alarm", "t": 42.0, "mode": 1, "frequency_hz": 0.98 * hz[0], "baseline_hz": hz[0]})
    gap = {"first": 1, "last": 4, "count": 4, "cause": "sequence"}
    lines.append({"type": "gap", "t": 50.0, "channel": names[0], **gap})
    counts = {name: {"expected": 30000, "received": 30000 - 4 * (k == 0)} for k, name in enumerate(names)}
    bus = {"can0": {"received": 60000, "lost": 4, "lost_by": {"sequence": 4}, "load_percent": 12.5}}
    lines.append({"type": "stats", "t": 60.0, "bus": bus, "channel": counts})
    path.write_text("".join(json.dumps(line) + "\n" for line in lines), encoding="utf-8")
    return path
