# SPDX-License-Identifier: MIT
"""Places of the axes of a picture, room by what is written there, and the marks of their scales.

Rows and columns come from the grid; of each the largest need counts, what is left is shared by its ratios. A width is
0.6 of the size a letter: the reader's browser has its own font. matplotlib's constrained layout measures every label
twice and makes five artists of every mark: two thirds of the time of a report.
"""

from __future__ import annotations

from typing import Any, NamedTuple, cast

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.markers import TICKDOWN, TICKLEFT
from matplotlib.ticker import NullLocator
from matplotlib.transforms import Bbox
from numpy.typing import NDArray

LETTER, LINE, TICK, PAD, EDGE = 0.6, 1.25, 7.0, 4.0, 7.0  # of the size, of the size; in points
Span = tuple[float, float]
Real = NDArray[np.float64]


class Need(NamedTuple):
    """Room around axes in points."""

    left: float
    right: float
    bottom: float
    top: float


class Written(NamedTuple):
    """What stands at an axis: places of its marks, their texts, room of these in points, a factor common to them."""

    axis: Any
    places: Real
    texts: list[str]
    wide: float
    high: float
    factor: str


def _written(axis: Any) -> Written:
    label, formatter = axis.get_major_ticks(1)[0].label1, axis.get_major_formatter()
    if not axis.get_visible():
        return Written(axis, np.zeros(0), [], 0.0, 0.0, "")
    low, high = sorted(axis.get_view_interval())
    places, size = np.asarray(axis.get_majorticklocs(), dtype=np.float64), float(label.get_fontsize())
    seen = (places >= low - 1e-9 * (high - low)) & (places <= high + 1e-9 * (high - low))
    shown = label.get_visible()
    texts = [text for text, one in zip(formatter.format_ticks(places), seen, strict=True) if one] if shown else []
    along = LETTER * size * max((len(text) for text in texts), default=0)
    across = LINE * size if any(texts) else 0.0
    upright = label.get_rotation() % 180.0 > 45.0
    factor = str(formatter.get_offset()) if shown else ""
    return Written(axis, places[seen], texts, across if upright else along, along if upright else across, factor)


def _named(axis: Any) -> float:
    label = axis.label
    if not label.get_text() or not label.get_visible():
        return 0.0
    lines = 1 + str(label.get_text()).count("\n")
    return LINE * float(label.get_fontsize()) * lines + float(axis.labelpad)


def _need(ax: Axes, x: Written, y: Written) -> Need:
    """What labels, title and a key outside take."""
    title = LINE * float(ax.title.get_fontsize()) + 6.0 if ax.get_title() else 0.0
    if not ax.axison:
        return Need(0.0, 0.0, 0.0, title)
    last = x.wide if len(x.texts) < 2 else LETTER * float(x.axis.get_major_ticks(1)[0].label1.get_fontsize()) * 2.0
    left = _named(ax.yaxis) + y.wide + (TICK if y.wide else 0.0)
    bottom = _named(ax.xaxis) + x.high + (TICK if x.high else 0.0) + (10.0 if x.factor else 0.0)
    key, outside = ax.get_legend(), 0.0
    if key is not None and key.get_bbox_to_anchor() is not ax.bbox:
        own = key.get_window_extent()
        outside = max(0.0, (own.y1 - ax.bbox.y1) * 72.0 / ax.figure.dpi)
    half = (
        0.5 * LINE * float(y.axis.get_major_ticks(1)[0].label1.get_fontsize()) if y.texts else 0.0
    )  # of the last text
    top = max(title, outside, 12.0 if y.factor else 0.0, half)
    return Need(left, last if x.high else 0.0, max(bottom, half), top)


def _cell(ax: Axes) -> tuple[Span, Span]:
    """(x0, x1), (y0, y1) of its cell, 0 to 1 from the left and from the top, as if there were no room between cells."""
    spec = ax.get_subplotspec()
    assert spec is not None
    chain = [spec]
    while chain[-1] is not chain[-1].get_topmost_subplotspec():
        chain.append(chain[-1].get_gridspec()._subplot_spec)  # type: ignore[attr-defined]
    spans = [(0.0, 1.0), (0.0, 1.0)]
    for one in reversed(chain):
        grid = one.get_gridspec()
        sides = ((one.colspan, grid.get_width_ratios()), (one.rowspan, grid.get_height_ratios()))
        for k, (span, ratios) in enumerate(sides):
            ends = np.concatenate([[0.0], np.cumsum(ratios) / np.sum(ratios)])
            low, high = spans[k]
            spans[k] = (low + (high - low) * float(ends[span.start]), low + (high - low) * float(ends[span.stop]))
    return spans[0], spans[1]


