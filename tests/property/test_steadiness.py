# SPDX-License-Identifier: MIT
"""Structures that are not linear or not steady are said, linear and steady ones never are.

The time integration here (Runge-Kutta, four steps a sample) shares nothing with the program; linear records come from
the frequency domain (laboratory).
"""

from __future__ import annotations

import os

import numpy as np
import okid
import pytest
import scipy.signal
from laboratory import Laboratory, ambient, chain, forced
from modal_sums import OVER, Sums
from numpy.typing import NDArray
from program import ROOT

Real = NDArray[np.float64]
FS = 256.0
SLOW = os.environ.get("OKID_SLOW") == "1"


def integrated(cubic: float, drift: float, count: int = 6000) -> tuple[Real, Real]:
    """Three masses, a force at the first; its spring to ground is cubic, or all springs lose a share with time."""
    rng = np.random.default_rng(4)
    k = np.array([2.0e4, 2.4e4, 1.8e4])
    K = np.diag(k + np.append(k[1:], 0)) - np.diag(k[1:], 1) - np.diag(k[1:], -1)
    C = 0.4 * np.eye(3) + 6e-5 * K
    steps = 4 * count
    F = np.fft.rfft(rng.standard_normal(steps))
    f = np.fft.rfftfreq(steps, 1 / FS / 4)
    F[(f > 0.4 * FS) | (f < 0.5)] = 0
    u = np.fft.irfft(F, steps)
    u /= u.std()
    dt = 1 / FS / 4
    out = np.empty((count, 3))
    x, v = np.zeros(3), np.zeros(3)

    def acceleration(x: Real, v: Real, force: float, share: float) -> Real:
        a = -C @ v - (1 - drift * share) * (K @ x)
        a[0] += force - cubic * k[0] * x[0] ** 3
        return a

    for i in range(steps):
        share, now, then = i / steps, u[i], u[(i + 1) % steps]
        a1 = acceleration(x, v, now, share)
        if i % 4 == 0:
            out[i // 4] = a1
        v2 = v + dt / 2 * a1
        a2 = acceleration(x + dt / 2 * v, v2, (now + then) / 2, share)
        v3 = v + dt / 2 * a2
        a3 = acceleration(x + dt / 2 * v2, v3, (now + then) / 2, share)
        v4 = v + dt * a3
        a4 = acceleration(x + dt * v3, v4, then, share)
        x, v = x + dt / 6 * (v + 2 * v2 + 2 * v3 + v4), v + dt / 6 * (a1 + 2 * a2 + 2 * a3 + a4)
    return u[::4], out + 0.01 * out.std(0) * rng.standard_normal(out.shape)


def codes(lab: Laboratory) -> set[str]:
    forces = lab.samples[:, : lab.n_u] if lab.n_u else None
    result = okid.identify(forces, lab.samples[:, lab.n_u :], fs=lab.fs, sigma_blocks=0)
    return {w.code for w in result.warnings}


@pytest.mark.parametrize(
    ("cubic", "drift", "code"),
    [(0.0, 0.0, None), (1e6, 0.0, "level_dependent"), (-3e5, 0.0, "level_dependent"), (0.0, 0.01, "time_varying")],
)
def test_integrated(cubic: float, drift: float, code: str | None) -> None:
    u, y = integrated(cubic, drift)
    result = okid.identify(u, y, fs=FS, sigma_blocks=0)
    said = {w.code: w.text for w in result.warnings}
    assert [round(m.frequency_hz) for m in result.modes if m.confident] == [10, 27 + (cubic > 0), 42]
    assert ("nonlinear" in said) == (cubic != 0)
    assert set(said) & {"level_dependent", "time_varying"} == ({code} if code else set())
    if code:
        sign = "+" if cubic > 0 else "-"
        assert f": {sign}0." in said[code] and " σ)" in said[code]


def test_strongly_cubic() -> None:
    """Subspace methods agree on sums of 10.6, 28 and 42.5 Hz; the linear modes lie at 10.3, 27.4 and 42.2 Hz."""
    u, y = integrated(3e6, 0.0)
    result = okid.identify(u, y, fs=FS, sigma_blocks=0)
    sure = [mode.frequency_hz for mode in result.modes if mode.confident]
    assert np.allclose(sure, [10.6, 28.0, 42.5], rtol=0.02), sure
    assert sum("harmonic" in mode.why for mode in result.modes) >= 2
    assert any(w.code == "nonlinear" and "2 × 10.62 + 27.9" in w.text for w in result.warnings)
    assert "nonlinear" in {w.code for w in okid.identify(None, y, fs=FS, sigma_blocks=0).warnings}


@pytest.mark.parametrize("seed", range(40, 46) if SLOW else [40, 43, 45])
def test_linear_and_forced(seed: int) -> None:
    assert not codes(forced(seed, count=8000)) & {"level_dependent", "nonlinear", "time_varying"}


def test_linear_and_otherwise() -> None:
    for lab in (ambient(41, True, seconds=300), chain(42, count=10000).lab):
        assert not codes(lab) & {"level_dependent", "nonlinear", "time_varying"}


def struck(seed: int, modes: int, pulse_s: float, rate: float = 4000.0, over: int = 8) -> tuple[Real, Real]:
    """Six hits in 8 s on many modes, some of them above the band, behind a soft filter: the model is never exact."""
    rng = np.random.default_rng(seed)
    fast, count = rate * over, int(8 * rate * over)
    force, length = np.zeros(count), int(pulse_s * rate * over)
    for k in range(6):
        first = int((0.3 + k * 8 / 6 + rng.uniform(0, 0.1)) * fast)
        force[first : first + length] += rng.uniform(50, 200) * np.sin(np.pi * (np.arange(length) + 0.5) / length)
    y = np.zeros((count, 3))
    for hz in np.sort(rng.uniform(0.01, 0.9, modes)) * rate:
        poles = [1, 4 * np.pi * rng.uniform(0.002, 0.01) * hz, (2 * np.pi * hz) ** 2]
        own = scipy.signal.cont2discrete(([1, 0, 0], poles), 1 / fast)
        y += np.outer(scipy.signal.lfilter(np.ravel(own[0]), own[1], force), rng.standard_normal(3))
    low = scipy.signal.butter(4, 0.42 * rate, fs=fast, output="sos")
    rows = scipy.signal.sosfilt(low, np.column_stack([force, y]), axis=0)[::over]
    rows += 1e-4 * rows.max(0) * rng.standard_normal(rows.shape)
    return rows[:, :1], rows[:, 1:]


@pytest.mark.parametrize(("seed", "modes", "pulse_s"), [(5, 14, 3e-4), (7, 20, 6e-4)])
def test_linear_and_struck(seed: int, modes: int, pulse_s: float) -> None:
    """Errors of the model are loud after each hit: they are no change of the structure."""
    result = okid.identify(*struck(seed, modes, pulse_s), fs=4000.0)
    assert sum(mode.confident for mode in result.modes) >= 5
    assert not {w.code for w in result.warnings} & {"level_dependent", "time_varying"}


@pytest.mark.parametrize("seed", [1, 2, 3] if SLOW else [2])
def test_linear_and_swept(seed: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """Of a swept sine each mode answers for a short time, one above its end hardly: that is no drift, no dependence."""
    monkeypatch.syspath_prepend(str(ROOT / "tests" / "kinds"))
    import forced_kinds  # noqa: PLC0415

    kind = forced_kinds.KINDS["sweep"]
    record = kind.make(np.random.default_rng([kind.number, seed, 13]))
    result = okid.identify(record.inputs, record.outputs, fs=record.rate, sigma_blocks=0)
    assert not {w.code for w in result.warnings} & {"level_dependent", "time_varying"}


@pytest.mark.parametrize(("gusts", "seed"), [(1.3, 16), (1.6, 15)])
def test_linear_and_in_gusts(gusts: float, seed: int) -> None:
    """Wind that swells and falls: the blocks of the one strongest gust weigh as much as all others together."""
    s = Sums(10, [0.31, 0.66, 0.98, 1.35, 1.62, 2.1], (0.008, 0.018), 3, seed)
    count = 1800 * 10 * OVER
    swell = np.interp(np.arange(count), np.arange(21) * (count // 20), s.rng.standard_normal(21))
    y = 0
    for _ in range(3):
        y = y + s.response(np.exp(gusts * swell) * s.rng.standard_normal(count), s.rng.standard_normal(6))
    y = s.lower(y)
    result = okid.identify(None, (y + 0.02 * y.std() * s.rng.standard_normal(y.shape)).T, fs=10, sigma_blocks=0)
    assert sum(mode.confident for mode in result.modes) >= 5
    assert not {w.code for w in result.warnings} & {"level_dependent", "time_varying"}
