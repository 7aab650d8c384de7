# SPDX-License-Identifier: MIT
"""docs/howto/compare-two-tests.md names every key of okid.comparison/1, and nothing else."""

from __future__ import annotations

import re

import okid
from command_help import ROOT
from reference_tables import documented, keys_of

PAGE = ROOT / "docs" / "howto" / "compare-two-tests.md"
SOURCE = ROOT / "firmware_host" / "compare" / "comparison.cpp"


def test_keys_and_codes_both_ways() -> None:
    mode = {"damping_ratio": 0.01, "frequency_std_hz": 0.1, "damping_ratio_std": None, "confident": True,
            "shape_re": [1.0, 0.5], "shape_im": [0.0, 0.0]}  # fmt: skip
    before, after = (
        {"schema": "okid.result/1", "fs_hz": 100.0, "method": method, "outputs": ["a", "b"],
         "modes": [mode | {"frequency_hz": f} for f in (10.0, far)]}
        for method, far in (("auto", 50.0), ("okid-era", 90.0))
    )  # fmt: skip
    found = okid.compare(before, after).to_dict()
    assert found["pairs"] and found["only_a"] and found["only_b"] and found["warnings"]
    described = documented(PAGE.read_text())
    assert set(keys_of(found)) == set(described)
    codes = set(re.findall(r'remarks\.emplace_back\(\s*"(\w+)"', SOURCE.read_text()))
    assert len(codes) >= 3 and codes == set(re.findall(r"`(\w+)`", described["warnings[].code"]))
