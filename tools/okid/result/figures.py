# SPDX-License-Identifier: MIT
"""Pictures of an identified model with matplotlib: drawn into axes that the caller owns, in one set of colours."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle
from matplotlib.ticker import FuncFormatter, LogLocator, MaxNLocator, NullLocator
from numpy.typing import NDArray

from okid.frf import Frf
from okid.modal import mac_matrix, mean_phase, normalised
from okid.result.figure_numbers import state_numbers
from okid.result.stabilization import Cluster, Stabilization

Real = NDArray[np.float64]
Complex = NDArray[np.complex128]

BLUE, ORANGE, GREEN, RED, GREY, DARK = "#1f5fa8", "#c7610f", "#2a8c4a", "#b8292f", "#8b959f", "#27323d"
EDGE, GRID, FAINT, PAPER = "#56616c", "#e3e7eb", "#c3ccd6", "#ffffff"  # of axes, of the net, of what stands behind
LONGEST_LABEL = 16  # letters of a channel's name on an axis

STYLE: dict[str, Any] = {
    "font.size": 9.0,
    "text.color": DARK,
    "axes.facecolor": "none",
    "axes.edgecolor": EDGE,
    "axes.labelcolor": DARK,
    "axes.titlecolor": DARK,
    "axes.titlesize": 9.5,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "grid.color": GRID,
    "grid.linewidth": 0.6,
    "axes.axisbelow": True,
    "xtick.color": EDGE,
    "ytick.color": EDGE,
    "legend.frameon": False,
    "legend.fontsize": 8.0,
    "lines.linewidth": 1.2,
    "text.parse_math": False,  # a channel may be called a$b
    "svg.fonttype": "none",
    "svg.hashsalt": "okid",
}

# most telling first: label, colour, marker, size
_MARKS = {
    "stable": ("pole: frequency, damping, shape stable", GREEN, "o", 16.0),
    "shape": ("frequency and shape stable", BLUE, "v", 13.0),
    "damping": ("frequency and damping stable", ORANGE, "D", 10.0),
    "frequency": ("only the frequency stable", RED, "+", 18.0),
    "new": ("none of them stable", GREY, ".", 20.0),
}


def figure(width: float, height: float) -> Figure:
    """A new figure of this size in inches; what shows it gives its axes their places."""
    return Figure(figsize=(width, height), facecolor="none")


def short(name: str, longest: int = LONGEST_LABEL) -> str:
    """A name that fits on an axis: its beginning and its end, where channels differ."""
    clean = " ".join("".join(c if c.isprintable() else " " for c in name).split())
    return clean if len(clean) <= longest else f"{clean[: longest // 2]}…{clean[-(longest // 2 - 1) :]}"


def _power(value: float, _place: int = 0) -> str:
    """A number on a log axis: 10⁻³, 2·10⁴, 0.5."""
    if value <= 0.0:
        return ""
    exponent = int(np.floor(np.log10(value) + 1e-9))
    if -2 <= exponent <= 2:
        return f"{value:g}"
    digits = str(exponent).translate(str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹"))
    factor = round(value / 10.0**exponent)
    return f"10{digits}" if factor == 1 else f"{factor}·10{digits}"


def log_axis(ax: Axes) -> None:
    """Marks of a logarithmic y axis as plain text, a few of them whatever the range."""
    low, high = ax.get_ylim()
    decades = float(np.log10(high / low)) if 0.0 < low < high else 1.0
    ax.yaxis.set_major_locator(LogLocator(subs=(1.0,) if decades > 2.0 else (1.0, 2.0, 5.0), numticks=7))
    ax.yaxis.set_major_formatter(FuncFormatter(_power))
    ax.yaxis.set_minor_locator(NullLocator())


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
    log_axis(ax)


def draw_stabilization(
    ax: Axes,
    rows: Stabilization,
    shown_hz: float,
    chosen_hz: Sequence[float] = (),
    background: tuple[Real, Real] | None = None,
    order: int | None = None,
    doubtful_hz: Sequence[float] = (),
) -> None:
    """Poles over frequency (up to `shown_hz`) and order; `background` (frequency, magnitude) behind in dB, no scale.

    Lines: `chosen_hz`, the modes of the model, dotted `doubtful_hz`, those it rejected, and its `order`. A band marks
    each cluster that holds, a ring the pole nearest its medians.
    """
    behind_key = _draw_behind(ax, *background, shown_hz) if background is not None else []
    points = _poles_by_mark(rows)
    for k, f in enumerate(chosen_hz):
        ax.axvline(f, color=GREEN, lw=0.8, alpha=0.6, label=None if k else "mode of this model")
    for k, f in enumerate(doubtful_hz):
        ax.axvline(f, color=GREY, lw=0.9, ls=":", label=None if k else "doubtful: rejected")
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
                   label="column found (band, ring)")  # fmt: skip
    if order is not None:
        ax.axhline(order, color=BLUE, lw=1.2, ls="--", label=f"order of this model: {order}")
    ax.set_xlim(0.0, shown_hz)
    ax.set_ylim(bottom=0.0)
    ax.yaxis.set_major_locator(MaxNLocator(integer=True, steps=[1, 2, 4, 10]))
    ax.set_xlabel("frequency [Hz]")
    ax.set_ylabel("model order")
    ax.grid(False)
    _draw_key(ax, behind_key)


def _draw_behind(ax: Axes, line: Real, magnitude: Real, shown_hz: float) -> list[Any]:
    """A magnitude in dB behind the axes, without a scale. Its entry of the legend."""
    seen = line <= shown_hz
    behind = ax.twinx()
    level = 20.0 * np.log10(np.maximum(magnitude[seen], np.max(magnitude[seen]) * 1e-6))
    key = behind.plot(line[seen], level, color=FAINT, lw=0.9)
    behind.set_yticks([])
    behind.grid(False)
    behind.spines["right"].set_visible(False)
    behind.set_zorder(0)
    ax.set_zorder(1)
    ax.patch.set_visible(False)
    return key


def _poles_by_mark(rows: Stabilization) -> dict[str, list[tuple[float, int]]]:
    """Frequency and order of every pole, under the mark that says what of it is stable."""
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
    return points


def _draw_key(ax: Axes, behind_key: list[Any]) -> None:
    """The legend: marks first, then what is drawn around them, then what is behind."""
    key = {text: handle for handle, text in zip(*ax.get_legend_handles_labels(), strict=True)}
    rank = [mark[0] for mark in _MARKS.values()]
    texts = sorted(key, key=lambda text: rank.index(text) if text in rank else len(rank))
    handles, texts = [key[text] for text in texts] + behind_key, texts + ["measured, dB"] * len(behind_key)
    ax.legend(handles, texts, ncols=3, loc="lower left", bbox_to_anchor=(0.0, 1.0), borderaxespad=0.2)


def _nearest_pole(rows: Stabilization, mode: Cluster) -> tuple[float, int]:
    """Frequency and order of the pole that stands for a cluster."""
    row = next(row for row in rows if (row.horizon, row.order) == (mode.horizon, mode.order))
    own = row.frequency_hz[np.argmin(np.abs(row.frequency_hz - mode.frequency_hz))]
    return float(own), row.order


def _without_jumps(degrees: Real) -> Real:
    """The same with a gap where the angle goes from one end of the scale to the other."""
    out = degrees.copy()
    out[1:][np.abs(np.diff(degrees)) > 180.0] = np.nan
    return out


def draw_frf(axes: Sequence[Axes], measured: Frf | None, line: Real, model: Complex, pair: tuple[int, int]) -> None:
    """Magnitude, phase and (three axes) coherence of one output and input, measured in grey and synthesised in blue."""
    out, into = pair
    magnitude, phase = axes[0], axes[1]
    if measured is not None:
        f, h = measured.frequency_hz[1:], measured.response[1:, out, into]
        magnitude.semilogy(f, np.abs(h), color=GREY, lw=1.0, label="measured (H1)" if measured.averages else "measured")
        phase.plot(f, _without_jumps(np.degrees(np.angle(h))), color=GREY, lw=0.8)
        if len(axes) > 2:
            axes[2].plot(f, measured.coherence[1:, out], color=ORANGE, lw=0.8)
            axes[2].set_ylim(0.0, 1.05)
            axes[2].set_yticks([0.0, 0.5, 1.0])
    magnitude.semilogy(line, np.abs(model[:, out, into]), color=BLUE, lw=1.1, label="model")
    phase.plot(line, _without_jumps(np.degrees(np.angle(model[:, out, into]))), color=BLUE, lw=0.9)
    log_axis(magnitude)
    phase.set_ylim(-190.0, 190.0)
    phase.set_yticks([-180, 0, 180])
    for ax in axes:
        ax.set_xlim(0.0, float(line[-1]))
        ax.label_outer()


def draw_shape(ax: Axes, shape: Complex, labels: Sequence[str], title: str) -> None:
    """Stick plot of one mode against the outputs: height |entry|, sign of the real part along the shape's own line."""
    scaled = normalised(shape)
    along = (scaled * np.exp(-1j * mean_phase(scaled))).real
    along = along if along[np.argmax(np.nan_to_num(np.abs(scaled)))] >= 0.0 else -along
    height = np.abs(scaled) * np.where(along < 0.0, -1.0, 1.0)
    index = np.arange(1, len(height) + 1)
    ax.axhline(0.0, color=EDGE, lw=0.7)
    ax.vlines(index, 0.0, height, color=np.where(height < 0, RED, BLUE).tolist(), lw=min(4.0, 60.0 / len(height)))
    ax.plot(index, height, "-", color=GREY, lw=0.8)
    ax.scatter(index, height, s=14.0, c=np.where(height < 0, RED, BLUE).tolist(), zorder=3)
    ax.set_ylim(-1.2, 1.2)
    ax.set_yticks([-1, 0, 1])
    ax.set_xlim(0.4, len(height) + 0.6)
    step = max(1, int(np.ceil(len(height) / 8)))
    longest = max((len(short(name)) for name in labels), default=0)
    slanted = len(height[::step]) * longest > 26
    ax.set_xticks(
        index[::step], [short(str(labels[k - 1])) for k in index[::step]], rotation=90 if slanted else 0,
        ha="right" if slanted else "center", va="center" if slanted else "top",
        rotation_mode="anchor" if slanted else "default",
    )  # fmt: skip
    ax.tick_params(labelsize=7)
    ax.set_title(title)


