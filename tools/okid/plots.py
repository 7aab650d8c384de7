# SPDX-License-Identifier: MIT
"""Pictures of results in one style, each a matplotlib figure that a notebook shows as it is.

>>> import okid
>>> picture = okid.plots.shapes(okid.demo())
>>> len(picture.axes)
3
"""

from __future__ import annotations

import io
from collections.abc import Callable
from functools import wraps
from typing import Any, ParamSpec, cast

import numpy as np
from matplotlib import rc_context
from matplotlib.figure import Figure

from okid._errors import InputError
from okid.frf import Frf
from okid.result import figures
from okid.result.figures import STYLE
from okid.result.parts import Mode
from okid.result.result import Result
from okid.result.stabilization import Stabilization

__all__ = ["STYLE", "Picture", "fit", "frf", "mac", "shapes", "singular_values", "stabilization"]
Given = ParamSpec("Given")


class Picture(Figure):
    """A figure that shows itself in a notebook, with savefig() and .axes as every other."""

    def _repr_svg_(self) -> str:
        out = io.StringIO()
        with rc_context(cast(Any, STYLE)):
            self.savefig(out, format="svg", metadata={"Date": None})
        return out.getvalue()


def _styled(draw: Callable[Given, Picture]) -> Callable[Given, Picture]:
    @wraps(draw)
    def in_style(*args: Given.args, **options: Given.kwargs) -> Picture:
        with rc_context(cast(Any, STYLE)):
            return draw(*args, **options)

    return in_style


def _sheet(width: float, height: float) -> Picture:
    return Picture(figsize=(width, height), layout="constrained")


def _confident(result: Result) -> list[Mode]:
    if not result.confident_modes:
        raise InputError("the result has no confident mode to draw")
    return result.confident_modes


@_styled
def stabilization(source: Result | Stabilization, shown_hz: float | None = None) -> Picture:
    """The stabilization diagram of a result of a named method, or of okid.stabilization(), up to `shown_hz`."""
    rows = source.stabilization() if isinstance(source, Result) else source
    chosen = [mode.frequency_hz for mode in (source.confident_modes if isinstance(source, Result) else rows.modes)]
    highest = max((float(np.max(row.frequency_hz, initial=0.0)) for row in rows), default=1.0)
    picture = _sheet(9.0, 4.5)
    figures.draw_stabilization(picture.add_subplot(), rows, shown_hz or 1.02 * highest, chosen)
    return picture


@_styled
def shapes(result: Result) -> Picture:
    """Stick plots of the confident modes over the outputs. InputError without one."""
    modes = _confident(result)
    rows = -(-len(modes) // 3)
    picture = _sheet(9.0, 2.1 * rows)
    for k, mode in enumerate(modes):
        title = f"{mode.frequency_hz:.4g} Hz, {100 * mode.damping_ratio:.2g} %"
        figures.draw_shape(picture.add_subplot(rows, 3, k + 1), np.asarray(mode.shape), result.shape_places, title)
    return picture


@_styled
def mac(result: Result) -> Picture:
    """AutoMAC of the confident modes. InputError without one."""
    modes = _confident(result)
    picture = _sheet(4.5, 4.0)
    labels = [f"{k}  {mode.frequency_hz:.4g} Hz" for k, mode in enumerate(modes, 1)]
    figures.draw_mac(picture.add_subplot(), np.array([mode.shape for mode in modes]), labels)
    return picture


@_styled
def singular_values(result: Result) -> Picture:
    """Singular values that gave the order. InputError where the method has none."""
    if not len(result.singular_values):
        raise InputError(f"a result of method {result.method!r} has no singular values: name a method")
    picture = _sheet(6.0, 3.5)
    figures.draw_singular_values(picture.add_subplot(), np.asarray(result.singular_values), int(result.order))
    return picture


@_styled
def fit(result: Result) -> Picture:
    """Simulation and prediction fit of each output in percent. InputError of a stream, whose samples were not kept,
    and of set-ups or results that were merged."""
    both = [[one[name] for name in result.outputs] for one in result.fit]
    if all(value is None for values in both for value in values):
        raise InputError("this result has no fit: it takes a record (okid.identify), not a stream, set-ups or a merger")
    picture = _sheet(max(4.0, 0.5 * len(result.outputs) + 2.0), 3.2)
    figures.draw_fit(picture.add_subplot(), result.outputs, both[0], both[1])
    return picture


@_styled
def frf(result: Result, measured: Frf | None = None, output: int = 0, force: int = 0) -> Picture:
    """Response of the model from input `force` to `output` (numbers from 0), with what okid.frf.h1() measured."""
    if not result.inputs:
        raise InputError("this result has no inputs, so there is no response to draw: identify with a measured force")
    if not (0 <= output < len(result.outputs) and 0 <= force < len(result.inputs)):
        raise InputError(
            f"output {output}, force {force}: expected 0 to {len(result.outputs) - 1} and 0 to {len(result.inputs) - 1}"
        )
    line = np.linspace(0.0, result.fs_hz / 2.0, 1025)[1:]
    response = result.model.frequency_response(line)
    picture = _sheet(9.0, 4.5)
    count = 2 if measured is None else 3
    axes = picture.subplots(count, 1, sharex=True, height_ratios=[3, 1, 1][:count])
    figures.draw_frf(list(axes), measured, line, response, (output, force))
    axes[0].set_title(f"{result.outputs[output]} / {result.inputs[force]}")
    axes[-1].set_xlabel("frequency [Hz]")
    axes[0].legend(ncols=2)
    return picture
