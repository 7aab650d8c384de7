# SPDX-License-Identifier: MIT
"""Pictures of a trend: modes over time and temperature, control charts; drawn into axes that the caller owns."""

from __future__ import annotations

from datetime import UTC

import numpy as np
from matplotlib.axes import Axes
from matplotlib.dates import AutoDateLocator, ConciseDateFormatter
from numpy.typing import NDArray

from okid.campaign.trend import SeriesTrend, Track
from okid.campaign.trend_model import leverage
from okid.result.figures import BLUE, FAINT, GREEN, GREY, ORANGE, RED, log_axis

Real = NDArray[np.float64]
MOST_POINTS = 1500  # of a picture; more are thinned out


def moments(time_s: Real) -> Real:
    """Times as matplotlib has them: days since 1970."""
    return np.asarray(time_s / 86400.0)


def thinned(count: int) -> NDArray[np.intp]:
    """At most MOST_POINTS of so many, evenly, first and last kept."""
    if count <= MOST_POINTS:
        return np.arange(count)
    return np.linspace(0, count - 1, MOST_POINTS).round().astype(np.intp)


def time_axis(ax: Axes, series: SeriesTrend, label: bool) -> None:
    """Dates below, and the training period shaded."""
    locator = AutoDateLocator(minticks=4, maxticks=9)  # type: ignore[no-untyped-call]
    ax.xaxis.set_major_locator(locator)
    formatter = ConciseDateFormatter(locator, tz=UTC, show_offset=label)  # type: ignore[no-untyped-call]
    ax.xaxis.set_major_formatter(formatter)
    begin, end = moments(series.time_s[[0, -1]]).tolist()
    if begin < end:
        ax.set_xlim(begin, end)
    if np.any(series.training):
        last = float(moments(series.time_s[series.rows[series.training]])[-1])
        ax.axvspan(begin, last, color=GREY, alpha=0.10, lw=0)
    ax.tick_params(labelbottom=label)
    if label:
        ax.set_xlabel("time (UTC)")


def mark_events(ax: Axes, series: SeriesTrend, named: bool) -> None:
    """The first alarm, and the change with its 95 % interval."""
    if series.change is not None:
        at = series.rows[[series.change.low - 1, series.change.at, min(series.change.high, len(series.rows) - 1)]]
        low, middle, high = moments(series.time_s[at]).tolist()
        ax.axvspan(low, high, color=ORANGE, alpha=0.18, lw=0)
        ax.axvline(middle, color=ORANGE, lw=1.1, ls="--", label="change point" if named else None)
    if series.alarms:
        first = float(moments(series.time_s)[series.alarms[0][0]])
        ax.axvline(first, color=RED, lw=1.1, label="first alarm" if named else None)


def draw_over_time(ax: Axes, series: SeriesTrend, value: Real, std: Real, expected: Real | None, named: bool) -> None:
    """One quantity of one mode with its ± σ bars and what the temperature lets expect."""
    shown = thinned(len(value))
    time = moments(series.time_s[shown])
    v, s = value[shown], np.nan_to_num(std[shown])
    many = len(shown) > 200
    ax.vlines(time, v - s, v + s, color=BLUE, alpha=0.35, lw=0.8 if many else 1.4, label="± σ" if named else "_")
    ax.plot(time, v, ls="", marker=".", ms=2.2 if many else 4.0, color=BLUE)
    if expected is not None:
        ax.plot(time, expected[shown], color=GREEN, lw=0.9, label="expected from temperature" if named else None)
    mark_events(ax, series, named)
    ax.locator_params(axis="y", nbins=4)
    ax.ticklabel_format(axis="y", useOffset=False, style="plain")
    _inside(ax, v, s)


def _inside(ax: Axes, value: Real, std: Real) -> None:
    """Limits that wild single values do not spoil: the middle 99 %, with room."""
    good = np.isfinite(value)
    if not np.any(good):
        return
    low, high = np.quantile(value[good], [0.005, 0.995])
    typical = float(np.median(std[good]))
    room = max(0.15 * (high - low), 2.0 * typical, 1e-9 * abs(high))
    ax.set_ylim(low - room, high + room)


def draw_over_temperature(ax: Axes, series: SeriesTrend, track: Track, named: bool) -> None:
    """Frequency over temperature: training, later, after the change; the fitted curve with ± 2 σ of a new group."""
    assert series.temperature_c is not None
    t, f = series.temperature_c, track.frequency_hz
    training = np.zeros(len(f), dtype=np.bool_)
    training[series.rows[series.training]] = True
    changed = np.zeros(len(f), dtype=np.bool_)
    if series.change is not None:
        changed[series.rows[series.change.at] :] = True
    for flags, colour, name in (
        (training, GREY, "training"), (~training & ~changed, BLUE, "later"), (changed, ORANGE, "after the change"),
    ):  # fmt: skip
        own = np.flatnonzero(flags & np.isfinite(f) & np.isfinite(t))
        own = own[thinned(len(own))] if len(own) else own
        if len(own):
            ax.plot(t[own], f[own], ls="", marker=".", ms=3.2, color=colour, label=name if named else None)
    model = series.regression
    if model is not None and track.number in series.watched:
        column = series.watched.index(track.number)
        line = np.linspace(float(np.nanmin(t)), float(np.nanmax(t)), 60)
        X = series.curve.regressors(line, len(line))
        middle = X @ model.coefficients[:, column]
        lever = leverage(X, model, np.ones((len(X), len(model.variance))))[:, column]
        width = 2.0 * np.sqrt(model.variance[column] * (1.0 + lever))
        ax.fill_between(
            line, middle - width, middle + width, color=GREEN, alpha=0.22, lw=0, label="fit ± 2 σ" if named else None
        )
        ax.plot(line, middle, color=GREEN, lw=1.0)
    ax.locator_params(axis="y", nbins=4)
    ax.ticklabel_format(axis="y", useOffset=False, style="plain")


def draw_chart(ax: Axes, series: SeriesTrend, values: Real, limit: float, named: bool) -> None:
    """One control chart on a log scale; of many groups the largest of each stretch is shown, so that no alarm hides."""
    own = np.flatnonzero(np.isfinite(values))
    cuts = np.array_split(own, min(len(own), MOST_POINTS))
    top = np.array([part[np.argmax(values[part])] for part in cuts if len(part)], dtype=np.intp)
    time = moments(series.time_s[series.rows[top]])
    shown = np.maximum(values[top], 1e-3)
    above = values[top] > limit
    ax.semilogy(time, shown, color=FAINT, lw=0.7)
    ax.semilogy(time[~above], shown[~above], ls="", marker=".", ms=3.0, color=BLUE)
    if np.any(above):
        ax.semilogy(time[above], shown[above], ls="", marker="o", ms=2.6, color=RED, label="alarm" if named else None)
    ax.axhline(limit, color=RED, lw=1.0, ls="--", label="limit" if named else None)
    mark_events(ax, series, False)
    ax.set_ylim(max(1e-3, 0.5 * float(np.min(shown))), 2.5 * max(limit, float(np.max(shown))))
    log_axis(ax)