def _shared(spans: list[Span], before: list[float], after: list[float], size: float) -> dict[Span, Span]:
    """Begin and end of the inner part of each span, of `size` points in all."""
    own = sorted({(round(a, 6), round(b, 6)) for a, b in spans})
    most = {one: [0.0, 0.0] for one in own}
    for (a, b), first, last in zip(spans, before, after, strict=True):
        one = most[(round(a, 6), round(b, 6))]
        one[:] = max(one[0], first), max(one[1], last)
    free = size - sum(sum(one) for one in most.values()) - 2.0 * EDGE - PAD * (len(own) - 1)
    share = max(free, 0.2 * size) / sum(b - a for a, b in own)
    out, at = {}, EDGE
    for a, b in own:
        begin = at + most[(a, b)][0]
        out[(a, b)] = (begin, begin + share * (b - a))
        at = out[(a, b)][1] + most[(a, b)][1] + PAD
    return out


def _mark(ax: Axes, one: Written, room: float) -> None:
    """Net, marks and texts of an axis as a few artists: matplotlib makes five of every mark. `room` of the texts."""
    axis, x = one.axis, one.axis is ax.xaxis
    first = axis.get_major_ticks(1)[0]
    label, nought = first.label1, np.zeros(len(one.places))
    along = ax.get_xaxis_transform() if x else ax.get_yaxis_transform()
    texts_at, va, ha = ax.get_xaxis_text1_transform(TICK) if x else ax.get_yaxis_text1_transform(TICK)
    if first.gridline.get_visible():
        draw = ax.vlines if x else ax.hlines
        net = first.gridline
        draw(one.places, 0.0, 1.0, transform=along, color=net.get_color(), lw=net.get_linewidth(), zorder=0.5)
    mark, sign = first.tick1line, (TICKDOWN if x else TICKLEFT)
    both = (one.places, nought) if x else (nought, one.places)
    if mark.get_visible() and len(one.places):
        ax.add_artist(Line2D(*both, ls="", marker=cast(Any, sign), ms=mark.get_markersize(), mew=0.8,
                             color=mark.get_color(), transform=along, clip_on=False))  # fmt: skip
    turned = label.get_rotation() != 0.0
    how = {
        "ha": label.get_ha() if turned else ha, "va": label.get_va() if turned else va, "color": label.get_color(),
        "rotation": label.get_rotation(), "rotation_mode": label.get_rotation_mode(), "fontsize": label.get_fontsize(),
    }  # fmt: skip
    for at, text in zip(one.places, one.texts, strict=False):
        ax.text(at if x else 0.0, 0.0 if x else at, text, transform=texts_at, **how)
    if one.factor:
        ax.annotate(one.factor, (1.0, 0.0) if x else (0.0, 1.0), (0.0, -room - TICK) if x else (0.0, 2.0),
                    "axes fraction", "offset points", ha="right" if x else "left", va="top" if x else "bottom",
                    fontsize=label.get_fontsize(), color=label.get_color())  # fmt: skip
    axis.labelpad += room + TICK if room else 0.0


def arrange(drawing: Figure) -> None:
    """Give all axes of a grid their places, and draw what stands at them."""
    placed = [ax for ax in drawing.axes if ax.get_subplotspec() is not None]
    written = [(_written(ax.xaxis), _written(ax.yaxis)) for ax in placed]
    needs, cells = [_need(ax, *both) for ax, both in zip(placed, written, strict=True)], [_cell(ax) for ax in placed]
    wide, high = (72.0 * float(x) for x in drawing.get_size_inches())
    rooms: dict[Span, float] = {}  # names of the axes of a column stand in line, left of the widest text
    for (x, _), (_, own) in zip(cells, written, strict=True):
        rooms[x] = max(rooms.get(x, 0.0), own.wide)
    needs = [
        n._replace(left=max(n.left, _named(ax.yaxis) + rooms[x] + TICK)) if ax.axison and _named(ax.yaxis) else n
        for ax, n, (x, _) in zip(placed, needs, cells, strict=True)
    ]
    columns = _shared([x for x, _ in cells], [n.left for n in needs], [n.right for n in needs], wide)
    rows = _shared([y for _, y in cells], [n.top for n in needs], [n.bottom for n in needs], high)
    for ax, (x, y) in zip(placed, cells, strict=True):
        left, right = columns[(round(x[0], 6), round(x[1], 6))]
        top, bottom = rows[(round(y[0], 6), round(y[1], 6))]
        low, up = round(1.0 - bottom / high, 4), round(1.0 - top / high, 4)
        ax.set_position(Bbox.from_extents(round(left / wide, 4), low, round(right / wide, 4), up))
    for ax, (across, up_it), (x, _) in zip(placed, written, cells, strict=True):
        if not ax.axison:
            continue
        ax.autoscale(False)
        _mark(ax, across, across.high)
        _mark(ax, up_it, rooms[x])
    for ax in placed:  # at the end: axes that share one share its places
        for axis in (ax.xaxis, ax.yaxis):
            axis.set_major_locator(NullLocator())
            axis.get_offset_text().set_visible(False)  # of dates it stays without marks, too
