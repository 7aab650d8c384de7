# SPDX-License-Identifier: MIT
"""One simulated rig for all tests of the acquisition scripts."""

from pathlib import Path

import pytest
from program import okid
from two_masses import rig_text, simulate_rig


@pytest.fixture(scope="session")
def rig(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with 6 s of two masses at 250 Hz: a.log, a.toml (counters), t.json; replay.json by `okid replay`."""
    folder = simulate_rig(tmp_path_factory.mktemp("rig"), rig_text(6.0))
    done = okid("replay", folder / "a.log", "-c", folder / "a.toml", "--json", folder / "replay.json")
    assert done.returncode == 0, done.stderr
    return folder
