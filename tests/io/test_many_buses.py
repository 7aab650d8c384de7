# SPDX-License-Identifier: MIT
"""Thirty-two buses of one computer: every frame in its place, two of them late and one with a frame lost."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import okid
from program import okid as program

BUSES, SAMPLES, RATE = 32, 400, 100.0


def test_thirty_two_buses(tmp_path: Path) -> None:
    config = [f"[acquisition]\nrate_hz = {RATE}"]
    for k in range(BUSES):
        config.append(f'[[bus]]\nname = "b{k}"\ninterface = "can{k}"')
        config.append(
            f'[[channel]]\nname = "c{k}"\nrole = "{"force" if k == 0 else "acceleration"}"\nbus = "b{k}"\n'
            "can_id = 0x10\nstart_bit = 0\nlength = 16\nsequence = { start_bit = 16, length = 8 }"
        )
    (tmp_path / "many.toml").write_text("\n".join(config) + "\n")
    frames = []
    for n in range(SAMPLES):
        for k in range(BUSES):
            if (k, n) == (7, 200):
                continue
            late = 0.25 if k in (3, 19) and 100 <= n < 125 else 0.0
            code = (n * BUSES + k) % 0x8000
            frames.append((1000.0 + n / RATE + 1e-5 * k + late, k, f"{code & 255:02X}{code >> 8:02X}{n % 256:02X}"))
    frames.sort()
    (tmp_path / "many.log").write_text("".join(f"({t:.6f}) can{k} 010#{data}\n" for t, k, data in frames))
    done = program("convert", tmp_path / "many.log", tmp_path / "many.csv", "-c", tmp_path / "many.toml")
    assert done.returncode == 0, done.stderr
    got = np.asarray(okid.read_csv(tmp_path / "many.csv").samples)
    wanted = ((np.arange(SAMPLES)[:, None] * BUSES + np.arange(BUSES)) % 0x8000).astype(float)
    wanted[200, 7] = np.nan
    np.testing.assert_array_equal(got, wanted)
