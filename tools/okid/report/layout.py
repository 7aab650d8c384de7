# SPDX-License-Identifier: MIT
"""Places of the axes of a picture: room for labels, titles and keys by what is written in them, nothing drawn for it.

Rows and columns come from the grid; of each the largest need counts, what is left is shared by its ratios. A width is
0.6 of the size a letter: the reader's browser has its own font. matplotlib's constrained layout measures every label
twice, which took half of the time of a report.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.projections.polar import PolarAxes
from matplotlib.transforms import Bbox

LETTER, LINE, TICK, PAD, EDGE = 0.6, 1.25, 7.0, 4.0, 7.0  # of the size, of the size; in points
Span = tuple[float, float]


class Need(NamedTuple):
    """Room around axes in points."""

    left: float
    right: float
    bottom: float
    top: float


def _written(axis: Any) -> tuple[float, float, float, bool]:
    """Width and height of the widest tick label, half the width of the last one, and whether a factor stands apart."""
    first = axis.get_major_ticks(1)[0].label1
    if not first.get_visible() or not axis.get_visible():
        return 0.0, 0.0, 0.0, False
    low, high = sorted(axis.get_view_interval())
    formatter, size, places = (
        axis.get_major_formatter(),
        float(first.get_fontsize()),
        np.asarray(axis.get_majorticklocs()),
    )
    seen = (places >= low - 1e-9 * (high - low)) & (places <= high + 1e-9 * (high - low))
    texts = [text for text, shown in zip(formatter.format_ticks(places), seen, strict=True) if shown]
    wide = LETTER * size * max((len(text.strip("$")) for text in texts), default=0)
    upright = first.get_rotation() % 180.0 > 45.0
    last = LETTER * size * len(texts[-1]) / 2.0 if texts and not upright else size / 2.0
    high_text = LINE * size if texts and any(texts) else 0.0
    return (high_text, wide, last, False) if upright else (wide, high_text, last, bool(formatter.get_offset()))


def _named(axis: Any) -> float:
    label = axis.label
    return LINE * float(label.get_fontsize()) + axis.labelpad if label.get_text() and label.get_visible() else 0.0


def _need(ax: Axes) -> Need:
    """What labels, title and a key outside take."""
    title = LINE * float(ax.title.get_fontsize()) + 6.0 if ax.get_title() else 0.0
    if not ax.axison:
        return Need(0.0, 0.0, 0.0, title)
    if isinstance(ax, PolarAxes):
        return Need(14.0, 14.0, 8.0, title + 10.0)
    wide, _, _, factor = _written(ax.yaxis)
    _, high, last, apart = _written(ax.xaxis)
    left = _named(ax.yaxis) + wide + (TICK if wide else 0.0)
    bottom = _named(ax.xaxis) + high + (TICK if high else 0.0) + (10.0 if apart else 0.0)
    key, outside = ax.get_legend(), 0.0
    if key is not None and key.get_bbox_to_anchor() is not ax.bbox:
        own = key.get_window_extent()
        outside = max(0.0, (own.y1 - ax.bbox.y1) * 72.0 / ax.figure.dpi)
    return Need(left, last if high else 0.0, bottom, max(title, outside, 12.0 if factor else 0.0))


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


def arrange(drawing: Figure) -> None:
    """Give all axes of a grid their places."""
    placed = [ax for ax in drawing.axes if ax.get_subplotspec() is not None]
    needs, cells = [_need(ax) for ax in placed], [_cell(ax) for ax in placed]
    wide, high = (72.0 * float(x) for x in drawing.get_size_inches())
    columns = _shared([x for x, _ in cells], [n.left for n in needs], [n.right for n in needs], wide)
    rows = _shared([y for _, y in cells], [n.top for n in needs], [n.bottom for n in needs], high)
    for ax, (x, y) in zip(placed, cells, strict=True):
        left, right = columns[(round(x[0], 6), round(x[1], 6))]
        top, bottom = rows[(round(y[0], 6), round(y[1], 6))]
        low, up = round(1.0 - bottom / high, 4), round(1.0 - top / high, 4)
        ax.set_position(Bbox.from_extents(round(left / wide, 4), low, round(right / wide, 4), up))
