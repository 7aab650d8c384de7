# SPDX-License-Identifier: MIT
"""Two years of monitoring on the computer, group by group: a structure whose frequencies follow its temperature.

usage: seasons.py [--seeds N] [--hours N]   default: 20 seeds of each structure with and without damage, a group a day

Prints days until the alarm, false alarms in a year and the share of groups in no chart. The first year trains. σ, error
and share of missing modes of a group are those of ambient records of the structure that okid identifies; the year draws
from them. Air has seasons, days and weather; the structure follows it with a lag and its frequencies follow linearly,
those of "frost" with a bend at 0 °C as of frozen ground or asphalt (Peeters and De Roeck 2001). Damage softens one
spring until the first frequency is 1.5 % lower.
"""

from __future__ import annotations

import argparse
from functools import cache
from typing import Any, NamedTuple

import numpy as np
import okid
from numpy.typing import NDArray
from okid.campaign import control_chart, trend
from okid.campaign.spec import Trend
from okid.campaign.trend import SeriesTrend, Track, analyse
from scipy.optimize import brentq
from scipy.signal import lfilter

Real = NDArray[np.float64]
FS, RECORD_S, RECORDS, NOISE = 40.0, 600.0, 12, 0.3
DROP, DAY_S, YEAR = 0.015, 86400.0, 365


class Kind(NamedTuple):
    """A chain of four masses: spring and damping, change with °C of each mode above and below 0 °C, hours of thermal
    lag."""

    spring: float
    damping: float
    warm: tuple[float, ...]
    cold: tuple[float, ...]
    lag_h: float


KINDS = {
    "line": Kind(4e3, 0.01, (-5e-4, -4e-4, -4e-4, -3e-4), (-5e-4, -4e-4, -4e-4, -3e-4), 3.0),
    "frost": Kind(6e3, 0.015, (-4e-4, -3e-4, -4e-4, -3e-4), (-5e-3, -4e-3, -5e-3, -3e-3), 12.0),
}
MASSES = [4.0, 3.0, 3.5, 2.5]


def structure(kind: Kind, loss: float = 0.0) -> okid.Structure:
    """The chain, its second spring softer by `loss`."""
    springs = kind.spring * np.array([1.0, 0.9, 1.1, 0.8])
    springs[1] *= 1.0 - loss
    return okid.Structure.chain(MASSES, springs.tolist(), zeta=(kind.damping, kind.damping))


def frequencies(kind: Kind, loss: float = 0.0) -> Real:
    return np.array([mode.frequency_hz for mode in structure(kind, loss).modes(damped=False)])


@cache
def drops(name: str) -> Real:
    """Relative change of each frequency by the damage that lowers the first one by 1.5 %."""
    whole = frequencies(KINDS[name])
    loss = brentq(lambda x: frequencies(KINDS[name], x)[0] / whole[0] - 1.0 + DROP, 0.0, 0.5)
    return np.asarray(frequencies(KINDS[name], loss) / whole - 1.0)


@cache
def records(name: str, count: int = RECORDS) -> tuple[Real, Real]:
    """Relative error and σ (count, 4) of the frequencies that okid identifies from ambient records; NaN: not sure."""
    kind = KINDS[name]
    model, truth = structure(kind).model(FS, [1, 2, 3, 4], [1, 2, 3, 4]), frequencies(kind)
    error, std = np.full((2, count, 4), np.nan)
    for k in range(count):
        rng = np.random.default_rng([k, 77])
        y = model.simulate(rng.standard_normal((round(FS * RECORD_S), 4)))
        y += NOISE * y.std(axis=0) * rng.standard_normal(y.shape)
        found = okid.identify(None, y, fs=FS).confident_modes
        for m, f in enumerate(truth):
            best = min(found, key=lambda mode: abs(mode.frequency_hz - f), default=None)
            if best is not None and abs(best.frequency_hz / f - 1.0) < 0.03:
                error[k, m] = best.frequency_hz / f - 1.0
                std[k, m] = (best.frequency_std_hz or np.nan) / f
    return error, std


