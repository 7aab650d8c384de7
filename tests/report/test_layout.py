# SPDX-License-Identifier: MIT
"""Places of axes: what matplotlib measures of the finished picture lies inside it, and no axes reach into others.

The widths that arrange() assumes are not used here: the judge is the extent of the texts in the font of matplotlib.
"""

from __future__ import annotations

import io
from typing import Any, cast

import matplotlib
import numpy as np
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.backends.backend_svg import FigureCanvasSVG
from matplotlib.dates import AutoDateLocator, ConciseDateFormatter
from matplotlib.figure import Figure
from okid.report.layout import arrange
from okid.result import figures

SLACK = 4.0  # points: a font may be wider than 0.6 of its size a letter


def boxes(drawing: Figure) -> list[Any]:
    """Tight boxes in points."""
    renderer = FigureCanvasAgg(drawing).get_renderer()
    return [ax.get_tightbbox(renderer).transformed(drawing.dpi_scale_trans.inverted()) for ax in drawing.axes]


def check(drawing: Figure) -> None:
    found, slack = boxes(drawing), SLACK / 72.0
    width, height = drawing.get_size_inches()
    for k, one in enumerate(found):
        assert one.x0 > -slack and one.y0 > -slack and one.x1 < width + slack and one.y1 < height + slack, (k, one)
        for other in found[:k]:
            across = min(one.x1, other.x1) - max(one.x0, other.x0)
            up = min(one.y1, other.y1) - max(one.y0, other.y0)
            assert min(across, up) < slack, (one, other)


@pytest.mark.parametrize("scale", [1.0, 1e-9, 3e7])
def test_numbers_of_any_size_stand_apart(scale: float) -> None:
    with matplotlib.rc_context(cast(Any, figures.STYLE)):
        drawing = figures.figure(9.6, 5.0)
        for place in range(1, 5):
            ax = drawing.add_subplot(2, 2, place)
            ax.plot(np.arange(50), scale * np.sin(np.arange(50)))
            ax.set_xlabel("lag [samples]")
            ax.set_ylabel("acceleration [m/s²]")
            ax.set_title(f"residual of output {place}")
        arrange(drawing)
        check(drawing)
        texts = {text.get_text() for ax in drawing.axes for text in ax.texts}
        assert {"0", "20", "40"} <= texts
        assert (scale == 1.0) == (not any(text.startswith("1e") for text in texts))


def test_a_name_of_two_lines_and_a_narrow_axis_in_one_column() -> None:
    with matplotlib.rc_context(cast(Any, figures.STYLE)):
        drawing = figures.figure(9.6, 6.0)
        for place, (top, name) in enumerate([(1.0, "a sensor below\n[mm/s²]"), (1e5, "error"), (1.0, "")]):
            ax = drawing.add_subplot(3, 1, place + 1)
            ax.set_ylim(0.0, top)  # its last mark stands at the end of the axis
            ax.set_ylabel(name)
        arrange(drawing)
        check(drawing)


def test_upright_names_a_key_above_and_axes_one_above_the_other() -> None:
    with matplotlib.rc_context(cast(Any, figures.STYLE)):
        names = [f"tower level {k} north" for k in range(10)]
        drawing = figures.figure(6.0, 3.0)
        figures.draw_fit(drawing.add_subplot(), names, [90.0] * 10, [95.0] * 10)
        arrange(drawing)
        check(drawing)
        assert {text.get_text() for text in drawing.axes[0].texts} >= {figures.short(name) for name in names}
        drawing = figures.figure(9.6, 4.0)
        grid = drawing.add_gridspec(1, 2)
        for column in range(2):
            cells = grid[0, column].subgridspec(3, 1, height_ratios=[3.0, 1.3, 0.9])
            for ax in np.asarray(cells.subplots(sharex=True), dtype=object):
                ax.plot([0.0, 70.0], [1e-3, 1e3])
                ax.set_ylabel("phase [°]")
                ax.label_outer()
        drawing.axes[0].set_yscale("log")
        figures.log_axis(drawing.axes[0])
        arrange(drawing)
        check(drawing)
        heights = [ax.get_position().height for ax in drawing.axes[:3]]
        assert heights[0] / heights[2] == pytest.approx(3.0 / 0.9, rel=0.01)
        assert len(drawing.axes[0].get_xticks()) == 0  # the texts stand for the marks


def test_a_year_and_a_power_of_ten_stand_once() -> None:
    with matplotlib.rc_context({**cast(Any, figures.STYLE), "svg.fonttype": "none"}):
        drawing = figures.figure(9.6, 3.0)
        ax = drawing.add_subplot()
        ax.plot(19800.5 + np.arange(250), 1e-7 * np.arange(250))  # days since 1970: within 2024
        locator = AutoDateLocator()
        ax.xaxis.set_major_locator(locator)
        ax.xaxis.set_major_formatter(ConciseDateFormatter(locator))
        canvas, out = FigureCanvasSVG(drawing), io.StringIO()
        arrange(drawing)
        canvas.print_svg(out)
    assert out.getvalue().count(">2024</text>") == 1 and out.getvalue().count("1e−5</text>") == 1
