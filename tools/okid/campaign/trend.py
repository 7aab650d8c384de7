# SPDX-License-Identifier: MIT
"""The trend of one series: tracks over time and temperature, what temperature explains, alarms, the change."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from okid.campaign import trend_model
from okid.campaign.change_point import ChangePoint, find_change
from okid.campaign.control_chart import Charts, Limits, Ranks, bounded, charts, groups_needed, limits
from okid.campaign.spec import Trend
from okid.campaign.temperature_curve import LEAST, Curve, find_curve
from okid.campaign.trend_model import Flags, Regression

Real = NDArray[np.float64]
SEEN = 0.5  # share of the groups a mode must be in to be drawn
WATCHED = 0.5  # share of the training groups it must be in to be watched
BLURRED = 5.0  # times the usual sigma: such a value is not used
_YEAR_S = 365.25 * 86400.0
_NAMED = 5
_SURE = 0.01  # probability without a change below which a change point is reported


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

    `watched`: numbers of the tracks in the charts; `rows`: groups in which any of them was found; `training`: flags of
    those rows. Charts, regression and change are None with the `reason`, also in `remarks`.
    """

    name: str
    groups: list[str]
    time_s: Real
    temperature_c: Real | None
    tracks: list[Track]
    watched: list[int] = field(default_factory=list)
    rows: NDArray[np.intp] = field(default_factory=lambda: np.zeros(0, dtype=np.intp))
    training: NDArray[np.bool_] = field(default_factory=lambda: np.zeros(0, dtype=np.bool_))
    curve: Curve = Curve(0.0, None)
    regression: Regression | None = None
    charts: Charts | None = None
    limits: Limits | None = None
    change: ChangePoint | None = None
    alarms: list[tuple[int, str]] = field(default_factory=list)
    odd: list[int] = field(default_factory=list)
    shift_hz: Real | None = None
    shift_std_hz: Real | None = None
    remarks: list[str] = field(default_factory=list)
    reason: str = ""

    def not_watched(self, why: str) -> None:
        """Tell why there are no charts."""
        self.reason = why
        self.remarks.append(f"{why}: no charts")

    @property
    def expected(self) -> Real | None:
        """Frequencies (n, d) of the watched tracks that the regression expects, NaN without a temperature."""
        if self.regression is None:
            return None
        return np.asarray(self.curve.regressors(self.temperature_c, len(self.time_s)) @ self.regression.coefficients)


def series_of(tables: dict[str, Any]) -> list[SeriesTrend]:
    """The series of the tables with their tracks, those first that have most groups."""
    out = _series(tables["groups"], tables["modes"])
    shifts = tables.get("shifts")
    if shifts is not None and len(shifts):
        out += _series(shifts.drop_duplicates(["series", "group"]), shifts)
    return sorted(out, key=lambda one: (-len(one.groups), one.name))


def _series(groups: Any, modes: Any) -> list[SeriesTrend]:
    out = []
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
    return out


def _weight(track: Track) -> Real:
    """Of each group: 1, less where σ is above the usual one, 0 where the mode is missing or blurred."""
    std = track.frequency_std_hz
    known = std[np.isfinite(std)]
    usual = float(np.median(known)) if len(known) else np.inf
    times = np.nan_to_num(std / usual, nan=1.0, posinf=np.inf)
    return np.where(np.isfinite(track.frequency_hz) & (times <= BLURRED), 1.0 / np.maximum(1.0, times), 0.0)


def in_training(time_s: Real, spec: Trend) -> NDArray[np.bool_]:
    """Which groups, in time order, are of the training period."""
    n = len(time_s)
    end = (
        spec.training_until.timestamp() if spec.training_until is not None
        else time_s[min(n - 1, max(1, round(spec.training_share * n)))] if n else 0.0
    )  # fmt: skip
    return np.asarray(time_s < end)


