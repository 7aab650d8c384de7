# SPDX-License-Identifier: MIT
"""Modes and shapes by pyOMA-2 from the outputs; a user reads frequencies and order off its stabilization diagram."""

import numpy as np
from pyoma2.algorithms import SSI
from pyoma2.setup import SingleSetup


def modes(u, y, fs, seen=(8.37, 22.3, 36.4, 43.2, 54.6, 60.4)):
    setup = SingleSetup(y - y.mean(axis=0), fs=fs)
    ssi = SSI(name="ssi", br=60, ordmax=60)
    setup.add_algorithms(ssi)
    setup.run_by_name("ssi")
    ssi.mpe(sel_freq=list(seen), order_in=40)
    print(ssi.result.Fn, ssi.result.Xi, ssi.result.Phi)
    return np.asarray(ssi.result.Fn)
