# SPDX-License-Identifier: MIT
"""The report of a campaign: one self-contained page with trends, charts, tables and what was left out."""

from __future__ import annotations

from collections.abc import Sequence
from datetime import UTC, datetime
from html import escape
from pathlib import Path
from typing import Any, cast

import matplotlib as mpl
import numpy as np

from okid.campaign.spec import Trend
from okid.campaign.temperature_curve import slopes
from okid.campaign.trend import SEEN, SeriesTrend, analyse, series_of
from okid.campaign.trend_pictures import draw_chart, draw_over_temperature, draw_over_time, time_axis
from okid.data.whole_file import whole_file
from okid.report import page
from okid.report.svg import Pictures
from okid.result import figures

MOST_SERIES, MOST_TRACKS, MOST_ROWS = 12, 8, 60
_TABLE_WORDS = (
    "f, σ and ζ: medians over the groups; σ is that of one group, by leaving out parts of its records, changes of "
    "temperature within the group included. Scatter: standard deviation of the training's residuals, after the "
    "regression. f per °C: of each straight piece, from the cold on. Shift: mean residual after the change less that "
    "before, ± its standard deviation."
)


def _date(seconds: float, fine: bool = True) -> str:
    return (
        f"{datetime.fromtimestamp(seconds, UTC):%Y-%m-%d %H:%M}"
        if fine
        else f"{datetime.fromtimestamp(seconds, UTC):%Y-%m-%d}"
    )


def _shown(series: SeriesTrend) -> list[Any]:
    n = max(1, len(series.groups))
    seen = [t for t in series.tracks if np.sum(np.isfinite(t.frequency_hz)) >= SEEN * n]
    return seen[:MOST_TRACKS]


def _over_time(series: SeriesTrend, pictures: Pictures, damping: bool) -> str:
    tracks = _shown(series)
    drawing = figures.figure(9.6, 1.55 * len(tracks) + 0.75)
    expected = series.expected
    for place, track in enumerate(tracks, 1):
        ax = drawing.add_subplot(len(tracks), 1, place)
        if damping:
            draw_over_time(ax, series, 100.0 * track.damping_ratio, 100.0 * track.damping_ratio_std, None, place == 1)
        else:
            watched = expected is not None and track.number in series.watched
            line = expected[:, series.watched.index(track.number)] if watched and expected is not None else None
            draw_over_time(ax, series, track.frequency_hz, track.frequency_std_hz, line, place == 1)
        time_axis(ax, series, place == len(tracks))
        ax.set_ylabel(f"ζ{place} [%]" if damping else f"f{place} [Hz]")
        if place == 1:
            ax.legend(ncols=5, loc="lower right", bbox_to_anchor=(1.0, 1.0), borderaxespad=0.1)
    what = "damping" if damping else "frequencies"
    return pictures.inline(drawing, f"{what} of the modes of {series.name} over time with one standard deviation")


