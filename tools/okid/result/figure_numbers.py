# SPDX-License-Identifier: MIT
"""The numbers of a picture as a table: what its curves, marks and bars were drawn from."""

from __future__ import annotations

import csv
import io
from collections.abc import Iterator, Sequence
from typing import Any
from weakref import WeakKeyDictionary

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection, PathCollection
from matplotlib.container import BarContainer
from matplotlib.figure import Figure

Row = Sequence[Any]
_STATED: WeakKeyDictionary[Axes, list[Row]] = WeakKeyDictionary()


def state_numbers(ax: Axes, rows: Sequence[Row]) -> None:
    """Say what the axes show, where curves cannot: (curve, x, y, value) of a matrix or of a map."""
    _STATED[ax] = list(rows)


def _name(label: Any, nothing: str) -> str:
    text = str(label or "")
    return nothing if text.startswith("_") or not text else " ".join(text.split())


def _rows(ax: Axes) -> Iterator[Row]:
    """(curve, x, y, value) of everything that is in the coordinates of the axes."""
    if ax in _STATED:
        yield from _STATED[ax]
        return
    for k, line in enumerate(ax.lines, 1):
        x, y = np.asarray(line.get_xdata(), dtype=np.float64), np.asarray(line.get_ydata(), dtype=np.float64)
        upright = line.get_transform() == ax.get_xaxis_transform(which="grid")
        if upright:
            yield _name(line.get_label(), f"line {k}"), float(x[0]), "", ""
        elif line.get_transform() == ax.transData:
            for a, b in zip(x.tolist(), y.tolist(), strict=True):
                yield _name(line.get_label(), f"curve {k}"), a, b, ""
    for k, one in enumerate(ax.collections, 1):
        if isinstance(one, PathCollection):
            for a, b in np.ma.filled(one.get_offsets(), np.nan).tolist():
                yield _name(one.get_label(), f"marks {k}"), a, b, ""
        elif isinstance(one, LineCollection):
            for segment in one.get_segments():
                a, b = np.asarray(segment)[-1].tolist()
                yield _name(one.get_label(), f"bars {k}"), a, b, ""
    for k, container in enumerate((c for c in ax.containers if isinstance(c, BarContainer)), 1):
        for bar in container.patches:
            yield _name(container.get_label(), f"bars {k}"), bar.get_x() + bar.get_width() / 2.0, bar.get_height(), ""


def figure_csv(drawing: Figure) -> str:
    """CSV with the columns panel (title or label of its y axis, else its number), curve, x, y, value.

    To be asked before a report gives the axes their places: that draws marks of scales as curves.
    """
    out = io.StringIO()
    writer = csv.writer(out, lineterminator="\n")
    writer.writerow(["panel", "curve", "x", "y", "value"])
    for number, ax in enumerate(drawing.axes, 1):
        panel = _name(ax.get_title() or ax.get_ylabel(), str(number))
        for row in _rows(ax):
            writer.writerow([panel, *row])
    return out.getvalue()
