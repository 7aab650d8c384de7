# SPDX-License-Identifier: MIT
"""A stream without end through `okid replay`: memory stays what it was after the first minute, and the sliding window
holds what a batch over its samples gives. 6 simulated minutes; OKID_SLOW=1: 72 hours."""

from __future__ import annotations

import json
import os
import subprocess
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from program import PROGRAM, okid
from systems import w2

RATE, PERIOD_S = 1024, 64  # 65,536 samples: counter, fraction of the second and signals begin anew together
WINDOW_S, SLOT, P = 125, 6400, 20  # 20 closed slots and the open one, which is full at the end of the stream
SAMPLES = RATE * PERIOD_S
SLOW = os.environ.get("OKID_SLOW") == "1"
SIMULATED_S = 72 * 3600 if SLOW else 375  # whole slots
NAMES = ["f1", "f2", "a1", "a2", "a3", "a4", "a5", "a6"]
BEGIN_S = 1_700_000_000


def periodic_record() -> NDArray[np.float64]:
    """W2 in the steady state of a force that repeats, 1 % noise that repeats, scaled to +-20000; (SAMPLES, 8)."""
    rng = np.random.default_rng(5)
    A, B, C, D = w2().discrete()
    z = np.exp(2j * np.pi * np.arange(SAMPLES // 2 + 1) / SAMPLES)
    u = rng.standard_normal((SAMPLES, B.shape[1]))
    response = C @ np.linalg.solve(z[:, None, None] * np.eye(len(A)) - A, B.astype(complex)) + D
    y = np.fft.irfft(np.einsum("fyu,fu->fy", response, np.fft.rfft(u, axis=0)), SAMPLES, axis=0)
    y += 0.01 * y.std(axis=0) * rng.standard_normal(y.shape)
    data = np.hstack([u, y])
    return np.asarray(20000 * data / np.abs(data).max(axis=0))


@dataclass(frozen=True)
class Kind:
    """How a number stands in the frame."""

    dtype: str
    bits: int
    toml: str


CODES = Kind("<i2", 16, "signed = true")
FLOATS = Kind("<f4", 32, 'value = "float32"')


def config(folder: Path, kind: Kind, memory: str) -> Path:
    text = f'[acquisition]\nrate_hz = {RATE}\n[[bus]]\nname = "can0"\ninterface = "can0"\nfd = true\n'
    for i, name in enumerate(NAMES):
        role = {"f": "force", "a": "acceleration"}[name[0]]
        text += f'[[channel]]\nname = "{name}"\nrole = "{role}"\ncan_id = 256\nstart_bit = {16 + kind.bits * i}\n'
        text += f"length = {kind.bits}\n{kind.toml}\nsequence = {{ start_bit = 0, length = 16 }}\n"
    text += f'[identification]\np = {P}\ndetrend = "none"\nsigma_blocks = 8\n'
    text += f"update_s = 10.0\n{memory}\n"
    path = folder / "a.toml"
    path.write_text(text)
    return path


def seconds_of(values: NDArray[np.generic]) -> list[list[str]]:
    """For each second of the period the lines of a log without the whole seconds of their stamps."""
    tails = []
    for n, row in enumerate(values):
        data = n.to_bytes(2, "little") + row.tobytes()
        data = data.ljust(20 if len(data) <= 20 else 48, b"\0")
        tails.append(f".{n % RATE * 1_000_000 // RATE:06d}) can0 100##1{data.hex().upper()}\n")
    return [tails[k * RATE : (k + 1) * RATE] for k in range(PERIOD_S)]


def resident_kib(pid: int) -> int:
    return int(Path(f"/proc/{pid}/statm").read_text().split()[1]) * os.sysconf("SC_PAGESIZE") // 1024


def play(folder: Path, path: Path, seconds: list[list[str]]) -> tuple[dict, list[int]]:
    """@return the result, and resident memory once a simulated minute."""
    command = [PROGRAM, "replay", "/dev/stdin", "-c", str(path), "--speed", "max", "--json", str(folder / "r.json")]
    command += ["--events", str(folder / "e.jsonl")]
    memory = []
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE) as run:
        assert run.stdin is not None and run.stderr is not None
        for second in range(SIMULATED_S):
            stamp = f"({BEGIN_S + second}"
            run.stdin.write((stamp + stamp.join(seconds[second % PERIOD_S])).encode())
            if second % 60 == 59:
                memory.append(resident_kib(run.pid))
        run.stdin.close()
        assert run.wait(1800) == 0, run.stderr.read().decode()
    return json.loads((folder / "r.json").read_text()), memory


WINDOW = f"window_s = {WINDOW_S}"
CASES = [(CODES, WINDOW), (FLOATS, WINDOW), (CODES, ""), (FLOATS, "forgetting = 0.99999")]


@pytest.mark.parametrize(("kind", "memory"), CASES)
def test_weeks(tmp_path: Path, kind: Kind, memory: str) -> None:
    values = periodic_record().astype(kind.dtype)
    result, resident = play(tmp_path, config(tmp_path, kind, memory), seconds_of(values))
    print(f"{kind.dtype} {memory}: {SIMULATED_S} s, {resident[0]} KiB after a minute, {resident[-1]} KiB at last")
    assert max(resident[1:]) - resident[0] <= 1024, resident
    told = [json.loads(line) for line in (tmp_path / "e.jsonl").read_text().splitlines()]
    stats = [event for event in told if event["type"] == "stats"][-1]
    assert stats["bus"]["can0"]["received"] == SIMULATED_S * RATE and stats["bus"]["can0"]["lost"] == 0
    assert {event["type"] for event in told} <= {"start", "modes", "stats", "result"}  # no change, no alarm, no gap
    if "window" not in memory:
        return
    count = WINDOW_S * RATE + SLOT
    last = np.arange(SIMULATED_S * RATE - count, SIMULATED_S * RATE) % SAMPLES
    rows = "\n".join(",".join(repr(float(x)) for x in row) for row in values[last])
    (tmp_path / "w.csv").write_text(f"# fs_hz: {RATE}\n{','.join(NAMES)}\n{rows}\n")
    options = ["--inputs", "f1,f2", "--outputs", ",".join(NAMES[2:]), "--detrend", "none", "--p", P]
    done = okid("identify", tmp_path / "w.csv", *options, "--json", tmp_path / "b.json")
    assert done.returncode == 0, done.stderr
    batch = json.loads((tmp_path / "b.json").read_text())
    assert batch["samples"] == count == result["samples"] + SLOT
    assert len(result["modes"]) == len(batch["modes"]) >= 6
    for live, whole in zip(result["modes"], batch["modes"], strict=True):
        assert live["frequency_hz"] == pytest.approx(whole["frequency_hz"], rel=1e-6)
        assert live["damping_ratio"] == pytest.approx(whole["damping_ratio"], rel=1e-6)
