# SPDX-License-Identifier: MIT
"""Pictures of results in one style, each a matplotlib figure that a notebook shows as it is.

>>> import okid
>>> picture = okid.plots.shapes(okid.demo())
>>> len(picture.axes)
3
>>> picture.numbers().splitlines()[0]
'panel,curve,x,y,value'
"""

from __future__ import annotations

import io
from collections.abc import Callable
from functools import wraps
from pathlib import Path
from typing import Any, ParamSpec, cast

import numpy as np
from matplotlib import rc_context
from matplotlib.figure import Figure
from numpy.typing import ArrayLike

from okid import frf as responses
from okid._errors import InputError
from okid.frf import Frf
from okid.result import expert_figures, figures
from okid.result.circle import fit_circle, lines_around
from okid.result.figure_numbers import figure_csv
from okid.result.figures import STYLE
from okid.result.parts import Mode
from okid.result.result import Result
from okid.result.stabilization import Stabilization

__all__ = [
    "STYLE", "Picture", "cmif", "coherence", "complexity", "fdd", "fit", "frf", "mac", "nyquist", "shapes",
    "singular_values", "spectrogram", "stabilization",
]  # fmt: skip
Given = ParamSpec("Given")


class Picture(Figure):
    """A figure that shows itself in a notebook, with savefig() and .axes as every other, and its numbers."""

    def numbers(self) -> str:
        """What it shows as CSV: panel, curve, x, y, value."""
        return figure_csv(self)

    def save(self, path: str | Path) -> None:
        """Write .csv (the numbers), or .svg, .png, .pdf. InputError for another ending."""
        kind = Path(path).suffix.lower()
        if kind not in (".csv", ".svg", ".png", ".pdf"):
            raise InputError(f"{path}: expected a name that ends in .csv, .svg, .png or .pdf")
        if kind == ".csv":
            Path(path).write_text(self.numbers(), encoding="utf-8")
            return
        with rc_context(cast(Any, STYLE)):
            self.savefig(path, dpi=200, metadata={"Date": None} if kind == ".svg" else None)

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
def mac(result: Result, other: Result | None = None) -> Picture:
    """AutoMAC of the confident modes, or CrossMAC with those of `other`, which are the columns. InputError without a
    mode, or when both have not the same outputs."""
    modes = _confident(result)
    shapes = np.array([mode.shape for mode in modes])
    across = None if other is None else np.array([mode.shape for mode in _confident(other)])
    if other is not None and other.shape_places != result.shape_places:
        raise InputError(f"the results have outputs {result.shape_places} and {other.shape_places}, expected the same")
    picture = _sheet(4.5, 4.0)
    labels = [f"{k}  {mode.frequency_hz:.4g} Hz" for k, mode in enumerate(modes, 1)]
    figures.draw_mac(picture.add_subplot(), shapes, labels, across)
    return picture


@_styled
def complexity(result: Result) -> Picture:
    """The entries of each confident mode in the complex plane. InputError without one."""
    modes = _confident(result)
    columns = min(4, len(modes))
    rows = -(-len(modes) // columns)
    picture = _sheet(2.2 * columns, 2.4 * rows)
    for k, mode in enumerate(modes, 1):
        ax = picture.add_subplot(rows, columns, k)
        figures.draw_compass(ax, np.asarray(mode.shape), f"{k}: {mode.frequency_hz:.4g} Hz")
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


def _marked(result: Result | None) -> tuple[list[float], list[float]]:
    """Frequencies of the confident and of the doubtful modes."""
    modes = [] if result is None else result.modes
    sure = [] if result is None else [mode.frequency_hz for mode in result.confident_modes]
    return sure, [mode.frequency_hz for mode in modes if mode.frequency_hz not in sure]


def _values_over(frequency_hz: ArrayLike, matrices: ArrayLike, result: Result | None, label: str) -> Picture:
    line, sure = np.asarray(frequency_hz, dtype=np.float64), _marked(result)
    picture = _sheet(9.0, 4.0)
    ax = picture.add_subplot()
    values = expert_figures.singular_values_over(matrices)
    expert_figures.draw_singular_spectra(ax, line, values, float(line[-1]), *sure)
    ax.set_ylabel(label)
    return picture


@_styled
def fdd(y: ArrayLike, fs: float, result: Result | None = None) -> Picture:
    """Frequency domain decomposition: singular values of the spectra of the outputs y (N, n_y) at fs Hz, with the modes
    of `result` marked. InputError as okid.frf.spectra()."""
    found = responses.spectra(y, fs)
    return _values_over(found.frequency_hz[1:], found.power[1:], result, "singular value [unit²/Hz]")


@_styled
def cmif(measured: Frf, result: Result | None = None) -> Picture:
    """Complex mode indicator: singular values of measured responses, with the modes of `result` marked."""
    return _values_over(measured.frequency_hz[1:], measured.response[1:], result, "singular value")


@_styled
def coherence(measured: Frf) -> Picture:
    """Multiple coherence of the first four outputs. InputError where it is not known (one average, or a file)."""
    if not np.any(np.isfinite(measured.coherence)):
        raise InputError("these responses have no coherence: it takes more averages than inputs")
    picture = _sheet(9.0, 2.8)
    line = measured.frequency_hz
    expert_figures.draw_coherence(
        picture.add_subplot(), line, measured.coherence, measured.names()[1][: expert_figures.MOST_CURVES],
        float(line[-1]),
    )  # fmt: skip
    return picture


@_styled
def spectrogram(y: ArrayLike, fs: float, shown_hz: float | None = None) -> Picture:
    """Power density of one channel y (N,) at fs Hz over time and frequency, up to `shown_hz` (default: all). InputError
    for fewer than 256 samples."""
    time_s, line, power = expert_figures.spectrogram_of(y, fs)
    picture = _sheet(9.0, 4.0)
    expert_figures.draw_spectrogram(picture.add_subplot(), time_s, line, power, shown_hz or fs / 2.0)
    return picture


@_styled
def nyquist(
    result: Result,
    measured: Frf,
    mode: int = 0,
    output: int | None = None,
    force: int = 0,
    sensing: str = "acceleration",
) -> Picture:
    """Nyquist circle of confident mode `mode` (from 0): lines of the measured response of `output` (default: where the
    shape is largest) to `force`, as mobility, with the circle through them. InputError as fit_circle() of
    okid.result.circle."""
    modes = _confident(result)
    if not 0 <= mode < len(modes):
        raise InputError(f"mode is {mode}, expected 0 to {len(modes) - 1}")
    own = modes[mode]
    place = int(np.nanargmax(np.abs(own.shape))) if output is None else output
    near = lines_around(measured.frequency_hz, own.frequency_hz, own.damping_ratio)
    found = fit_circle(measured.frequency_hz[near], measured.response[near, place, force], sensing)
    picture = _sheet(4.8, 4.6)
    ax = picture.add_subplot()
    title = f"{measured.names()[1][place]}: {found.frequency_hz:.4g} Hz, {100.0 * found.damping_ratio:.3g} %"
    expert_figures.draw_circle(ax, found, title)
    picture.legend(ncols=3, loc="outside lower center")
    return picture