def _choose(series: SeriesTrend, spec: Trend) -> tuple[Real, Real, Real] | None:
    """Frequencies, weights (n, d), regressors (n, k) of the tracks and groups that are watched; None says why not."""
    n = len(series.groups)
    first = in_training(series.time_s, spec)
    t = series.temperature_c
    warm = np.ones(n, dtype=np.bool_) if t is None else np.isfinite(t)
    training = first & warm
    if not np.any(training):
        series.not_watched("no group in the training period")
        return None
    spread = 0.0 if t is None else float(np.ptp(t[training]))
    order = spec.temperature_order if spread > 0.0 else 0
    need, there = 2 + LEAST * (1 if order == "auto" else max(int(order), 1)), int(np.sum(training))
    if there < need:
        series.not_watched(f"{there} training groups, {need} are needed")
        return None
    weights = {track.number: _weight(track) for track in series.tracks}
    seen = {number: int(np.sum(weight[training] > 0)) for number, weight in weights.items()}
    chosen = [t for t in series.tracks if seen[t.number] >= max(need, WATCHED * there)]
    if not chosen:
        best = max(seen.values(), default=0)
        series.not_watched(
            f"no mode is in half of the training groups ({there}), and in {need}: the best one is in {best}"
        )
        return None
    series.watched = [t.number for t in chosen]
    weight = np.column_stack([weights[number] for number in series.watched])
    series.rows = np.flatnonzero(warm & np.any(weight > 0, axis=1))
    series.training = first[series.rows]
    _tell_missing(series, n, weight, {t.number: seen[t.number] for t in series.tracks if t not in chosen}, there)
    y, weight = np.column_stack([track.frequency_hz for track in chosen])[series.rows], weight[series.rows]
    if t is None or order == 0:
        return y, weight, series.curve.regressors(None, len(y))
    _find_curve(series, order, y[series.training], t[series.rows][series.training], weight[series.training])
    return y, weight, series.curve.regressors(t[series.rows], len(y))


def _find_curve(series: SeriesTrend, order: int | str, y: Real, temperature: Real, weight: Real) -> None:
    """The curve over temperature of the training; a remark when a line, or the order that is asked for, fits badly."""
    series.curve, gain = best, _ = find_curve(y, temperature, weight)
    used = "used"
    if order != "auto":
        series.curve = find_curve(y, temperature, weight, int(order) - 1)[0]
        used = 'taken with temperature_order = "auto"'
    if len(best.bends or ()) > (0 if order == "auto" else len(series.curve.bends or ())):
        places = " and ".join(f"{bend:.1f}" for bend in best.bends or ())
        series.remarks.append(
            f"lack of fit: about a line over temperature the scatter is {gain:.1f} times as large as about one with "
            f"bends at {places} °C, which is {used}"
        )


def _tell_missing(series: SeriesTrend, n: int, weight: Real, others: dict[int, int], there: int) -> None:
    if left_out := n - len(series.rows):
        series.remarks.append(f"{left_out} of {n} groups have no watched mode or no temperature: not in the charts")
    if part := int(np.sum(np.any(weight[series.rows] == 0, axis=1))):
        series.remarks.append(
            f"{part} of {n} groups lack one of the watched modes, or its σ is more than {BLURRED:g} times the usual: "
            "judged by the others"
        )
    middle = {track.number: float(np.nanmedian(track.frequency_hz)) for track in series.tracks}
    for number, count in others.items():
        if count >= 0.2 * there:
            series.remarks.append(f"{middle[number]:.4g} Hz is in {count} of {there} training groups: not watched")


def _clean(series: SeriesTrend, y: Real, X: Real, weight: Real) -> tuple[Real, int]:
    """Weights (n, d) for a scatter that follows the temperature, and none for accidents of the training, in place.

    Returns the usual spread (d,) of the training and how many of its groups have an accident.
    """
    flags = series.training
    usual, left = trend_model.usual_spread(y[flags], X[flags], weight[flags])
    if X.shape[1] > 1:
        warm = X[:, 1]
        slope = trend_model.scatter_slope(left, usual, warm[flags])
        if np.any(slope):
            weight *= np.exp(-slope * np.clip(warm, np.min(warm[flags]), np.max(warm[flags]))[:, None])
            usual, left = trend_model.usual_spread(y[flags], X[flags], weight[flags])
            most = slope[np.argmax(np.abs(slope))]
            series.remarks.append(
                f"the scatter in the training follows the temperature ({100.0 * np.expm1(most):+.0f} % in 10 °C): "
                "the weights allow for it"
            )
    far = trend_model.far(left, usual)
    if np.any(far):
        weight[flags] *= ~far
        count = int(np.sum(far))
        series.remarks.append(f"{count} values of the training lie far from the others of their mode: not used")
    return usual, int(np.sum(np.any(far, axis=1)))


