# SPDX-License-Identifier: MIT
"""Modes and shapes by ctrlsys (SLICOT). The order is the user's: 12."""

import ctrlsys
import numpy as np


def modes(u, y, fs, order=12, rows=15):
    (samples, n_u), n_y = u.shape, y.shape[1]
    u, y = (np.asfortranarray(x - x.mean(axis=0)) for x in (u, y))
    r, info = ctrlsys.ib01ad("M", "C", "M", "O", "N", "N", rows, n_u, n_y, u, y, 0.0, -1.0)[1::3]
    if info:
        raise RuntimeError(info)
    a, c, *_ = ctrlsys.ib01bd("M", "A", "N", rows, order, n_u, n_y, samples, r, 0.0)
    poles, vectors = np.linalg.eig(a)
    keep = poles.imag > 0
    lam, shapes = fs * np.log(poles[keep]), c @ vectors[:, keep]
    for one, shape in zip(lam, shapes.T, strict=True):
        print(abs(one) / (2 * np.pi), -one.real / abs(one), shape / shape[np.argmax(abs(shape))])
    return abs(lam) / (2 * np.pi)
