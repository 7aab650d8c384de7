# SPDX-License-Identifier: MIT
"""A worker holds one record and the sums of a group, however many records there are."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
from okid.campaign.cluster import connected
from okid.campaign.run import run_campaign
from okid.campaign.spec import load_spec

SAMPLES, CHANNELS = 65_536, 8
SPEC = """[records]
files = ["r/*.npy"]
[channels]
inputs = ["f1", "f2"]
outputs = ["a1", "a2", "a3", "a4", "a5", "a6"]
fs_hz = 256.0
scale = [1e-3]
[identification]
p = 10
order = 6
stabilization = false
[group]
by = []
"""


def peak_mb() -> float:
    """Most memory this process ever had. (ru_maxrss would be that of the process which started it.)"""
    status = Path("/proc/self/status").read_text(encoding="ascii")
    return int(status.split("VmHWM:")[1].split()[0]) / 1024.0


def test_memory_of_a_worker_is_bounded(tmp_path: Path) -> None:
    """30 MB and 80 MB of records in one group: the same peak within 40 MB, below the 500 MB that end a worker."""
    (tmp_path / "r").mkdir()
    noise = np.random.default_rng(1).integers(-9000, 9000, (SAMPLES, CHANNELS)).astype(np.int16)
    for k in range(80):
        np.save(tmp_path / "r" / f"{k:03d}.npy", np.roll(noise, 500 * k, axis=0))
    (tmp_path / "SPEC.toml").write_text(SPEC)
    spec = load_spec(tmp_path / "SPEC.toml")
    peaks = []
    with connected(1, None, 500.0) as client:
        for files in ("r/0[0-2]*.npy", "r/*.npy"):
            one = replace(spec, records=replace(spec.records, files=(files,)), folder=tmp_path / str(len(peaks)))
            outcome = run_campaign(one, client)
            assert not outcome.skipped and len(outcome.done) == 1
            peaks.append(max(client.run(peak_mb).values()))
    assert peaks[1] < 500.0 and peaks[1] - peaks[0] < 40.0, peaks
