# SPDX-License-Identifier: MIT
"""Modes with standard deviations and shapes by okid."""

import okid


def modes(u, y, fs):
    result = okid.identify(u, y, fs=fs)
    print(result.table())
    return [mode.frequency_hz for mode in result.modes]
