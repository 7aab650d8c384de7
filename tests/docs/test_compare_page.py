# SPDX-License-Identifier: MIT
"""docs/howto/compare-two-tests.md: its Python runs. docs/reference/check-and-bench.md has each key of a comparison."""

from __future__ import annotations

import json
import pathlib
import re
from typing import Any

import okid
import pytest
from command_help import ROOT
from reference_tables import REFERENCE, documented, keys_of, sections

PAGE = ROOT / "docs" / "howto" / "compare-two-tests.md"
KEYS = sections(REFERENCE / "check-and-bench.md")["okid compare --json"]
SOURCE = ROOT / "firmware_host" / "compare" / "comparison.cpp"


def results() -> list[dict[str, Any]]:
    """Two results of different methods with one mode in common."""
    mode = {"damping_ratio": 0.01, "frequency_std_hz": 0.1, "damping_ratio_std": None, "confident": True,
            "shape_re": [1.0, 0.5], "shape_im": [0.0, 0.0]}  # fmt: skip
    return [
        {"schema": "okid.result/1", "fs_hz": 100.0, "method": method, "outputs": ["a", "b"],
         "modes": [mode | {"frequency_hz": f} for f in (10.0, far)]}
        for method, far in (("auto", 50.0), ("okid-era", 90.0))
    ]  # fmt: skip


def test_its_python_runs(
    tmp_path: pathlib.Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    for name, result in zip(("before.json", "after.json"), results(), strict=True):
        (tmp_path / name).write_text(json.dumps(result))
    monkeypatch.chdir(tmp_path)
    (block,) = re.findall(r"```python\n(.*?)```", PAGE.read_text(), re.DOTALL)
    exec(compile(block, str(PAGE), "exec"), {})
    assert capsys.readouterr().out == "False ['+0.00 %']\n"


def test_keys_and_codes_both_ways() -> None:
    before, after = results()
    found = okid.compare(before, after).to_dict()
    assert found["pairs"] and found["only_a"] and found["only_b"] and found["warnings"]
    described = documented(KEYS)
    assert set(keys_of(found)) == set(described)
    codes = set(re.findall(r'remarks\.emplace_back\(\s*"(\w+)"', SOURCE.read_text()))
    assert len(codes) >= 3 and codes == set(re.findall(r"`(\w+)`", described["warnings[].code"]))
