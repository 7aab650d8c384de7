# SPDX-License-Identifier: MIT
"""Memory is told before it is taken: what a config asks for is computed, then refused or fitted to max_memory_mb."""

from __future__ import annotations

import json
import os
import pathlib
import re

import numpy as np
import pytest
from measured_run import measured

RATE = 200.0
FREQUENCIES, DAMPING = (11.0, 31.0), 0.02
SIGNALS = 4  # of 16 bits in a frame


def many_channels(count: int, identification: str = "") -> str:
    """One force and count - 1 accelerations."""
    out = [f'[acquisition]\nrate_hz = {RATE}\n[[bus]]\nname = "can0"\ninterface = "vcan0"\n']
    for k in range(count):
        role = 'role = "force"\nunit = "N"' if k == 0 else 'role = "acceleration"\nunit = "m/s^2"'
        out.append(
            f'[[channel]]\nname = "c{k}"\n{role}\ncan_id = {0x100 + k // SIGNALS}\n'
            f"start_bit = {16 * (k % SIGNALS)}\nlength = 16\nsigned = true\nscale = 0.001\n"
        )
    return "".join(out) + "[identification]\n" + identification


def write_log(path: pathlib.Path, channels: int, samples: int) -> None:
    """Two modes with random shapes under a white force, as candump -L writes it."""
    draw = np.random.default_rng(1)
    force = draw.standard_normal(samples)
    y = np.zeros((samples, channels - 1))
    for frequency in FREQUENCIES:
        mu = np.exp(2 * np.pi * frequency / RATE * (-DAMPING + 1j * np.sqrt(1 - DAMPING**2)))
        state, response = 0j, np.zeros(samples)
        for n in range(samples):
            response[n] = state.imag
            state = mu * state + force[n]
        y += np.outer(response, draw.standard_normal(channels - 1))
    y += 0.02 * draw.standard_normal(y.shape)
    codes = np.rint(1000 * np.column_stack([force, y])).clip(-32000, 32000).astype("<i2")
    with path.open("w") as log:
        for n in range(samples):
            stamp = f"({1764000000 + n / RATE:.6f}) vcan0 "
            for first in range(0, channels, SIGNALS):
                data = codes[n, first : first + SIGNALS].tobytes().hex().upper()
                log.write(f"{stamp}{0x100 + first // SIGNALS:03X}#{data}\n")


@pytest.mark.parametrize("command", ["check", "run"])
def test_a_config_that_asks_for_too_much_is_refused_at_once(tmp_path: pathlib.Path, command: str) -> None:
    """24 GB in release 0.1, and killed."""
    (tmp_path / "many.toml").write_text(many_channels(256, "p = 40\n"))
    done = measured(command, tmp_path / "many.toml", within_s=20)
    assert done.returncode == 2 and done.stdout == "", done
    assert done.peak_mb < 200
    said = re.fullmatch(
        r"okid: .*many\.toml: \[identification\]: p = 40, 80 block rows and 256 channels need (\d+) MB of memory, "
        r"max_memory_mb = 8192; expected p up to (\d+) \(with (\d+) block rows\), or up to (\d+) channels, "
        r"or sigma_blocks = 0 with p up to (\d+), or a larger max_memory_mb\n",
        done.stderr,
    )
    assert said, done.stderr
    need, p, rows, channels, without = map(int, said.groups())
    assert need > 20000 and 10 <= p < without and rows == 2 * p and 60 < channels < 256
    for wanted, count in ((f"p = {p}\n", 256), ("p = 40\n", channels), (f"p = {without}\nsigma_blocks = 0\n", 256)):
        (tmp_path / "fits.toml").write_text(many_channels(count, wanted))
        done = measured("check", tmp_path / "fits.toml", within_s=20)
        assert (done.returncode, done.stderr) == (0, "") and done.peak_mb < 200
    for wanted, count in ((f"p = {p + 1}\n", 256), ("p = 41\n", channels)):
        (tmp_path / "more.toml").write_text(many_channels(count, wanted))
        assert measured("check", tmp_path / "more.toml", within_s=20).returncode == 2


def test_65536_channels_are_checked_in_a_moment(tmp_path: pathlib.Path) -> None:
    """Release 0.1 compared every channel with every other: four times as many took sixteen times as long, 20 s here."""
    spent = []
    for count in (8192, 65536):
        channels = "".join(
            f'[[channel]]\nname = "c{k}"\nrole = "{"acceleration" if k < 8 else "aux"}"\ncan_id = {0x1000 + k // 4}\n'
            f"start_bit = {16 * (k % 4)}\nlength = 16\n"
            for k in range(count)
        )
        text = many_channels(0, "p = 10\n").replace("[identification]", channels + "[identification]")
        (tmp_path / "many.toml").write_text(text)
        before = os.times()
        assert measured("check", tmp_path / "many.toml", within_s=60).returncode == 0
        after = os.times()
        spent.append(after.children_user + after.children_system - before.children_user - before.children_system)
    assert spent[1] < 20 * spent[0]  # eight times as many


def test_256_channels_are_usable(tmp_path: pathlib.Path) -> None:
    """Without p the horizon is chosen that fits, and said; the modes are right and the memory is kept."""
    limit = 2000
    settings = f'method = "okid-era"\nmax_memory_mb = {limit}\nupdate_s = 100.0\n'
    (tmp_path / "many.toml").write_text(many_channels(256, settings))
    write_log(tmp_path / "many.log", 256, 4000)
    done = measured(
        "replay", tmp_path / "many.log", "-c", tmp_path / "many.toml", "--json", tmp_path / "r.json", within_s=300
    )
    assert done.returncode == 0, done.stderr
    result = json.loads((tmp_path / "r.json").read_text())
    assert len(result["outputs"]) == 255 and result["p"] < 40
    said = {each["code"]: each["text"] for each in result["warnings"]}
    assert f"p = {result['p']} is taken, not 40" in said["p_reduced"] and said["p_reduced"] in done.stderr
    found = [mode["frequency_hz"] for mode in result["modes"] if mode["emac"] > 0.9 and mode["mpc"] > 0.9]
    np.testing.assert_allclose(found, FREQUENCIES, rtol=2e-3)
    assert done.peak_mb < limit + 200  # beside the identification: program, log, grid
