# SPDX-License-Identifier: MIT
"""Modes and shapes by mdof. The order is the user's: 12."""

import mdof


def modes(u, y, fs, order=12, rows=15):
    u, y = u - u.mean(axis=0), y - y.mean(axis=0)
    realization = mdof.system(u.T, y.T, dt=1 / fs, method="srim", order=order, horizon=rows)
    found = realization.modes()
    for mode in found.values():
        print(mode["freq"], mode["damp"], mode["modeshape"])
    return [mode["freq"] for mode in found.values()]