def draw_compass(ax: Axes, shape: Complex, title: str) -> None:
    """The entries of one mode as arrows in the complex plane: a real mode lies on one line."""
    turned = normalised(shape)
    state_numbers(ax, [("entry", float(one.real), float(one.imag), "") for one in turned])
    round_about = np.exp(1j * np.linspace(0.0, 2.0 * np.pi, 73))
    for radius, colour in ((0.5, GRID), (1.0, GRID), (1.08, EDGE)):
        ax.plot(radius * round_about.real, radius * round_about.imag, color=colour, lw=0.7)
    for at, text in enumerate(("0°", "90°", "180°", "270°")):
        across, up = np.cos(at * np.pi / 2.0), np.sin(at * np.pi / 2.0)
        ax.plot([0.0, across], [0.0, up], color=GRID, lw=0.6)
        ax.text(1.3 * across, 1.22 * up, text, ha="center", va="center", fontsize=6.0, color=EDGE)
    ax.plot([0.0 * turned.real, turned.real], [0.0 * turned.imag, turned.imag], color=BLUE, lw=1.0, alpha=0.8)
    ax.plot(turned.real, turned.imag, "o", ms=2.5, color=BLUE)
    ax.set_xlim(-1.45, 1.45)
    ax.set_ylim(-1.3, 1.3)
    ax.set_aspect("equal")
    ax.set_axis_off()
    ax.set_title(title, fontsize=8.0)


