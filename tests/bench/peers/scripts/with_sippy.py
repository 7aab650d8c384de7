# SPDX-License-Identifier: MIT
"""Modes and shapes by SIPPY. The order is the user's: 12."""

import numpy as np
from sippy_unipi import system_identification


def modes(u, y, fs, order=12, rows=15):
    model = system_identification(
        y.T, u.T, "N4SID", centering="MeanVal", tsample=1 / fs, SS_f=rows, SS_p=rows, SS_fixed_order=order,
        SS_D_required=True,
    )  # fmt: skip
    poles, vectors = np.linalg.eig(model.A)
    keep = poles.imag > 0
    lam, shapes = fs * np.log(poles[keep]), model.C @ vectors[:, keep]
    for one, shape in zip(lam, shapes.T, strict=True):
        print(abs(one) / (2 * np.pi), -one.real / abs(one), shape / shape[np.argmax(abs(shape))])
    return abs(lam) / (2 * np.pi)
