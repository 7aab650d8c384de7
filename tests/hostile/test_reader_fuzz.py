# SPDX-License-Identifier: MIT
"""The first inputs of tests/fuzz/python_readers.py, whose smoke run makes more of them: some are taken, some refused,
and nothing else happens."""

from __future__ import annotations

import os
import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "fuzz"))
from python_readers import READERS, attempt

RUNS = 2000 if os.environ.get("OKID_SLOW") == "1" else 80


@pytest.mark.parametrize("name", list(READERS))
def test_odd_inputs_are_taken_or_refused(name: str, tmp_path: Path) -> None:
    taken = sum(attempt(name, number, tmp_path) for number in range(RUNS))
    assert 0 < taken < RUNS
