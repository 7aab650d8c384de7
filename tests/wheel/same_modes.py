# SPDX-License-Identifier: MIT
"""The same record on two processors: modes, deviations and matrices. usage: same_modes.py HERE THERE (folders)"""

import json
import sys
from pathlib import Path
from typing import Any

import numpy as np

MOST = 1e-6  # relative; deviations are those of other rounding only
MOST_OF_STD = 1e-3

here, there = Path(sys.argv[1]), Path(sys.argv[2])
truth = json.loads((here / "truth.json").read_text())


def load(folder: Path, name: str) -> Any:
    return json.loads((folder / name).read_text())


def compare(what: str, one: dict[str, Any], other: dict[str, Any]) -> None:
    """Fails on the first number that is further apart; prints the largest distance."""
    modes, others = one["modes"], other["modes"]
    assert len(modes) == len(others) >= 3, f"{what}: {len(modes)} modes here, {len(others)} there"
    apart = 0.0
    for key, most in (
        ("frequency_hz", MOST), ("damping_ratio", MOST), ("frequency_std_hz", MOST_OF_STD),
        ("damping_ratio_std", MOST_OF_STD),
    ):  # fmt: skip
        a, b = (np.array([mode.get(key) for mode in each], dtype=float) for each in (modes, others))
        np.testing.assert_allclose(b, a, rtol=most, err_msg=f"{what}: {key}")
        if most == MOST:
            apart = max(apart, float(np.max(np.abs(b / a - 1.0))))
    if one.get("mkr"):
        for key in ("M", "K"):
            a, b = np.array(one["mkr"][key]), np.array(other["mkr"][key])
            np.testing.assert_allclose(b, a, atol=1e-6 * np.abs(a).max(), rtol=0, err_msg=f"{what}: {key}")
    print(f"{what}: {len(modes)} modes, f and damping at most {apart:.1e} apart")


compare("program", load(here, "program.json"), load(there, "program.json"))
package, others = load(here, "package.json"), load(there, "package.json")
assert list(package) == list(others)
for name in package:
    compare(f"package, {name}", package[name], others[name])
for name in ("simulated.json", "replayed.json"):  # a rig of its own: beside the truth
    found = [mode["frequency_hz"] for mode in load(there, name)["modes"] if mode["confident"]]
    assert len(found) == len(truth["frequency_hz"]), f"{name}: {found}"
    np.testing.assert_allclose(found, truth["frequency_hz"], rtol=2e-3, err_msg=name)
