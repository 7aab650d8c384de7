# SPDX-License-Identifier: MIT
"""Measured records: $OKID_DATA, else ../shared/data beside the repository; OKID_DATA=none says that there are none."""

from __future__ import annotations

import os
from pathlib import Path

import pytest
from program import ROOT


def data_file(*parts: str) -> Path:
    """Absent: skipped by hand, a failure in CI, unless OKID_DATA=none said so: then skipped and counted as that."""
    if os.environ.get("OKID_DATA") == "none":
        pytest.skip("OKID_DATA=none: without measured records")
    path = Path(os.environ.get("OKID_DATA") or ROOT.parent / "shared" / "data").joinpath(*parts)
    if not path.is_file():
        message = f"reference data not found: {path}; set OKID_DATA to the folder that holds it"
        if os.environ.get("CI") == "true":
            pytest.fail(message)
        pytest.skip(message)
    return path
