# SPDX-License-Identifier: MIT
"""Pictures of an identified model with matplotlib: drawn into axes that the caller owns, in one set of colours."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator
from numpy.typing import NDArray

from okid.frf import Frf
from okid.modal import mac_matrix, normalised
from okid.stabilization import Cluster, Stabilization

Real = NDArray[np.float64]
Complex = NDArray[np.complex128]

BLUE, ORANGE, GREEN, RED, GREY, DARK = "#1f5fa8", "#d9731a", "#2a8c4a", "#b8292f", "#9aa3ad", "#27323d"

STYLE: dict[str, Any] = {
    "font.size": 9.0,
    "axes.edgecolor": "#56616c",
    "axes.labelcolor": DARK,
    "axes.titlecolor": DARK,
    "axes.titlesize": 9.5,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "grid.color": "#e3e7eb",
    "grid.linewidth": 0.6,
    "axes.axisbelow": True,
    "xtick.color": "#56616c",
    "ytick.color": "#56616c",
    "legend.frameon": False,
    "legend.fontsize": 8.0,
    "lines.linewidth": 1.2,
    "svg.fonttype": "path",
    "svg.hashsalt": "okid",
}

# most telling first: label, colour, marker, size
_MARKS = {
    "stable": ("frequency, damping and shape hold", GREEN, "o", 16.0),
    "shape": ("frequency and shape", BLUE, "v", 13.0),
    "damping": ("frequency and damping", ORANGE, "D", 10.0),
    "frequency": ("frequency only", RED, "+", 18.0),
    "new": ("new pole", GREY, ".", 9.0),
}


def figure(width: float, height: float) -> Figure:
    """A new figure of this size in inches with a layout that keeps labels apart."""
    return Figure(figsize=(width, height), layout="constrained", facecolor="white")


def draw_singular_values(ax: Axes, values: Real, order: int) -> None:
    """Singular values on a log scale with the chosen order marked."""
    shown = values[: int(min(len(values), max(4 * order, 40)))]
    positive = np.maximum(shown, values[0] * 1e-17)
    index = np.arange(1, len(shown) + 1)
    ax.axvspan(0.5, order + 0.5, color=BLUE, alpha=0.07, lw=0)
    ax.semilogy(index, positive, "o", ms=3.2, color=GREY)
    ax.semilogy(index[:order], positive[:order], "o", ms=3.6, color=BLUE)
    ax.axvline(order + 0.5, color=BLUE, lw=1.0, ls="--")
    ax.annotate(
        f"order {order}", (order + 0.5, 0.96), xycoords=("data", "axes fraction"), xytext=(5, 0),
        textcoords="offset points", color=BLUE, va="top",
    )  # fmt: skip
    ax.set_xlim(0.5, len(shown) + 0.5)
    ax.set_xlabel("number")
    ax.set_ylabel("singular value")


def draw_stabilization(
    ax: Axes,
    rows: Stabilization,
    shown_hz: float,
    chosen_hz: Sequence[float] = (),
    background: tuple[Real, Real] | None = None,
    order: int | None = None,
) -> None:
    """Poles over frequency (up to `shown_hz`) and order; `background` (frequency, magnitude) behind in dB, no scale.

    A band marks each cluster that holds, with its hits above it, and a ring the pole nearest its medians.
    """
    if background is not None:
        seen = background[0] <= shown_hz
        line, magnitude = background[0][seen], background[1][seen]
        behind = ax.twinx()
        behind.plot(line, 20.0 * np.log10(np.maximum(magnitude, np.max(magnitude) * 1e-6)), color="#c3ccd6", lw=0.9)
        behind.set_yticks([])
        behind.grid(False)
        behind.spines["right"].set_visible(False)
        behind.set_zorder(0)
        ax.set_zorder(1)
        ax.patch.set_visible(False)
    points: dict[str, list[tuple[float, int]]] = {name: [] for name in _MARKS}
    for row in rows:
        for k, f in enumerate(row.frequency_hz):
            if row.stable[k]:
                kind = "stable"
            elif row.stable_shape[k]:
                kind = "shape"
            elif row.stable_damping[k]:
                kind = "damping"
            else:
                kind = "frequency" if row.stable_frequency[k] else "new"
            points[kind].append((float(f), row.order))
    for f in chosen_hz:
        ax.axvline(f, color=GREEN, lw=0.7, alpha=0.45)
    for kind, (label, colour, marker, size) in reversed(_MARKS.items()):
        if points[kind]:
            xy = np.array(points[kind])
            ax.scatter(xy[:, 0], xy[:, 1], s=size, c=colour, marker=marker, linewidths=0.8, label=label, zorder=3)
    held = [mode for mode in rows.modes if mode.frequency_hz <= shown_hz]
    width = rows.criteria.frequency
    for mode in held:
        ax.axvspan(mode.frequency_hz * (1.0 - width), mode.frequency_hz * (1.0 + width), color=BLUE, alpha=0.10, lw=0)
    if held:
        poles = np.array([_nearest_pole(rows, mode) for mode in held])
        ax.scatter(poles[:, 0], poles[:, 1], s=70, facecolors="none", edgecolors=BLUE, linewidths=1.3, zorder=4,
                   label="found by itself")  # fmt: skip
    if order is not None:
        ax.axhline(order, color=BLUE, lw=0.9, ls="--", label=f"order used ({order})")
    ax.set_xlim(0.0, shown_hz)
    ax.set_ylim(bottom=0.0)
    ax.yaxis.set_major_locator(MaxNLocator(integer=True, steps=[1, 2, 4, 10]))
    ax.set_xlabel("frequency [Hz]")
    ax.set_ylabel("model order")
    ax.grid(False)
    handles, labels = ax.get_legend_handles_labels()
    ax.legend(handles[::-1], labels[::-1], ncols=3, loc="lower left", bbox_to_anchor=(0.0, 1.0), borderaxespad=0.2)


def _nearest_pole(rows: Stabilization, mode: Cluster) -> tuple[float, int]:
    """Frequency and order of the pole that stands for a cluster."""
    row = next(row for row in rows if (row.horizon, row.order) == (mode.horizon, mode.order))
    own = row.frequency_hz[np.argmin(np.abs(row.frequency_hz - mode.frequency_hz))]
    return float(own), row.order


def draw_frf(axes: Sequence[Axes], measured: Frf | None, line: Real, model: Complex, pair: tuple[int, int]) -> None:
    """Magnitude, phase and (three axes) coherence of one output and input, measured in grey and synthesised in blue."""
    out, into = pair
    magnitude, phase = axes[0], axes[1]
    if measured is not None:
        f, h = measured.frequency_hz[1:], measured.response[1:, out, into]
        magnitude.semilogy(f, np.abs(h), color=GREY, lw=1.0, label="measured (H1)")
        phase.plot(f, np.degrees(np.angle(h)), color=GREY, lw=0.8)
        if len(axes) > 2:
            axes[2].plot(f, measured.coherence[1:, out], color=ORANGE, lw=0.8)
            axes[2].set_ylim(0.0, 1.05)
            axes[2].set_yticks([0.0, 0.5, 1.0])
    magnitude.semilogy(line, np.abs(model[:, out, into]), color=BLUE, lw=1.1, label="model")
    phase.plot(line, np.degrees(np.angle(model[:, out, into])), color=BLUE, lw=0.9)
    phase.set_ylim(-190.0, 190.0)
    phase.set_yticks([-180, -90, 0, 90, 180])
    for ax in axes:
        ax.set_xlim(0.0, float(line[-1]))
        ax.label_outer()


def draw_shape(ax: Axes, shape: Complex, labels: Sequence[str], title: str) -> None:
    """Stick plot of one mode against the outputs: height |entry|, sign of the real part along the shape's own line."""
    scaled = normalised(shape)
    along = (scaled * np.exp(-0.5j * np.angle(np.sum(scaled**2)))).real  # the straight line that fits the entries best
    along = along if along[np.argmax(np.abs(scaled))] >= 0.0 else -along
    height = np.abs(scaled) * np.where(along < 0.0, -1.0, 1.0)
    index = np.arange(1, len(height) + 1)
    ax.axhline(0.0, color="#56616c", lw=0.7)
    ax.vlines(index, 0.0, height, color=np.where(height < 0, RED, BLUE).tolist(), lw=min(4.0, 60.0 / len(height)))
    ax.plot(index, height, "-", color=GREY, lw=0.8)
    ax.scatter(index, height, s=14.0, c=np.where(height < 0, RED, BLUE).tolist(), zorder=3)
    ax.set_ylim(-1.2, 1.2)
    ax.set_yticks([-1, 0, 1])
    ax.set_xlim(0.4, len(height) + 0.6)
    step = max(1, int(np.ceil(len(height) / 8)))
    ax.set_xticks(index[::step], [str(labels[k - 1]) for k in index[::step]], rotation=30 if len(height) > 4 else 0)
    ax.tick_params(labelsize=7)
    ax.set_title(title)