def analyse(series: SeriesTrend, spec: Trend) -> None:
    """Regression, charts, alarms and change of one series, written into it. Deterministic for a given `spec.seed`."""
    found = _choose(series, spec)
    if found is None:
        return
    y, weight, X = found
    flags = series.training
    usual, wrong = _clean(series, y, X, weight)
    model = trend_model.fit(y[flags], X[flags], weight[flags])
    series.regression = model
    if np.any(model.variance <= 0.0):
        series.not_watched("a mode does not move at all in the training")
        return
    fitted = trend_model.standardised(y[flags], X[flags], model, weight[flags], fitted=True)
    left = weight * (np.where(weight > 0, y, 0.0) - X @ model.coefficients)
    far = np.any(trend_model.far(left, usual), axis=1)
    ranks = Ranks(fitted[np.any(weight[flags] > 0, axis=1)])
    scored = ranks.scored(trend_model.standardised(y, X, model, weight))
    _charts(series, spec, scored, X, weight, far, wrong)
    if series.charts is not None:
        weight[series.charts.alone] = 0.0
        scored[series.charts.alone] = 0.0
    change = find_change(bounded(scored), flags, X, weight, model, spec.seed)
    if change is not None and change.p_value <= _SURE:
        series.change = change
        _measure_shift(series, y, X, weight, usual)
    _remarks(series, model)


def _measure_shift(series: SeriesTrend, y: Real, X: Real, weight: Real, usual: Real) -> None:
    """Means of the residuals after the change less those before, without accidents on either side."""
    assert series.regression is not None and series.change is not None
    model, at = series.regression, series.change.at
    raw = np.where(weight > 0, y, np.nan) - X @ model.coefficients
    for side in (slice(None, at), slice(at, None)):
        for k in np.flatnonzero(np.any(np.isfinite(raw[side]), axis=0)):
            own = raw[side, k]
            own[trend_model.far(weight[side, k] * (own - np.nanmedian(own)), usual[k])] = np.nan
    seen = np.isfinite(raw)
    before, after = seen[:at].sum(axis=0), seen[at:].sum(axis=0)
    inflation = (1.0 + model.persistence) / (1.0 - model.persistence)  # of the variance of a mean
    series.shift_hz, series.shift_std_hz = np.full((2, y.shape[1]), np.nan)
    for k in np.flatnonzero((before > 0) & (after > 0)):
        series.shift_hz[k] = np.nanmean(raw[at:, k]) - np.nanmean(raw[:at, k])
        series.shift_std_hz[k] = np.sqrt(model.variance[k] * inflation[k] * (1.0 / before[k] + 1.0 / after[k]))


def _charts(
    series: SeriesTrend, spec: Trend, scored: Real, X: Real, weight: Real, far: Flags, wrong: int,
) -> None:  # fmt: skip
    watched = ~series.training
    if not np.any(watched):
        series.not_watched("no group after the training period")
        return
    assert series.regression is not None
    spacing = float(np.median(np.diff(series.time_s[series.rows])))
    per_year = round(_YEAR_S / spacing) if spacing > 0.0 else len(scored)
    sides = [(X[rows], weight[rows]) for rows in (~watched, watched)]
    rate = spec.false_alarm_per_year
    needed = groups_needed(wrong, len(sides[0][0]), per_year, rate)
    series.limits = limits(sides[0], sides[1], series.regression, per_year, rate, needed, spec.seed)
    found = charts(scored[watched], far[watched], needed)
    (t2, mean), alone = np.full((2, len(scored)), np.nan), np.zeros(len(scored), dtype=np.bool_)
    t2[watched], mean[watched], alone[watched] = found
    series.charts = Charts(t2, mean, alone)
    series.odd = [int(row) for row in series.rows[alone]]
    for k in np.flatnonzero(watched):
        said = [name for name, value, limit in (("T²", t2[k], series.limits.t2), ("EWMA", mean[k], series.limits.mean))
                if value > limit]  # fmt: skip
        if said:
            series.alarms.append((int(series.rows[k]), " and ".join(said)))
    if series.odd:
        named = ", ".join(series.groups[row] for row in series.odd[:_NAMED])
        more = f" and {len(series.odd) - _NAMED} more" if len(series.odd) > _NAMED else ""
        series.remarks.append(f"far from the others, but not followed by others like it: {named}{more}")


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