def draw_mac(ax: Axes, shapes: Complex, labels: Sequence[str], other: Complex | None = None) -> None:
    """MAC as squares, full ink = 1, with numbers up to 14 modes; `labels` "number  Hz" of each mode. `other`: shapes of
    the columns, else those of the rows again (AutoMAC)."""
    values = mac_matrix(shapes, other)
    state_numbers(ax, [("MAC", j + 1, i + 1, float(value)) for (i, j), value in np.ndenumerate(values)])
    count = max(values.shape)
    for (i, j), value in np.ndenumerate(values):
        ax.add_patch(Rectangle((j - 0.5, i - 0.5), 1.0, 1.0, facecolor=BLUE, alpha=round(float(value), 3), lw=0))
        if count <= 14:
            ax.text(j, i, f"{value:.2f}", ha="center", va="center", fontsize=6.5, color=PAPER if value > 0.55 else DARK)
    ax.grid(False)
    ax.set_xlim(-0.5, values.shape[1] - 0.5)
    ax.set_ylim(len(values) - 0.5, -0.5)
    ax.set_aspect("equal")
    size, step = (8.0, 1) if count <= 14 else (6.5, -(-count // 20))
    down, across = range(0, len(values), step), range(0, values.shape[1], step)
    ax.set_xticks(across, [str(k + 1) for k in across], fontsize=size)
    ax.set_yticks(down, [labels[k] for k in down], fontsize=size)
    ax.spines[["top", "right"]].set_visible(True)
    ax.set_xlabel("mode")
    ax.set_ylabel("mode, frequency")


def draw_comac(ax: Axes, names: Sequence[str], values: Sequence[float]) -> None:
    """One bar an output, 0 to 1."""
    index = np.arange(len(names))
    ax.bar(index, values, 0.6, color=BLUE)
    ax.set_ylim(0.0, 1.05)
    ax.set_xlim(-0.6, len(names) - 0.4)
    step = -(-len(names) // 40)
    ax.set_xticks(index[::step], [short(name) for name in names[::step]], rotation=90 if len(names) > 8 else 0)
    ax.set_ylabel("CoMAC")


def draw_fit(
    ax: Axes,
    names: Sequence[str],
    simulated: Sequence[float | None],
    predicted: Sequence[float | None],
    labels: tuple[str, str] = ("simulation", "prediction"),
) -> None:
    """Fit percentages as pairs of bars, `labels` in the key; a missing or negative one is written, not drawn."""
    index = np.arange(len(names))
    groups = ((-0.2, simulated, BLUE, labels[0]), (0.2, predicted, ORANGE, labels[1]))
    known = [group for group in groups if any(v is not None for v in group[1])]
    for place, values, colour, label in known:
        offset = place if len(known) == 2 else 0.0
        height = [max(0.0, v) if v is not None else 0.0 for v in values]
        ax.bar(index + offset, height, 0.38, color=colour, label=label)
        for x, v in zip(index, values, strict=True):
            if v is not None and v >= 0.0 and len(names) <= 12:
                ax.text(x + offset, v + 1.0, f"{v:.1f}", ha="center", va="bottom", fontsize=min(7.0, 60.0 / len(names)))
            if v is None or v < 0.0:
                ax.text(x + offset, 2.0, "n/a" if v is None else f"{v:.3g}", rotation=90, ha="left", va="center",
                        rotation_mode="anchor", fontsize=7)  # fmt: skip
    ax.set_ylim(0.0, 110.0)
    ax.set_yticks(range(0, 101, 20))
    ax.set_xlim(-0.6, len(names) - 0.4)
    room, step = 72.0 * ax.bbox.width / ax.figure.dpi, -(-len(names) // 40)  # points
    slanted = 6.2 * sum(len(short(name)) + 2 for name in names) > room
    ax.set_xticks(
        index[::step], [short(name) for name in names[::step]], rotation=90 if slanted else 0,
        ha="right" if slanted else "center", va="center" if slanted else "top",
        rotation_mode="anchor" if slanted else "default",
    )  # fmt: skip
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
    ax.axhline(0.0, color=EDGE, lw=0.7)
    ax.grid(False, axis="x")
    ax.legend(ncols=len(parts), loc="lower left", bbox_to_anchor=(0.0, 1.0), borderaxespad=0.2)


def draw_markov(ax: Axes, markov: Real, dt: float, pair: tuple[int, int], title: str) -> None:
    """Impulse response Y_1, Y_2 .. of one output and input over time; Y_0 (feed-through) as a dot."""
    out, into = pair
    time = np.arange(len(markov)) * dt
    ax.plot(time[1:], markov[1:, out, into], color=BLUE, lw=1.0)
    ax.plot(time[:1], markov[:1, out, into], "o", ms=4.0, color=ORANGE)
    ax.axhline(0.0, color=EDGE, lw=0.6)
    ax.set_xlim(-0.01 * time[-1], time[-1])
    ax.set_title(title)
