# SPDX-License-Identifier: MIT
"""The virtual rig most tests of the program use: two masses, a force at the first, accelerations of both, 1 % noise."""

from __future__ import annotations

from pathlib import Path

from methods import by_method
from program import okid

RIG = """
rate_hz = {rate_hz}
duration_s = {duration_s}
seed = {seed}
masses = [1.0, 0.8]
springs = {springs}
zeta = [0.02, 0.02]
force_dofs = [1]
sense_dofs = [1, 2]
sensing = "acceleration"
excitation = "white"
noise_percent = 1.0
bits = 16
"""


def rig_text(duration_s: float, rate_hz: float = 250.0, seed: int = 3, springs: str = "[3e4, 2e4]") -> str:
    """RIG.toml for `okid simulate`."""
    return RIG.format(duration_s=duration_s, rate_hz=rate_hz, seed=seed, springs=springs)


def simulate_rig(folder: Path, text: str, lags: int = 12) -> Path:
    """The rig as a.log, a.csv, a.dbc and a.toml with so many lags, and its truth t.json. @return the folder"""
    (folder / "rig.toml").write_text(text)
    names = {"--log": "a.log", "--truth": "t.json", "--csv": "a.csv", "--dbc": "a.dbc", "--config": "a.toml"}
    options = [part for option, name in names.items() for part in (option, folder / name)]
    done = okid("simulate", folder / "rig.toml", *options)
    assert done.returncode == 0, done.stderr
    config = by_method((folder / "a.toml").read_text(), p=lags, rows=2 * lags)
    (folder / "a.toml").write_text(config.replace("update_s", 'order = "auto"\nupdate_s'))
    return folder