def draw_compass(ax: Axes, shape: Complex, title: str) -> None:
    """The entries of one mode as arrows in the complex plane (a polar axes): a real mode lies on one line."""
    turned = normalised(shape)
    for entry in turned:
        ax.plot([0.0, float(np.angle(entry))], [0.0, float(np.abs(entry))], color=BLUE, lw=1.0, alpha=0.8)
    ax.plot(np.angle(turned), np.abs(turned), "o", ms=2.5, color=BLUE)
    ax.set_ylim(0.0, 1.08)
    ax.set_yticks([0.5, 1.0], [])
    ax.set_xticks(np.radians([0, 90, 180, 270]), ["0°", "90°", "180°", "270°"])
    ax.tick_params(labelsize=6, pad=-2)
    ax.set_title(title, fontsize=8.0, pad=8)


def draw_mac(ax: Axes, shapes: Complex, frequencies: Sequence[float]) -> Any:
    """AutoMAC as a square of colours, with numbers up to 14 modes; returns the image for a colour bar."""
    values = mac_matrix(shapes)
    image = ax.imshow(values, cmap="Blues", vmin=0.0, vmax=1.0)
    ax.grid(False)
    ticks = [f"{f:.3g}" for f in frequencies]
    size = 8.0 if len(ticks) <= 14 else 6.0
    ax.set_xticks(range(len(ticks)), ticks, rotation=90, fontsize=size)
    ax.set_yticks(range(len(ticks)), ticks, fontsize=size)
    ax.set_xlabel("mode [Hz]")
    ax.set_ylabel("mode [Hz]")
    if len(ticks) <= 14:
        for (i, j), value in np.ndenumerate(values):
            colour = "white" if value > 0.6 else DARK
            ax.text(j, i, f"{value:.2f}", ha="center", va="center", fontsize=6.5, color=colour)
    return image


