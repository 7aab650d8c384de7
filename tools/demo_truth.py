# SPDX-License-Identifier: MIT
"""Print modes, M, K and R of a result beside the truth of the simulated rig: demo_truth.py RESULT.json TRUTH.json"""

import json
import pathlib
import sys
from typing import Any

import numpy as np
from numpy.typing import NDArray


def print_modes(modes: list[dict[str, Any]], truth: dict[str, Any]) -> None:
    """Frequencies and damping ratios, the nearest mode of the result to each true one."""
    print("identified beside the truth of the rig")
    print("  mode   f true [Hz]    f [Hz]   error      zeta true [%]  zeta [%]   error")
    for k, (f, zeta) in enumerate(zip(truth["frequency_hz"], truth["damping_ratio"], strict=True)):
        mode = min(modes, key=lambda one: abs(one["frequency_hz"] - f))
        df = mode["frequency_hz"] / f - 1
        dz = mode["damping_ratio"] / zeta - 1
        print(
            f"  {k + 1:4d}  {f:12.4f} {mode['frequency_hz']:9.4f} {100 * df:+7.4f} %"
            f"  {100 * zeta:14.4f} {100 * mode['damping_ratio']:9.4f} {100 * dz:+7.2f} %"
        )


def print_matrix(title: str, found: NDArray[np.float64], true: NDArray[np.float64]) -> None:
    """Found and true matrix row by row; the error is relative to the norm of the true one."""
    error = 100 * np.linalg.norm(found - true) / np.linalg.norm(true)
    print(f"  {title:<28} error {error:.2f} %")
    digits = 1 if np.max(np.abs(true)) > 1000 else 4
    for left, right in zip(found.tolist(), true.tolist(), strict=True):
        cells = ["".join(f"{x:12.{digits}f}" for x in row) for row in (left, right)]
        print(f"    {cells[0]}   true {cells[1]}")


def main() -> None:
    """Read both files and print."""
    result = json.loads(pathlib.Path(sys.argv[1]).read_text())
    truth = json.loads(pathlib.Path(sys.argv[2]).read_text())
    print_modes(result["modes"], truth)
    if "mkr" not in result:
        return
    print()
    for title, found, name in (
        ("M [kg]", result["mkr"]["M"], "M"),
        ("K [N/m]", result["mkr"]["K"], "K"),
        ("R [N s/m]", result["mkr"]["R"], "R"),
        ("R [N s/m] of normal modes", result["mkr"]["R_normal_modes"], "R"),
        ("R [N s/m] proportional", result["pdc"]["R"], "R"),
    ):
        print_matrix(title, np.array(found, float), np.array(truth[name], float))


if __name__ == "__main__":
    main()
