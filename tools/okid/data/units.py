# SPDX-License-Identifier: MIT
"""Units that are made SI."""

# Name, size in the SI unit, SI unit: as firmware_host/files/units.cpp has them (a test compares).
SI = {
    "kN": (1e3, "N"),
    "mN": (1e-3, "N"),
    "lbf": (4.4482216152605, "N"),
    "mm/s^2": (1e-3, "m/s^2"),
    "cm/s^2": (1e-2, "m/s^2"),
    "g": (9.80665, "m/s^2"),
    "mg": (9.80665e-3, "m/s^2"),
    "mm/s": (1e-3, "m/s"),
    "mm": (1e-3, "m"),
    "um": (1e-6, "m"),
    "µm": (1e-6, "m"),
}
