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


def identified(made: laboratory.Laboratory) -> okid.Result:
    u = made.samples[:, : made.n_u] if made.n_u else None
    return okid.identify(u, made.samples[:, made.n_u :], fs=made.fs)


def confident(made: laboratory.Laboratory) -> list[okid.Mode]:
    return [mode for mode in identified(made).modes if mode.confident]


def warned(made: laboratory.Laboratory) -> str:
    """The text of `late_output`, or nothing."""
    return "".join(one.text for one in identified(made).warnings if one.code == "late_output")


@pytest.mark.parametrize("forces", [False, True])
def test_late_outputs_are_named(forces: bool) -> None:
    told = re.findall(r"(\w+) ([0-9.]+) ms", warned(record(forces, [1, 4])))
    assert [name for name, _ in told] == ["y2", "y5"]
    assert all(abs(float(ms) / (1e3 * LATE_S) - 1) < 0.05 for _, ms in told)


@pytest.mark.parametrize("forces", [False, True])
def test_shapes_are_without_the_delays(forces: bool) -> None:
    """One mode beside the other: those of the same record with no output late."""
    late, sound = (confident(record(forces, outputs)) for outputs in ([1, 4], []))
    assert len(late) == len(sound) >= 5
    for one, other in zip(late, sound, strict=True):
        a, b = np.asarray(one.shape), np.asarray(other.shape)
        assert np.abs(np.vdot(a, b)) ** 2 > 0.99 * np.vdot(a, a).real * np.vdot(b, b).real
        assert one.mpc == pytest.approx(other.mpc, abs=0.02)


@pytest.mark.parametrize("forces", [False, True])
def test_others_are_not(forces: bool) -> None:
    assert warned(record(forces, [])) == ""
