# SPDX-License-Identifier: MIT
"""Sensors behind a slow filter or another logger: their outputs come late by a part of a sample, in records with and
without forces. The delay is put in as a factor of the Fourier transform; okid knows shapes alone."""

from __future__ import annotations

import re

import laboratory
import numpy as np
import okid
import pytest

LATE_S = 7e-3


def record(forces: bool, late: list[int]) -> laboratory.Laboratory:
    made = laboratory.forced(3) if forces else laboratory.ambient(4, False, seconds=240.0)
    f = np.fft.rfftfreq(len(made.samples), 1 / made.fs)
    for output in late:
        column = made.samples[:, made.n_u + output]
        column[:] = np.fft.irfft(np.fft.rfft(column) * np.exp(-2j * np.pi * f * LATE_S), len(column))
    return made


def warned(made: laboratory.Laboratory) -> str:
    """The text of `late_output`, or nothing."""
    u = made.samples[:, : made.n_u] if made.n_u else None
    found = okid.identify(u, made.samples[:, made.n_u :], fs=made.fs)
    return "".join(one.text for one in found.warnings if one.code == "late_output")


@pytest.mark.parametrize("forces", [False, True])
def test_late_outputs_are_named(forces: bool) -> None:
    told = re.findall(r"(\w+) ([0-9.]+) ms", warned(record(forces, [1, 4])))
    assert [name for name, _ in told] == ["y2", "y5"]
    assert all(abs(float(ms) / (1e3 * LATE_S) - 1) < 0.05 for _, ms in told)


@pytest.mark.parametrize("forces", [False, True])
def test_others_are_not(forces: bool) -> None:
    assert warned(record(forces, [])) == ""
