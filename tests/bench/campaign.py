# SPDX-License-Identifier: MIT
"""A campaign on one and on two workers of the embedded cluster: records a second, memory of a worker, the same sums.

usage: campaign.py [RECORDS [TURNS [BENCH.json to add to]]]   (1000 records of 65,536 x 8 int16, 5 turns)

Records are made first and not timed; neither is the start of the workers. One turn is a run on one worker and a run on
two, each into a folder of its own. Judged are the medians; least values and the load of the machine stand beside them.
"""

from __future__ import annotations

import os
import statistics
import sys
import tempfile
import time
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from bench_file import keep
from okid.campaign.cluster import connected
from okid.campaign.run import run_campaign
from okid.campaign.spec import CampaignSpec, load_spec
from scipy.signal import lfilter

SAMPLES, CHANNELS, GROUPS, DISTINCT = 65_536, 8, 10, 16
SPEC = """[records]
files = ["records/*.npy"]
name = 'g(?P<structure>\\d+)_'
[channels]
inputs = ["f1", "f2"]
outputs = ["a1", "a2", "a3", "a4", "a5", "a6"]
fs_hz = 256.0
scale = [1e-3]
[identification]
p = 40
[group]
by = ["structure"]
"""


def codes(seed: int) -> Any:
    """Two forces, six answers of three resonances, noise: int16."""
    rng = np.random.default_rng(seed)
    force = rng.standard_normal((SAMPLES, 2))
    answer = np.zeros((SAMPLES, 6))
    for k, f in enumerate((11.0, 32.0, 60.0)):
        w = 2.0 * np.pi * f / 256.0
        tail = [1.0, -2.0 * 0.995 * np.cos(w), 0.995**2]
        both = lfilter([1.0], tail, force @ rng.standard_normal(2))
        answer += both[:, None] * rng.standard_normal(6) * (1.0, 0.5, 0.3)[k]
    answer += 0.01 * np.std(answer, axis=0) * rng.standard_normal(answer.shape)
    both = np.hstack([force, answer])
    return np.rint(6000.0 * both / np.std(both, axis=0)).clip(-32767, 32767).astype(np.int16)


def make_records(folder: Path, count: int) -> None:
    """Rolled copies of DISTINCT records: other bytes each, the same work."""
    (folder / "records").mkdir()
    base = [codes(seed) for seed in range(DISTINCT)]
    for k in range(count):
        one = np.roll(base[k % DISTINCT], 61 * k, axis=0)
        np.save(folder / "records" / f"g{k * GROUPS // count:02d}_{k:05d}.npy", one)
    (folder / "SPEC.toml").write_text(SPEC)


def peak_mb() -> float:
    """Most memory this process ever had. (ru_maxrss would be that of the process which started it.)"""
    status = Path("/proc/self/status").read_text(encoding="ascii")
    return int(status.split("VmHWM:")[1].split()[0]) / 1024.0


def timed(spec: CampaignSpec, client: Any) -> tuple[float, dict[str, str]]:
    """Seconds of one run into a new folder, checksums of its sums."""
    with tempfile.TemporaryDirectory(dir=spec.base) as folder:
        begin = time.perf_counter()
        outcome = run_campaign(replace(spec, folder=Path(folder)), client)
        seconds = time.perf_counter() - begin
    if outcome.skipped or outcome.faults:
        raise SystemExit(f"campaign: {outcome.skipped or outcome.faults}")
    return seconds, {ident: str((sums.result or {})["sums_sha256"]) for ident, sums in outcome.done.items()}


def main() -> None:
    count = int(sys.argv[1]) if len(sys.argv) > 1 else 1000
    turns = int(sys.argv[2]) if len(sys.argv) > 2 else 5
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        make_records(folder, count)
        spec = load_spec(folder / "SPEC.toml")
        times: dict[int, list[float]] = {1: [], 2: []}
        sums: list[dict[str, str]] = []
        memory = 0.0
        for _ in range(turns):
            for workers in (1, 2):
                with connected(workers, None, 500.0) as client:  # a worker that takes more is ended
                    client.wait_for_workers(workers)
                    seconds, own = timed(spec, client)
                    memory = max(memory, *client.run(peak_mb).values())
                times[workers].append(seconds)
                sums.append(own)
    if any(one != sums[0] for one in sums):
        raise SystemExit("campaign: sums differ from run to run")
    print(
        f"{count} records, {SAMPLES} samples x {CHANNELS} channels of int16, {GROUPS} groups, p = 40; "
        f"load {os.getloadavg()[0]:.1f}"
    )
    for workers, own in times.items():
        middle, least = statistics.median(own), min(own)
        per = 1e9 * least / (count * SAMPLES)
        print(
            f"{workers} worker(s): median {middle:.1f} s, least {least:.1f} s, {count / middle:.1f} records/s, "
            f"{per:.0f} ns a sample"
        )
    print(f"two over one: {statistics.median(times[1]) / statistics.median(times[2]):.2f} (medians), "
          f"{min(times[1]) / min(times[2]):.2f} (least)")  # fmt: skip
    two = statistics.median(times[1]) / statistics.median(times[2])
    keep({"campaign_two_workers": two, "campaign_worker_mb": memory}, argument=3)
    print(f"largest worker {memory:.0f} MB, this process {peak_mb():.0f} MB; the same sums in all {len(sums)} runs")


if __name__ == "__main__":
    main()
