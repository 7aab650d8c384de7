# SPDX-License-Identifier: MIT
"""The curve over temperature: bends where the frequencies have them, none out of noise or a slow influence."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from okid.campaign import trend_model
from okid.campaign.temperature_curve import LEAST, Curve, find_curve, slopes

F0, SIGMA = np.array([4.0, 5.1, 9.8]), 2e-3


def training(
    seed: int,
    bends: tuple[float, ...] = (),
    change: float = -5e-3,
    persistence: float = 0.0,
    n: int = 365,
    bad: float = 0.0,
) -> tuple[Any, Any, Any]:
    """Frequencies, temperatures and weights of a year of days; below each bend the slope is steeper by `change`."""
    rng = np.random.default_rng([seed, n])
    t = 9.0 - 11.0 * np.cos(2.0 * np.pi * np.arange(n) / n) + 4.0 * rng.standard_normal(n)
    e = rng.standard_normal((n, 3))
    for k in range(1, n):
        e[k] = persistence * e[k - 1] + np.sqrt(1.0 - persistence**2) * e[k]
    f = 1.0 - 4e-4 * t + change * sum(np.minimum(t - bend, 0.0) for bend in bends)
    y = F0 * (f[:, None] + SIGMA * e)
    y[rng.random((n, 3)) < bad] *= 1.1
    return y, t, np.ones((n, 3))


def test_a_bend_is_found_where_it_is() -> None:
    """Frozen ground: at 0 °C within 1 °C, the slopes of both pieces, of 20 years; 5 % wrong values change nothing."""
    for seed in range(20):
        y, t, weight = training(seed, (0.0,), bad=0.05 if seed % 2 else 0.0)
        curve, gain = find_curve(y, t, weight)
        assert curve.bends is not None and len(curve.bends) == 1 and abs(curve.bends[0]) < 1.0
        assert gain > 1.5
        X = curve.regressors(t, len(t))
        usual, left = trend_model.usual_spread(y, X, weight)
        model = trend_model.fit(y, X, weight * ~trend_model.far(left, usual))
        steep, std = slopes(model)
        np.testing.assert_array_less(np.abs(steep[0] / F0 + 5.4e-3), 4.0 * std[0] / F0 + 3e-4)
        np.testing.assert_array_less(np.abs(steep[1] / F0 + 4e-4), 4.0 * std[1] / F0 + 1e-4)


@pytest.mark.parametrize(("persistence", "n"), [(0.0, 365), (0.8, 365), (0.0, 60), (0.0, 20), (0.0, 12)])
def test_a_line_stays_a_line(persistence: float, n: int) -> None:
    """One of 40 may have a bend by chance, also where the residuals of successive days are alike."""
    bent = sum(bool(find_curve(*training(seed, (), 0.0, persistence, n))[0].bends) for seed in range(40))
    assert bent <= 1


def test_a_round_curve_has_its_bends() -> None:
    y, t, weight = training(3)
    curve, _ = find_curve(y + F0 * 1e-4 * (t[:, None] - 9.0) ** 2, t, weight)
    assert curve.bends is not None and len(curve.bends) == 2


def test_the_count_that_is_asked_for() -> None:
    """Each piece has groups of every mode: where there are too few, there are fewer bends than are asked for."""
    y, t, weight = training(4)
    for count in (0, 1, 2):
        bends = find_curve(y, t, weight, count)[0].bends
        assert bends is not None and len(bends) == count
        assert np.all(np.bincount(np.searchsorted(bends, t), minlength=count + 1) >= LEAST)
    weight[t < 15.0, 1] = 0.0
    bends = find_curve(y, t, weight, 1)[0].bends
    assert bends is not None and all(bend > 15.0 for bend in bends)
    two = np.where(t > 9.0, 12.0, 4.0)  # temperatures: no curve through them but a line
    assert find_curve(y, two, np.ones((365, 3)))[0].bends == ()
    assert find_curve(y[:12], t[:12], np.ones((12, 3)), 1)[0].bends == ()


def test_regressors() -> None:
    t = np.array([-10.0, 0.0, 5.0, 20.0])
    X = Curve(5.0, (0.0, 10.0)).regressors(t, 4)
    np.testing.assert_allclose(X, [[1, -1.5, 0, 0], [1, -0.5, 0, 0], [1, 0, 0.5, 0], [1, 1.5, 2, 1]])
    for none in (Curve(5.0, None).regressors(t, 4), Curve(5.0, (0.0,)).regressors(None, 4)):
        np.testing.assert_allclose(none, np.ones((4, 1)))
