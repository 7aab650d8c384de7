# SPDX-License-Identifier: MIT
"""The helpers of tests/property and tests/io, and one simulated rig for all tests of the acquisition scripts."""

import sys
from pathlib import Path

import pytest

for folder in ("property", "io"):
    sys.path.insert(0, str(Path(__file__).resolve().parents[1] / folder))


@pytest.fixture(scope="session")
def rig(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with 6 s of two masses at 250 Hz: a.log, a.toml (counters), t.json; replay.json by `okid replay`."""
    from program import okid
    from two_masses import rig_text, simulate_rig

    folder = simulate_rig(tmp_path_factory.mktemp("rig"), rig_text(6.0))
    done = okid("replay", folder / "a.log", "-c", folder / "a.toml", "--json", folder / "replay.json")
    assert done.returncode == 0, done.stderr
    return folder
