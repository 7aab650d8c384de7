# SPDX-License-Identifier: MIT
"""Print the modes of a result beside the truth of the simulated rig: demo_truth.py RESULT.json TRUTH.json"""

import json
import pathlib
import sys

modes = json.loads(pathlib.Path(sys.argv[1]).read_text())["modes"]
truth = json.loads(pathlib.Path(sys.argv[2]).read_text())
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
