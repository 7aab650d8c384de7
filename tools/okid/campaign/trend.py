# SPDX-License-Identifier: MIT
"""The trend of one series: tracks over time and temperature, what temperature explains, alarms, the change."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from okid.campaign import trend_model
from okid.campaign.change_point import ChangePoint, find_change
from okid.campaign.control_chart import Charts, Limits, charts, limits
from okid.campaign.spec import Trend
from okid.campaign.trend_model import Regression, design

Real = NDArray[np.float64]
SEEN = 0.5  # share of the groups a mode must be in to be drawn
WATCHED = 0.8  # share of the training groups it must be in to be watched
BLURRED = 5.0  # times the usual sigma: such a group is not watched
_YEAR_S = 365.25 * 86400.0
_SURE = 0.01  # probability without a change below which a change point is told
_SPARE = 20  # training groups beyond the numbers that are fitted


@dataclass
class Track:
    """One mode over the groups of a series (n,): NaN where it was not found."""

    number: int
    frequency_hz: Real
    frequency_std_hz: Real
    damping_ratio: Real
    damping_ratio_std: Real


@dataclass
class SeriesTrend:
    """Everything the page shows of one series. Times s since 1970 (n,), temperatures (n,) or None, in time order.

    `watched`: numbers of the tracks in the charts; `rows`: groups in which all of them were found; `training`: flags of
    those rows. Charts, regression and change are None with the reason in `remarks`.
    """

    name: str
    groups: list[str]
    time_s: Real
    temperature_c: Real | None
    tracks: list[Track]
    watched: list[int] = field(default_factory=list)
    rows: NDArray[np.intp] = field(default_factory=lambda: np.zeros(0, dtype=np.intp))
    training: NDArray[np.bool_] = field(default_factory=lambda: np.zeros(0, dtype=np.bool_))
    regression: Regression | None = None
    charts: Charts | None = None
    limits: Limits | None = None
    change: ChangePoint | None = None
    alarms: list[tuple[int, str]] = field(default_factory=list)
    shift_hz: Real | None = None
    shift_std_hz: Real | None = None
    remarks: list[str] = field(default_factory=list)

    @property
    def expected(self) -> Real | None:
        """Frequencies (n, d) of the watched tracks that the regression expects, NaN without a temperature."""
        if self.regression is None:
            return None
        k = len(self.regression.coefficients)
        X = design(self.temperature_c, self.regression.centre_c, k - 1, len(self.time_s))
        return np.asarray(X @ self.regression.coefficients)


def series_of(tables: dict[str, Any]) -> list[SeriesTrend]:
    """The series of the tables with their tracks, those first that have most groups."""
    out = []
    groups, modes = tables["groups"], tables["modes"]
    for name, own in groups[groups["time"].notna()].groupby("series", sort=True):
        own = own.sort_values(["time", "group"])
        names = own["group"].tolist()
        place = {group: k for k, group in enumerate(names)}
        seconds = own["time"].astype("datetime64[ns, UTC]").astype("int64").to_numpy() / 1e9
        celsius = own["temperature_c"].to_numpy(dtype=np.float64)
        followed = modes[(modes["series"] == name) & modes["track"].notna()] if len(modes) else modes
        tracks = []
        for number, one in followed.groupby("track") if len(followed) else []:
            track = Track(int(number), *(np.full(len(names), np.nan) for _ in range(4)))
            at = [place[group] for group in one["group"]]
            for column in ("frequency_hz", "frequency_std_hz", "damping_ratio", "damping_ratio_std"):
                getattr(track, column)[at] = one[column].to_numpy(dtype=np.float64)
            tracks.append(track)
        tracks.sort(key=lambda track: float(np.nanmedian(track.frequency_hz)))
        known = celsius if np.any(np.isfinite(celsius)) else None
        out.append(SeriesTrend(str(name), names, seconds, known, tracks))
    return sorted(out, key=lambda one: (-len(one.groups), one.name))


def _sharp(track: Track) -> NDArray[np.bool_]:
    """Groups in which the mode was found, with a σ not far above the usual one: chosen by precision alone."""
    std = track.frequency_std_hz
    known = std[np.isfinite(std)]
    usual = float(np.median(known)) if len(known) else np.inf
    return np.isfinite(track.frequency_hz) & ~(std > BLURRED * usual)


def _choose(series: SeriesTrend, spec: Trend) -> bool:
    """Tracks and groups that are watched; False with a remark when there are too few."""
    n = len(series.groups)
    first = series.time_s < (
        spec.training_until.timestamp() if spec.training_until is not None
        else series.time_s[min(n - 1, max(1, round(spec.training_share * n)))] if n else 0.0
    )  # fmt: skip
    warm = np.ones(n, dtype=np.bool_) if series.temperature_c is None else np.isfinite(series.temperature_c)
    if not np.any(first & warm):
        series.remarks.append("no group in the training period: no regression, no charts")
        return False
    chosen = [t for t in series.tracks if np.mean(np.isfinite(t.frequency_hz[first & warm])) >= WATCHED]
    if not chosen:
        series.remarks.append("no mode is in 80 % of the training groups: no regression, no charts")
        return False
    whole = warm & np.all([_sharp(t) for t in chosen], axis=0)
    series.watched = [t.number for t in chosen]
    series.rows = np.flatnonzero(whole)
    series.training = first[series.rows]
    left_out = int(np.sum(~whole))
    if left_out:
        series.remarks.append(
            f"{left_out} of {n} groups lack a watched mode, a temperature or a sharp σ: not in the charts"
        )
    return True


def _fit(series: SeriesTrend, y: Real, order: int) -> tuple[Regression, Real] | None:
    """Regression of the training rows, and the regressors of all rows."""
    flags, t = series.training, series.temperature_c
    own = None if t is None else t[series.rows]
    spread = 0.0 if own is None else float(np.ptp(own[flags])) if np.any(flags) else 0.0
    order = order if spread > 0.0 else 0
    need = order + 1 + y.shape[1] + _SPARE
    if int(np.sum(flags)) < need:
        series.remarks.append(f"{int(np.sum(flags))} training groups, {need} are needed: no regression, no charts")
        return None
    centre = 0.0 if own is None else float(np.mean(own[flags]))
    X = design(own if order else None, centre, order, len(y))
    return trend_model.fit(y[flags], X[flags], centre), X


def analyse(series: SeriesTrend, spec: Trend) -> None:
    """Regression, charts, alarms and change of one series, written into it. Deterministic for a given `spec.seed`."""
    if not _choose(series, spec):
        return
    chosen = [t for t in series.tracks if t.number in series.watched]
    y = np.column_stack([t.frequency_hz[series.rows] for t in chosen])
    fitted = _fit(series, y, spec.temperature_order)
    if fitted is None:
        return
    model, X = fitted
    series.regression = model
    if np.any(np.diag(model.covariance) <= 0.0):
        series.remarks.append("a mode does not move at all in the training: no charts")
        return
    white = trend_model.standardised(y, X, model)
    flags = series.training
    watched = ~flags
    _charts(series, spec, white, X, watched)
    change = find_change(white, flags, X, model.persistence, spec.seed)
    if change is not None and change.p_value <= _SURE:
        series.change = change
        raw = y - X @ model.coefficients
        before, after = raw[: change.at], raw[change.at :]
        series.shift_hz = after.mean(axis=0) - before.mean(axis=0)
        inflation = (1.0 + model.persistence) / (1.0 - model.persistence)  # of the variance of a mean
        variance = np.diag(model.covariance) * inflation * (1.0 / len(before) + 1.0 / len(after))
        series.shift_std_hz = np.sqrt(variance)
    _remarks(series, model)


def _charts(series: SeriesTrend, spec: Trend, white: Real, X: Real, watched: NDArray[np.bool_]) -> None:
    if not np.any(watched):
        series.remarks.append("no group after the training period: nothing to be watched yet")
        return
    assert series.regression is not None
    spacing = float(np.median(np.diff(series.time_s[series.rows])))
    per_year = round(_YEAR_S / spacing) if spacing > 0.0 else len(white)
    series.limits = limits(X[~watched], X[watched], series.regression, per_year, spec.false_alarm_per_year, spec.seed)
    found = charts(white[watched])
    t2, mean = np.full(len(white), np.nan), np.full(len(white), np.nan)
    t2[watched], mean[watched] = found
    series.charts = Charts(t2, mean)
    for k in np.flatnonzero(watched):
        said = [name for name, value, limit in (("T²", t2[k], series.limits.t2), ("EWMA", mean[k], series.limits.mean))
                if value > limit]  # fmt: skip
        if said:
            series.alarms.append((int(series.rows[k]), " and ".join(said)))


def _remarks(series: SeriesTrend, model: Regression) -> None:
    n = model.freedom + len(model.coefficients)
    if np.any(model.lag1 > 2.0 / np.sqrt(n)):
        strongest = float(np.max(model.lag1))
        series.remarks.append(
            f"residuals of the training are correlated from group to group (up to {strongest:.2f}): "
            "the limits allow for it"
        )
    t = series.temperature_c
    if t is not None and len(model.coefficients) > 1:
        own, flags = t[series.rows], series.training
        low, high = float(np.min(own[flags])), float(np.max(own[flags]))
        outside = float(np.mean((own[~flags] < low - 1.0) | (own[~flags] > high + 1.0))) if np.any(~flags) else 0.0
        if outside > 0.0:
            series.remarks.append(
                f"{100.0 * outside:.0f} % of the watched groups are more than 1 °C outside of the "
                f"training's temperatures ({low:.1f} to {high:.1f} °C): the curve is only continued there, "
                "the stated rate does not hold"
            )
