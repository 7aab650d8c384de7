# SPDX-License-Identifier: MIT
"""Pictures of a record, of a run and of a geometry: drawn into axes that the caller owns, in the colours of figures."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from numpy.typing import NDArray

from okid.data.structure_motion import StructureMotion, edges_of
from okid.frf import Frf, Spectra
from okid.modal import normalised
from okid.report.events import Events, Point
from okid.report.measured import Excerpt
from okid.report.residual import BOUND_95, BOUND_99, Whiteness
from okid.result.figures import BLUE, DARK, EDGE, FAINT, GREEN, GREY, ORANGE, PAPER, RED, draw_frf, log_axis

Real = NDArray[np.float64]
Complex = NDArray[np.complex128]
MOST_POINTS = 600  # of a track; more are thinned out


def draw_overlay(ax: Axes, error: Axes, excerpt: Excerpt, output: int) -> None:
    """Measured and modelled response over time, and their difference below on a scale of its own."""
    time, y, model = excerpt.time_s, excerpt.measured[:, output], excerpt.modelled[:, output]
    ax.plot(time, y, color=FAINT, lw=3.0, label="measured")
    ax.plot(time, model, color=BLUE, lw=0.9, label="simulated" if excerpt.simulated else "predicted")
    error.plot(time, y - model, color=ORANGE, lw=0.7)
    for one in (ax, error):
        one.set_xlim(float(time[0]), float(time[-1]))
        one.locator_params(axis="y", nbins=4 if one is ax else 2)
    ax.tick_params(labelbottom=False)
    error.tick_params(axis="y", labelsize=7.0)


def draw_autocorrelation(ax: Axes, white: Whiteness, output: int) -> None:
    """Autocorrelation of the innovation of one output over the lag, with 95 and 99 % bounds of white noise."""
    lag = np.arange(1, white.lags + 1)
    values = white.auto[1:, output]
    unit = 1.0 / np.sqrt(float(white.used[output]))
    _bounds(ax, unit)
    ax.vlines(lag, 0.0, values, color=BLUE, lw=1.6)
    ax.set_xlim(0.0, white.lags + 1.0)
    _limits(ax, values, unit)


def draw_cross(ax: Axes, white: Whiteness, output: int, into: int) -> None:
    """Correlation of the innovation of one output with one input; positive lag: the input came before."""
    lag = np.arange(-white.lags, white.lags + 1)
    values = white.cross[:, output, into]
    unit = float(white.cross_unit[output, into])
    _bounds(ax, unit)
    ax.vlines(lag, 0.0, values, color=np.where(lag < 0, GREY, BLUE).tolist(), lw=1.0)
    ax.set_xlim(-white.lags - 1.0, white.lags + 1.0)
    _limits(ax, values, unit)


def _bounds(ax: Axes, unit: float) -> None:
    ax.axhspan(-BOUND_95 * unit, BOUND_95 * unit, color=BLUE, alpha=0.12, lw=0)
    for sign in (-1.0, 1.0):
        ax.axhline(sign * BOUND_99 * unit, color=RED, lw=0.8, ls="--")
    ax.axhline(0.0, color=EDGE, lw=0.6)


def _limits(ax: Axes, values: Real, unit: float) -> None:
    largest = 1.15 * max(float(np.max(np.abs(values), initial=0.0)), 1.5 * BOUND_99 * unit)
    ax.set_ylim(-largest, largest)
    ax.locator_params(axis="y", nbins=4)
    ax.grid(False)


def draw_spectra(ax: Axes, measured: Spectra, line: Real, model: Complex | None, shown_hz: float, output: int) -> None:
    """Power spectral density of one output, measured in grey and of the innovation model in blue."""
    f = measured.frequency_hz[1:]
    ax.semilogy(f, measured.power[1:, output, output].real, color=GREY, lw=1.0, label="measured")
    if model is not None:
        ax.semilogy(line, model[:, output, output].real, color=BLUE, lw=1.1, label="model")
    ax.set_xlim(0.0, shown_hz)
    log_axis(ax)


def draw_estimators(axes: Sequence[Axes], measured: Frf, line: Real, model: Complex, output: int) -> None:
    """Responses to one input, as draw_frf(), with H2 and Hv where there is a coherence: H1 / coherence and its mean."""
    size, coherence = np.abs(measured.response[1:, output, 0]), measured.coherence[1:, output]
    if np.any(np.isfinite(coherence)):
        over = np.maximum(np.nan_to_num(coherence, nan=1.0), 1e-6)
        f = measured.frequency_hz[1:]
        axes[0].semilogy(f, size / over, color=ORANGE, lw=0.8, label="H2")
        axes[0].semilogy(f, size / np.sqrt(over), color=GREEN, lw=0.8, label="Hv")
    draw_frf(axes, measured, line, model, (output, 0))


def thinned_peaks(frequency_hz: Real, size: Real) -> tuple[Real, Real]:
    """At most MOST_POINTS lines; of several in one the largest, so that no resonance is lost."""
    step = -(-len(size) // MOST_POINTS)
    if step <= 1:
        return frequency_hz, size
    whole = len(size) // step * step
    blocks = size[:whole].reshape(-1, step)
    at = np.argmax(blocks, axis=1) + step * np.arange(len(blocks))
    return frequency_hz[at], size[at]


def thinned(points: Sequence[Point]) -> list[Point]:
    """At most MOST_POINTS of them, evenly, first and last kept."""
    if len(points) <= MOST_POINTS:
        return list(points)
    return [points[int(k)] for k in np.linspace(0, len(points) - 1, MOST_POINTS).round()]


def draw_track(ax: Axes, points: Sequence[Point], events: Events, end_s: float) -> None:
    """Frequency of one mode over stream time with its 1 sigma band; pale before it came to rest; alarms, changes."""
    shown = thinned(points)
    time = np.array([one.t for one in shown])
    f = np.array([one.frequency_hz for one in shown])
    std = np.array([np.nan if one.frequency_std_hz is None else one.frequency_std_hz for one in shown])
    for k, (begin, end, _) in enumerate(events.alarms):
        ax.axvspan(begin, end_s if end is None else end, color=RED, alpha=0.10, lw=0)
        ax.axvline(begin, color=RED, lw=1.1, label="alarm" if k == 0 else None)
    for k, at in enumerate(events.changes):
        ax.axvline(at, color=ORANGE, lw=1.1, ls="--", label="change" if k == 0 else None)
    ax.fill_between(time, f - std, f + std, color=BLUE, alpha=0.22, lw=0, label="± σ")
    settled = np.array([one.settled for one in shown])
    ax.plot(time, f, color=GREY, lw=0.9, marker="." if len(shown) <= 100 else "", ms=3.0)
    ax.plot(time, np.where(settled, f, np.nan), color=BLUE, lw=1.1, marker="." if len(shown) <= 100 else "", ms=3.5)
    low, high = _track_limits(f, std, settled)
    ax.set_xlim(0.0, end_s)
    ax.set_ylim(low, high)
    ax.locator_params(axis="y", nbins=4)
    ax.ticklabel_format(axis="y", useOffset=False, style="plain")


def _track_limits(f: Real, std: Real, settled: NDArray[np.bool_]) -> tuple[float, float]:
    """What the updates at rest need (all of them when none is), so that a wild beginning hides nothing."""
    chosen = settled if np.sum(settled) >= 3 else np.arange(len(f)) >= len(f) // 4
    width = np.nan_to_num(std[chosen])
    low, high = float(np.min(f[chosen] - width)), float(np.max(f[chosen] + width))
    margin = max(0.25 * (high - low), 1e-7 * high)
    return low - margin, high + margin


SWING = 0.16  # largest displacement over the size of the structure


def draw_at_rest_and_moved(ax: Axes, structure: StructureMotion, shape: Complex) -> None:
    """One mode on the structure at its largest beside the structure at rest, seen from the corner (flat: the front).

    Dots: nodes with a sensor that the shape has a value of; rings: those that follow their neighbours.
    """
    turned = np.nan_to_num(normalised(shape))
    angle = np.exp(-0.5j * np.angle(np.sum(turned**2)))
    motion = (structure.moved(normalised(shape)) * angle).real
    largest = max(float(np.max(np.linalg.norm(motion, axis=1))), 1e-300)
    nodes = np.array(structure.geometry.nodes, dtype=np.float64)
    at_rest = _seen(nodes, nodes)
    moved = _seen(nodes + SWING * structure.size / largest * motion, nodes)
    for one in structure.geometry.surfaces:
        corners = moved[[node - 1 for node in one]]
        ax.fill(corners[:, 0], corners[:, 1], facecolor=BLUE, alpha=0.14, lw=0)
    for points, colour, thick, dash in ((at_rest, FAINT, 0.8, "--"), (moved, BLUE, 1.6, "-")):
        for a, b in edges_of(structure.geometry):
            ax.plot(points[[a, b], 0], points[[a, b], 1], color=colour, lw=thick, ls=dash)
    sensor = structure.measured(shape)
    ring = ~sensor
    ring[[node - 1 for node in structure.at_rest]] = False
    if np.any(ring) and len(sensor) <= 60:
        ax.plot(*moved[ring].T, "o", color=BLUE, ms=2.2, mew=0.7, mfc=PAPER)
    ax.plot(*moved[sensor].T, "o", color=DARK, ms=2.6)
    both = np.vstack([at_rest, moved])
    low, high = both.min(axis=0), both.max(axis=0)
    margin = 0.06 * float(np.max(high - low)) + 1e-12
    ax.set_xlim(low[0] - margin, high[0] + margin)
    ax.set_ylim(low[1] - margin, high[1] + margin)
    ax.set_aspect("equal")
    ax.set_axis_off()


def _seen(points: Real, nodes: Real) -> Real:
    """Orthographic view (n, 2) as shapes.js begins: from the front when all y of `nodes` are the same, else from the
    corner."""
    flat = float(np.ptp(nodes[:, 1])) == 0.0
    yaw, pitch = (0.0, 0.0) if flat else (-0.6, 0.35)
    x, y, z = points.T
    depth = x * np.sin(yaw) + y * np.cos(yaw)
    return np.column_stack([x * np.cos(yaw) - y * np.sin(yaw), z * np.cos(pitch) + depth * np.sin(pitch)])
