# SPDX-License-Identifier: MIT
"""Arrays to modes, and to mass, stiffness and damping.
usage: array_to_modes.py RECORD.csv FORCE RESPONSE [RESPONSE ..]"""

import sys

import okid

path, force, *responses = sys.argv[1:]
record = okid.read_csv(path)
u, y = record.columns([force], path), record.columns(responses, path)  # (samples, inputs), (samples, outputs)
result = okid.identify(
    u,
    y,
    fs=record.fs_hz,
    input_names=[force],
    output_names=responses,
    input_dofs=[1],
    output_dofs=list(range(1, len(responses) + 1)),
)
for mode in result.confident_modes:
    print(f"{mode.frequency_hz:.4f} ± {mode.frequency_std_hz:.4f} Hz, damping {100 * mode.damping_ratio:.3f} %")
print("M, kg:", *(f"{value:.3f}" for value in result.mkr.M.diagonal()))