def air(rng: np.random.Generator, hours: int) -> Real:
    """°C of each hour: season, day, weather that lasts four days; the day's swing is that of clear and of dull days."""
    hour = np.arange(hours)
    weather = lfilter([np.sqrt(1.0 - 0.99**2)], [1.0, -0.99], rng.standard_normal(hours + 1000))[1000:]
    swing = np.repeat(rng.uniform(1.0, 6.0, hours // 24 + 1), 24)[:hours]
    season = -11.0 * np.cos(2.0 * np.pi * (hour / 24.0 - 20.0) / 365.25)
    return np.asarray(9.0 + season + 4.0 * weather + swing * np.cos(2.0 * np.pi * (hour - 15.0) / 24.0))


def campaign(name: str, seed: int, damage_day: int | None, every_h: int = 24, of_air: bool = False) -> SeriesTrend:
    """Two years, a group every so many hours; temperature is that of the structure or of the air, to 0.3 °C."""
    kind, rng = KINDS[name], np.random.default_rng([seed, len(name)])
    hours = 2 * YEAR * 24
    share = 1.0 - np.exp(-1.0 / kind.lag_h)
    outside = air(rng, hours + 480)
    body = lfilter([share], [1.0, share - 1.0], outside)[480:]
    at = np.arange(12, hours, every_h)
    warmth = body[at, None]
    f = frequencies(kind) * (1.0 + np.where(warmth > 0.0, kind.warm, kind.cold) * warmth)
    if damage_day is not None:
        f[at >= 24 * (YEAR + damage_day)] *= 1.0 + drops(name)
    error, std = records(name)
    ratio = np.sqrt(np.nanmean((error / std) ** 2, axis=0))  # of what is off over what okid states
    drawn = std[rng.integers(len(std), size=len(at))]
    f *= 1.0 + drawn * ratio * rng.standard_normal(drawn.shape)  # NaN: missing
    n = len(at)
    celsius = (outside[480:] if of_air else body)[at] + 0.3 * rng.standard_normal(n)
    tracks = [
        Track(m + 1, f[:, m], drawn[:, m] * f[:, m], np.full(n, kind.damping), np.full(n, 1e-3)) for m in range(4)
    ]
    return SeriesTrend(name, [f"hour {h}" for h in at], at * 3600.0, celsius, tracks)


def episodes(rows: list[int]) -> int:
    """Alarms that begin: those of groups in a row are one."""
    return sum(k == 0 or row > rows[k - 1] + 1 for k, row in enumerate(rows))


def watched(one: SeriesTrend, order: Any = None) -> tuple[list[float], float]:
    """Days in the second year with an alarm, and the share of its groups that are in no chart."""
    spec = Trend(training_share=0.5) if order is None else Trend(training_share=0.5, temperature_order=order)
    analyse(one, spec)
    assert one.charts is not None, one.reason
    second = np.flatnonzero(one.time_s >= YEAR * DAY_S)
    charted = np.isin(second, one.rows) & ~np.isin(second, one.odd)
    return [one.time_s[row] / DAY_S - YEAR for row, _ in one.alarms], 1.0 - float(np.mean(charted))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seeds", type=int, default=20)
    parser.add_argument("--hours", type=int, default=24, help="from group to group")
    parser.add_argument("--air", action="store_true", help="the temperature of the air is known, not the structure's")
    parser.add_argument("--order", default=None, help="temperature_order of the spec")
    given = parser.parse_args()
    control_chart._SIMULATED = 400  # as in the tests; a tenth of the usual
    trend.find_change = lambda *_: None
    order = int(given.order) if given.order and given.order.isdigit() else given.order
    for name in KINDS:
        false, delays, dropped = 0, [], []
        for seed in range(given.seeds):
            healthy = campaign(name, seed, None, given.hours, given.air)
            _, lost = watched(healthy, order)
            false += episodes([row for row, _ in healthy.alarms])
            damage = 30 + 15 * seed % 300
            hurt = campaign(name, 1000 + seed, damage, given.hours, given.air)
            days, more = watched(hurt, order)
            false += episodes([row for row, _ in hurt.alarms if hurt.time_s[row] < (YEAR + damage) * DAY_S])
            delays.append(min([day - damage for day in days if day >= damage], default=np.inf))
            dropped += [lost, more]
        error, std = records(name)
        print(f"{name}: σ {100 * np.nanmedian(std, axis=0)} %, missing {100 * np.mean(np.isnan(error), axis=0)} %")
        print(f"  drop {100 * drops(name)} %")
        print(
            f"  alarm after {np.median(delays):.1f} days (median), {max(delays):.1f} at most; {false} false; dropped "
            f"{100 * np.mean(dropped):.2f} % ({100 * max(dropped):.2f} at most)",
            flush=True,
        )


if __name__ == "__main__":
    main()
