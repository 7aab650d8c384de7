# SPDX-License-Identifier: MIT
"""Whiteness of the residual: against direct sums, against noise of known colour, with gaps; spectra of the model."""

from __future__ import annotations

import numpy as np
import pytest
from okid import frf
from okid.record.demo import demo_record
from okid.report.residual import BOUND_95, BOUND_99, whiteness
from report_files import FS

RNG = np.random.default_rng(7)


def test_correlations_by_hand() -> None:
    e, u = RNG.standard_normal((400, 2)), RNG.standard_normal((400, 1))
    found = whiteness([(e, u)], 5)
    assert found is not None
    a, b = e - e.mean(axis=0), u - u.mean(axis=0)
    for lag in range(1, 6):
        own = np.sum(a[lag:] * a[:-lag], axis=0) / np.sum(a**2, axis=0) * 400 / (400 - lag)
        assert found.auto[lag] == pytest.approx(own)
        scale = np.sqrt(np.sum(a**2, axis=0) * np.sum(b**2))
        assert found.cross[5 + lag, :, 0] == pytest.approx(np.sum(a[lag:] * b[:-lag], axis=0) / scale)
        assert found.cross[5 - lag, :, 0] == pytest.approx(np.sum(a[:-lag] * b[lag:], axis=0) / scale)
    assert found.cross[5, :, 0] == pytest.approx(np.sum(a * b, axis=0) / scale)
    assert pytest.approx((1.959964, 2.575829), abs=1e-6) == (BOUND_95, BOUND_99)


def test_white_noise_is_called_white_as_often_as_it_should() -> None:
    white, outside = 0, 0
    for _ in range(200):
        found = whiteness([(RNG.standard_normal((1000, 1)), RNG.standard_normal((1000, 1)))], 25)
        assert found is not None
        white += found.verdict(0) == "white"
        outside += int(np.sum(np.abs(found.auto[1:, 0]) > BOUND_95 / np.sqrt(1000.0)))
    assert white >= 193  # 1 % level
    assert 0.04 < outside / (200 * 25) < 0.06


def test_colour_and_what_the_model_missed_are_found() -> None:
    e, u = RNG.standard_normal((5000, 3)), RNG.standard_normal((5000, 1))
    for n in range(1, 5000):
        e[n, 0] += 0.5 * e[n - 1, 0]
        e[n, 1] += 0.07 * e[n - 1, 1]
    e[3:, 2] += 0.2 * u[:-3, 0]
    found = whiteness([(e, u)], 20)
    assert found is not None
    assert [found.verdict(k) for k in range(3)] == ["not white", "nearly white", "white"]
    assert found.beyond(0, 0)[0] <= found.beyond(0, 0)[1]
    assert found.cross[20 + 3, 2, 0] == pytest.approx(0.2, abs=0.03)
    late = whiteness([(np.roll(e[:, 2:], -9, axis=0), u)], 20)  # the response before its cause: feedback, no lag >= 0
    assert late is not None
    assert abs(late.cross[20 - 6, 0, 0]) > 0.15


def test_a_coloured_input_has_wider_bounds() -> None:
    drive = RNG.standard_normal((4000, 1))
    for n in range(1, 4000):
        drive[n] += 0.9 * drive[n - 1]
    e = RNG.standard_normal((4000, 1))
    for n in range(1, 4000):
        e[n] += 0.9 * e[n - 1]
    found = whiteness([(e, drive)], 60)
    assert found is not None
    expected = np.sqrt((1.0 + 0.81) / (1.0 - 0.81) / 4000.0)  # Bartlett: sum of 0.81^|k|
    assert found.cross_unit[0, 0] == pytest.approx(expected, rel=0.25)


def test_gaps_and_pieces_carry_no_weight() -> None:
    e, u = RNG.standard_normal((3000, 1)), RNG.standard_normal((3000, 1))
    holed = e.copy()
    holed[::7] = np.nan
    found = whiteness([(holed[:1500], u[:1500]), (holed[1500:], u[1500:])], 15)
    assert found is not None
    assert found.used.tolist() == [int(np.sum(np.isfinite(holed)))]
    assert found.rms[0] == pytest.approx(np.nanstd(holed), rel=1e-9)
    assert found.verdict(0) == "white"
    assert np.max(np.abs(found.auto[1:])) < 0.1
    assert whiteness([(holed[:100], u[:100])], 15) is None


def test_spectra_hold_the_power_of_the_record_and_of_the_model() -> None:
    y = demo_record(20000)[1]
    y[::5000] = np.nan
    found = frf.spectra(y, FS)
    step = found.frequency_hz[1]
    power = np.sum(np.diagonal(found.power, axis1=1, axis2=2).real, axis=0) * step
    assert power == pytest.approx(np.nanvar(y, axis=0), rel=0.15)
    A, K, C = np.array([[0.9]]), np.array([[0.5]]), np.array([[1.0]])
    line = np.linspace(0.0, 50.0, 4001)
    made = frf.synthesise_spectra(A, K, C, [[2.0]], 0.01, line)
    variance = 2.0 * (1.0 + 0.25 / (1.0 - 0.81))  # y = e + 0.5 (e' + 0.9 e'' ..)
    assert np.trapezoid(made[:, 0, 0].real, line) == pytest.approx(variance, rel=1e-4)
    with pytest.raises(frf.InputError, match="64"):
        frf.spectra(y[:40], FS)