def _over_temperature(series: SeriesTrend, pictures: Pictures) -> str:
    tracks = _shown(series)
    columns = min(3, len(tracks))
    rows = -(-len(tracks) // columns)
    drawing = figures.figure(9.6, 2.5 * rows + 0.5)
    for place, track in enumerate(tracks, 1):
        ax = drawing.add_subplot(rows, columns, place)
        draw_over_temperature(ax, series, track, place == 1)
        ax.set_xlabel("temperature [°C]")
        ax.set_ylabel(f"f{place} [Hz]")
    drawing.legend(*drawing.axes[0].get_legend_handles_labels(), ncols=4, loc="outside upper right")
    return pictures.inline(drawing, f"frequencies of the modes of {series.name} over temperature")


def _chart_picture(series: SeriesTrend, pictures: Pictures) -> str:
    assert series.charts is not None and series.limits is not None
    drawing = figures.figure(9.6, 4.0)
    needed = series.limits.needed
    pairs = (
        (series.charts.t2, series.limits.t2, f"T² of {needed} of {needed + 1} [-]"),
        (series.charts.mean, series.limits.mean, "EWMA T² [-]"),
    )
    for place, (values, limit, name) in enumerate(pairs, 1):
        ax = drawing.add_subplot(2, 1, place)
        draw_chart(ax, series, values, limit, place == 1)
        time_axis(ax, series, place == 2)
        ax.set_ylabel(name)
        if place == 1:
            ax.legend(ncols=3, loc="lower right", bbox_to_anchor=(1.0, 1.0), borderaxespad=0.1)
    return pictures.inline(drawing, f"control charts of {series.name} with their limits")


def _pm(value: float, std: float, digits: int = 2) -> str:
    """A number with as many digits as its deviation is worth."""
    if not np.isfinite(std) or std <= 0.0:
        return f"{value:.6g}"
    places = max(0, digits - 1 - int(np.floor(np.log10(std))))
    return f"{value:.{places}f} ± {std:.{places}f}"


def _track_table(series: SeriesTrend) -> str:
    head = ["mode", "groups", "f [Hz]", "σ [Hz]", "ζ [%]"]
    model = series.regression
    steep = slopes(model) if model is not None and len(model.coefficients) > 1 else None
    head += ["f per °C [%]"] if steep is not None else []
    head += ["scatter [Hz]"] if model is not None else []
    head += ["shift [%]"] if series.shift_hz is not None else []
    rows = []
    for place, track in enumerate(_shown(series), 1):
        good = np.isfinite(track.frequency_hz)
        middle = float(np.median(track.frequency_hz[good]))
        known = track.frequency_std_hz[np.isfinite(track.frequency_std_hz)]
        damping = track.damping_ratio[np.isfinite(track.damping_ratio)]
        row = [f"{place} (track {track.number})", str(int(np.sum(good))), f"{middle:.5g}",
               f"{np.median(known):.2g}" if len(known) else "-",
               f"{100 * np.median(damping):.3g}" if len(damping) else "-"]  # fmt: skip
        if model is not None:
            k = series.watched.index(track.number) if track.number in series.watched else None
            if steep is not None:
                pieces = [] if k is None else (100.0 / middle * np.array(steep)[:, :, k]).T.tolist()
                row.append(", ".join(_pm(*piece) for piece in pieces) or "-")
            row.append("-" if k is None else f"{np.sqrt(model.variance[k]):.2g}")
            if series.shift_hz is not None and series.shift_std_hz is not None:
                shifts = 100 / middle * series.shift_hz, 100 / middle * series.shift_std_hz
                row.append("-" if k is None else _pm(float(shifts[0][k]), float(shifts[1][k])))
        rows.append(row)
    return page.table(head, rows)


def verdict(series: SeriesTrend) -> tuple[bool, list[str]]:
    """Is all well, and the sentences that say so."""
    lines = []
    if series.alarms:
        first, which = series.alarms[0]
        lines.append(f"{series.name}: alarm since {_date(series.time_s[first])} UTC ({which})")
    elif series.charts is not None:
        watched = int(np.sum(np.isfinite(series.charts.t2)))
        lines.append(f"{series.name}: no alarm in {watched} watched groups")
    else:
        lines.append(f"{series.name}: not watched: {series.reason}")
    if series.change is not None:
        c = series.change
        low, at, high = (
            _date(series.time_s[series.rows[k]]) for k in (c.low - 1, c.at, min(c.high, len(series.rows) - 1))
        )
        lines.append(
            f"The mean changed with the group of {at} UTC (95 %: after {low}, by {high}); without a change, "
            f"a deviation this large has a probability of "
            f"{'at most ' if c.p_value <= 0.001 else ''}{c.p_value:.2g}."
        )
    return not series.alarms and series.change is None, lines


def _verdicts(all_series: Sequence[SeriesTrend]) -> str:
    out = []
    for series in all_series[:MOST_SERIES]:
        good, lines = verdict(series)
        watched = good and series.charts is not None
        body = "".join(f"<p>{escape(line)}</p>" for line in lines)
        out.append(f'<div class="verdict{"" if watched else " doubt"}">{body}</div>')
    return "\n".join(out)


def _series_section(series: SeriesTrend, pictures: Pictures, trend: Trend) -> page.Section:
    parts = []
    if not _shown(series):
        parts.append(page.absent("No mode is in half of the groups: nothing to be drawn."))
    else:
        parts += [
            _track_table(series),
            page.note(_TABLE_WORDS),
            page.heading("Frequency over time"),
            _over_time(series, pictures, False),
        ]
        hidden = len(series.tracks) - len(_shown(series))
        words = "Bars: ± σ of each group, by leaving out parts of its records. Shaded: training period."
        parts.append(page.note(words + (f" {hidden} tracks seen in fewer groups are not drawn." if hidden else "")))
        if any(np.any(np.isfinite(track.damping_ratio)) for track in series.tracks):
            parts += [page.heading("Damping over time"), _over_time(series, pictures, True)]
        if series.temperature_c is not None:
            parts += [page.heading("Frequency over temperature"), _over_temperature(series, pictures)]
        if series.charts is not None and series.limits is not None:
            parts += [
                page.heading("Control charts"),
                _chart_picture(series, pictures),
                page.note(_chart_words(series, trend)),
            ]
    parts += [page.note(remark) for remark in series.remarks]
    return page.section(f"Trend of {series.name}", *parts, name=series.name)


def _chart_words(series: SeriesTrend, trend: Trend) -> str:
    assert series.limits is not None and series.regression is not None
    nu = series.regression.tails
    tails = "Gaussian" if np.isinf(nu) else f"Student's t with {nu:g} degrees of freedom:"
    return (
        f"Limits: the probability of any alarm in a year of {series.limits.per_year} groups of a structure that does "
        f"not change is {100 * trend.false_alarm_per_year:g} %, half of it for each chart, found with "
        f"{series.limits.simulated} simulated years ({tails} residuals with the persistence of the training, refitted "
        f"on {int(np.sum(series.training))} training groups). T²: squared distance of all watched modes of a group "
        "from what its temperature lets expect, by its rank among those of the training; charted is what "
        f"{series.limits.needed} of {series.limits.needed + 1} groups in a row exceed; EWMA: the same of a weighted "
        "mean (0.2 of the newest group). Fewer outlying groups, such as bad records, are in neither."
    )


def _left_out(tables: dict[str, Any], about: dict[str, Any]) -> page.Section | None:
    records, groups = tables["records"], tables["groups"]
    skipped = records[records["status"] == "skipped"]
    faults = groups[groups["fault"].notna()]
    parts = []
    for title, table, columns in (("Records", skipped, ("record", "reason")), ("Groups", faults, ("group", "fault"))):
        if not len(table):
            continue
        rows = [[str(row[column] or "") for column in columns] for row in table.head(MOST_ROWS).to_dict("records")]
        parts += [page.heading(f"{title}: {len(table)}"), page.table(columns, rows, "words")]
        if len(table) > MOST_ROWS:
            parts.append(page.note(f"The first {MOST_ROWS} of {len(table)}; the Parquet tables have all."))
    remarks = about.get("remarks", [])
    parts += [page.note(remark) for remark in remarks[:MOST_ROWS]]
    return page.section("Left out, and remarks", *parts, name="Left out") if parts else None


def _facts(tables: dict[str, Any], about: dict[str, Any]) -> str:
    records, groups = tables["records"], tables["groups"]
    used = records[records["status"] == "summed"]
    c, i = about["channels"], about["identification"]
    return page.facts([
        ("records", f"{len(used)} summed, {len(records) - len(used)} left out"),
        ("samples", f"{int(used['samples'].sum()) if len(used) else 0:,} of {len(c['inputs']) + len(c['outputs'])} "
                    f"channels at {c['fs_hz']:g} Hz, {int(used['bytes'].sum()) / 1e6:.1f} MB"),
        ("groups", f"{len(groups)} by {', '.join(about['by']) or 'nothing'}, "
                   f"{int((groups['modes'] > 0).sum())} with modes"),
        ("method", "auto" if i["method"] == "auto" else f"{i['method']}, p {i['p']}, order {i['order'] or 'auto'}, "
                                                        f"detrend {i['detrend']}"),
        *([] if i["method"] == "auto" else [("sums", "exact integers" if c["codes"] else "double precision")]),
    ])  # fmt: skip


def build_page(
    tables: dict[str, Any], about: dict[str, Any], trend: Trend, written: str
) -> tuple[str, list[SeriesTrend]]:
    """The HTML, and the trends in it. The same tables give the same page, but for `written`."""
    all_series = series_of(tables)
    for series in all_series:
        analyse(series, trend)
    pictures = Pictures()
    with mpl.rc_context(cast(Any, figures.STYLE)):
        sections = [_series_section(one, pictures, trend) for one in all_series[:MOST_SERIES]]
    more = len(all_series) - MOST_SERIES
    first = page.section(
        "Summary", _verdicts(all_series), _facts(tables, about),
        page.note(f"{more} further series are in the tables only.") if more > 0 else "",
    )  # fmt: skip
    times = [one.time_s for one in all_series if len(one.time_s)]
    span = (
        f"{_date(min(t[0] for t in times), False)} to {_date(max(t[-1] for t in times), False)}"
        if times
        else "no groups"
    )
    subtitle = f"{len(tables['records'])} records in {len(tables['groups'])} groups, {span}"
    rest = _left_out(tables, about)
    html = page.page(about["title"], subtitle, [first, *sections, *([rest] if rest else [])], written)
    return html, all_series


def write_page(path: Path, html: str) -> None:
    """Whole or not at all. InputError when the disk refuses."""
    with whole_file(path) as part:
        part.write_text(html, encoding="utf-8")