def draw_fit(
    ax: Axes, names: Sequence[str], simulated: Sequence[float | None], predicted: Sequence[float | None]
) -> None:
    """Fit percentages as pairs of bars; a missing or negative one is written, not drawn."""
    index = np.arange(len(names))
    groups = ((-0.2, simulated, BLUE, "simulation"), (0.2, predicted, ORANGE, "prediction"))
    for offset, values, colour, label in groups:
        height = [max(0.0, v) if v is not None else 0.0 for v in values]
        ax.bar(index + offset, height, 0.38, color=colour, label=label)
        for x, v in zip(index, values, strict=True):
            if v is None or v < 0.0:
                ax.text(x + offset, 2.0, "n/a" if v is None else f"{v:.3g}", rotation=90, ha="center", fontsize=7)
    ax.set_ylim(0.0, 103.0)
    ax.set_xticks(index, list(names), rotation=45 if len(names) > 8 else 0, ha="right" if len(names) > 8 else "center")
    ax.grid(False, axis="x")
    ax.set_ylabel("fit [%]")
    ax.legend(ncols=2, loc="lower left", bbox_to_anchor=(0.0, 1.0), borderaxespad=0.2)


def draw_diagonals(ax: Axes, parts: Sequence[tuple[str, Real]]) -> None:
    """Diagonals of matrices of one size as groups of bars, one group a degree of freedom."""
    width = 0.8 / len(parts)
    for k, (label, values) in enumerate(parts):
        index = np.arange(1, len(values) + 1) + (k - (len(parts) - 1) / 2) * width
        ax.bar(index, values, 0.92 * width, color=(BLUE, ORANGE, GREEN, GREY)[k % 4], label=label)
    ax.xaxis.set_major_locator(MaxNLocator(integer=True))
    ax.axhline(0.0, color="#56616c", lw=0.7)
    ax.grid(False, axis="x")
    ax.legend(ncols=len(parts), loc="lower left", bbox_to_anchor=(0.0, 1.0), borderaxespad=0.2)


def draw_markov(ax: Axes, markov: Real, dt: float, pair: tuple[int, int], title: str) -> None:
    """Impulse response Y_1, Y_2 .. of one output and input over time; Y_0 (feed-through) as a dot."""
    out, into = pair
    time = np.arange(len(markov)) * dt
    ax.plot(time[1:], markov[1:, out, into], color=BLUE, lw=1.0)
    ax.plot(time[:1], markov[:1, out, into], "o", ms=4.0, color=ORANGE)
    ax.axhline(0.0, color="#56616c", lw=0.6)
    ax.set_xlim(-0.01 * time[-1], time[-1])
    ax.set_title(title)
