# SPDX-License-Identifier: MIT
"""Nyquist circle of a mode: near a resonance the mobility of one pair of places runs along a circle.

>>> import numpy as np
>>> from okid.result.circle import fit_circle
>>> f = np.linspace(9.5, 10.5, 41)
>>> mobility = 2j * np.pi * f / ((10.0**2 - f**2 + 2j * 0.01 * 10.0 * f) * (2.0 * np.pi) ** 2) + 0.3j
>>> found = fit_circle(f, mobility, "velocity")
>>> round(found.frequency_hz, 4), round(found.damping_ratio, 4)
(10.0, 0.01)
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from okid._errors import InputError

Real = NDArray[np.float64]
Complex = NDArray[np.complex128]
FEWEST, WORST_MISFIT = 5, 0.4  # lines of a circle; rms distance of the lines from it over its radius
_POWERS = {"acceleration": -1, "velocity": 0, "displacement": 1}  # of i omega, to a mobility


class Circle(NamedTuple):
    """lines_hz (F,) and mobility (F,) that were used; centre and radius in the unit of the mobility; frequency_hz and
    damping_ratio of the mode; misfit: rms distance of the lines to the circle over its radius."""

    lines_hz: Real
    mobility: Complex
    centre: complex
    radius: float
    frequency_hz: float
    damping_ratio: float
    misfit: float

    @property
    def resonance(self) -> complex:
        """The point of the circle at the natural frequency, opposite to where other modes shift its begin."""
        return complex(self.centre + self.radius * np.exp(1j * self._angle))

    @property
    def _angle(self) -> float:
        turn = _turn(2.0 * np.pi * self.lines_hz, 2.0 * np.pi * self.frequency_hz, self.damping_ratio)
        return float(np.angle(np.sum((self.mobility - self.centre) * np.exp(-1j * turn))))


def _turn(omega: Real, natural: float, damping: float) -> Real:
    """Angle around the circle from the resonance, seen from the centre."""
    return 2.0 * np.arctan2(natural**2 - omega**2, 2.0 * damping * natural * omega)


def fit_circle(frequency_hz: ArrayLike, response: ArrayLike, sensing: str = "acceleration") -> Circle:
    """Circle, natural frequency and damping ratio of one mode from a response (F,) at the lines around it.

    The circle is the least-squares one; frequency and damping follow from the angles of the lines around its centre, so
    that what other modes add (nearly constant there) does not count. sensing: what the response is per newton.
    InputError with fewer than five lines, or when no resonance runs through them.
    Source: Ewins, Modal Testing, circle fit; viscous damping, so of the mobility.
    """
    from scipy.optimize import least_squares

    if sensing not in _POWERS:
        raise InputError(f"sensing is {sensing!r}, expected {', '.join(_POWERS)}")
    f, h = np.asarray(frequency_hz, dtype=np.float64), np.asarray(response, dtype=np.complex128)
    if f.ndim != 1 or f.shape != h.shape or len(f) < FEWEST:
        raise InputError(f"{f.shape} lines and {h.shape} values, expected (F,) of both and F of {FEWEST} or more")
    omega = 2.0 * np.pi * f
    mobility = h * (1j * omega) ** _POWERS[sensing]
    scale = float(np.max(np.abs(mobility))) or 1.0
    x, y = mobility.real / scale, mobility.imag / scale
    (a, b, c), *_ = np.linalg.lstsq(np.column_stack([2.0 * x, 2.0 * y, np.ones(len(f))]), x**2 + y**2, rcond=None)
    radius = float(np.sqrt(max(c + a**2 + b**2, 0.0)))
    angle = np.unwrap(np.angle(x + 1j * y - (a + 1j * b)))
    off = np.hypot(x - a, y - b) / radius - 1.0 if radius > 0.0 else np.ones(1)
    misfit = float(np.sqrt(np.mean(off**2)))
    if not misfit < WORST_MISFIT or abs(angle[-1] - angle[0]) < 0.5:
        raise InputError(f"no resonance runs through the lines from {f[0]:.4g} to {f[-1]:.4g} Hz")
    steepest = int(np.argmax(np.abs(np.diff(angle) / np.diff(omega))))
    natural = float(omega[steepest] + omega[steepest + 1]) / 2.0
    rate = abs(float(angle[steepest + 1] - angle[steepest])) / float(omega[steepest + 1] - omega[steepest])
    damping = float(np.clip(2.0 / max(rate * natural, 1e-12), 1e-5, 0.5))
    begin = float(np.interp(natural, omega, angle))

    def error(p: Real) -> Real:
        turn = _turn(omega, natural * float(np.exp(p[1])), damping * float(np.exp(p[2])))
        return np.asarray(np.angle(np.exp(1j * (angle - begin - p[0] - turn))), dtype=np.float64)

    found = least_squares(error, np.zeros(3)).x
    return Circle(f, mobility, complex(a, b) * scale, radius * scale, natural * float(np.exp(found[1])) / (2.0 * np.pi),
                  damping * float(np.exp(found[2])), misfit)  # fmt: skip


def lines_around(frequency_hz: ArrayLike, natural_hz: float, damping_ratio: float) -> NDArray[np.intp]:
    """Numbers of the lines within two half-power widths to either side of a mode, at least FEWEST of them."""
    f = np.asarray(frequency_hz, dtype=np.float64)
    order = np.argsort(np.abs(f - natural_hz), kind="stable")
    inside = int(np.sum(np.abs(f - natural_hz) <= 4.0 * damping_ratio * natural_hz))
    return np.sort(order[: max(inside, FEWEST)])
