# SPDX-License-Identifier: MIT
"""Modes and shapes by modred. The order is the user's: 12."""

import modred
import numpy as np


def modes(u, y, fs, order=12, rows=30):
    u, y = u - u.mean(axis=0), y - y.mean(axis=0)
    markov = modred.OKID(u.T, y.T, 2 * rows + 2)[1:]
    _, sampled = modred.make_sampled_format(range(len(markov)), markov)
    a, _, c = modred.ERA(verbosity=0).compute_model(sampled, order)
    poles, vectors = np.linalg.eig(a)
    keep = poles.imag > 0
    lam, shapes = fs * np.log(poles[keep]), c @ vectors[:, keep]
    for one, shape in zip(lam, shapes.T, strict=True):
        print(abs(one) / (2 * np.pi), -one.real / abs(one), shape / shape[np.argmax(abs(shape))])
    return abs(lam) / (2 * np.pi)
