# SPDX-License-Identifier: MIT
"""Pictures for experts, drawn into axes that the caller owns: singular values over frequency (FDD, CMIF), spectrogram,
Nyquist circle, coherence."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import to_rgb
from numpy.typing import ArrayLike, NDArray

from okid._errors import InputError
from okid.result.circle import Circle
from okid.result.figure_numbers import state_numbers
from okid.result.figures import BLUE, DARK, EDGE, FAINT, GREEN, GREY, ORANGE, log_axis

Real = NDArray[np.float64]
MOST_CURVES = 4  # singular values, coherences
STEPS_TIME, STEPS_FREQUENCY, LEVELS = 72, 64, 9  # of a spectrogram


def singular_values_over(matrices: ArrayLike) -> Real:
    """Singular values (F, k), the largest first, of matrices (F, n, m) of spectra or responses."""
    return np.asarray(np.linalg.svd(np.asarray(matrices, dtype=np.complex128), compute_uv=False), dtype=np.float64)


def draw_singular_spectra(
    ax: Axes,
    frequency_hz: Real,
    values: Real,
    shown_hz: float,
    confident_hz: Sequence[float] = (),
    doubtful_hz: Sequence[float] = (),
) -> None:
    """Singular values (F, k) of spectra or responses up to `shown_hz`; lines mark the modes, dotted the doubtful."""
    for k, f in enumerate(confident_hz):
        ax.axvline(f, color=GREEN, lw=0.8, alpha=0.6, label=None if k else "mode")
    for k, f in enumerate(doubtful_hz):
        ax.axvline(f, color=GREY, lw=0.9, ls=":", label=None if k else "doubtful mode")
    seen = (frequency_hz > 0.0) & (frequency_hz <= shown_hz)
    colours = (BLUE, ORANGE, GREY, FAINT)
    for k in range(min(values.shape[1], MOST_CURVES)):
        one, width = np.maximum(values[seen, k], 1e-300), 1.1 if k == 0 else 0.8
        ax.semilogy(frequency_hz[seen], one, color=colours[k], lw=width, label=f"singular value {k + 1}")
    largest = float(np.max(values[seen, 0], initial=0.0))
    shown = values[seen, : min(values.shape[1], 2)]
    ax.set_ylim(max(float(np.min(shown[shown > 0.0], initial=largest)), 1e-9 * largest) * 0.5, 3.0 * largest)
    ax.set_xlim(0.0, shown_hz)
    log_axis(ax)
    ax.set_xlabel("frequency [Hz]")
    ax.legend(ncols=3, loc="lower left", bbox_to_anchor=(0.0, 1.0), borderaxespad=0.2)


def spectrogram_of(y: ArrayLike, fs: float) -> tuple[Real, Real, Real]:
    """Times (T,) in s, frequencies (F,) in Hz and one-sided power density (F, T) in unit^2/Hz of a signal (N,).

    Hann segments that halve the resolution of time and frequency between them; NaN: a segment with a missing sample.
    InputError for fewer than 256 samples.
    """
    data = np.asarray(y, dtype=np.float64)
    if data.ndim != 1 or len(data) < 256:
        raise InputError(f"a spectrogram takes 256 samples of one channel or more, found shape {data.shape}")
    length = int(np.clip(2 ** round(np.log2(np.sqrt(16.0 * len(data)))), 64, 8192))
    step = max(length // 4, -(-(len(data) - length) // (4 * STEPS_TIME)))
    starts = np.arange(0, len(data) - length + 1, step)
    window = np.hanning(length + 1)[:-1]
    power = np.empty((length // 2 + 1, len(starts)))
    for k, first in enumerate(starts):
        piece = data[first : first + length]
        power[:, k] = np.abs(np.fft.rfft((piece - piece.mean()) * window)) ** 2
    power *= 2.0 / (fs * float(np.sum(window**2)))
    times = np.asarray((starts + length / 2.0) / fs, dtype=np.float64)
    return times, np.arange(len(power), dtype=np.float64) * (fs / length), power


def _coarser(values: Real, rows: int, columns: int) -> tuple[Real, Real, Real]:
    """Means over blocks, and the (fractional) numbers of their middles, at most so many rows and columns."""
    down, across = -(-values.shape[0] // rows), -(-values.shape[1] // columns)
    whole = values[: values.shape[0] // down * down, : values.shape[1] // across * across]
    blocks = whole.reshape(whole.shape[0] // down, down, whole.shape[1] // across, across).mean(axis=(1, 3))
    return (blocks, (np.arange(blocks.shape[0]) + 0.5) * down - 0.5, (np.arange(blocks.shape[1]) + 0.5) * across - 0.5)


def draw_spectrogram(ax: Axes, time_s: Real, frequency_hz: Real, power: Real, shown_hz: float) -> None:
    """Power density (F, T) over time and frequency up to `shown_hz` in dB below its largest value."""
    seen = (frequency_hz > 0.0) & (frequency_hz <= shown_hz)
    small, down, across = _coarser(power[seen], STEPS_FREQUENCY, STEPS_TIME)
    if min(small.shape) < 2 or not np.any(np.isfinite(small)):
        raise InputError("the record has no stretch that is long enough and complete")
    level = 10.0 * np.log10(np.maximum(small, 1e-30) / max(float(np.nanmax(small)), 1e-30))
    low = float(np.clip(np.nanpercentile(level, 5.0), -90.0, -20.0))
    f = np.interp(down, np.arange(int(np.sum(seen))), frequency_hz[seen])
    t = np.interp(across, np.arange(len(time_s)), time_s)
    steps = np.linspace(low, 0.0, LEVELS)
    inks = [
        (*to_rgb(BLUE), float(share)) for share in np.linspace(0.06, 1.0, LEVELS - 1)
    ]  # one ink, as the page has it
    ax.contourf(t, f, np.ma.masked_invalid(np.clip(level, low, 0.0)), levels=steps, colors=inks)
    ax.set_xlabel("time [s]")
    ax.set_ylabel("frequency [Hz]")
    ax.grid(False)
    step = -low / (len(steps) - 1)
    ax.set_title(f"from {low:.0f} dB (pale) to 0 dB (dark), {step:.0f} dB a step".replace("-", "−"))
    state_numbers(ax, [("power density [dB]", float(t[j]), float(f[i]), float(level[i, j]))
                       for i in range(level.shape[0]) for j in range(level.shape[1])])  # fmt: skip


def draw_circle(ax: Axes, found: Circle, title: str = "") -> None:
    """Mobility of the lines around a mode in the complex plane, the circle through them and its resonance."""
    around = found.centre + found.radius * np.exp(1j * np.linspace(0.0, 2.0 * np.pi, 181))
    ax.plot(around.real, around.imag, color=BLUE, lw=1.0, label="circle")
    ax.plot(found.mobility.real, found.mobility.imag, ".-", color=GREY, lw=0.6, ms=5.0, label="measured lines")
    ax.plot([found.centre.real, found.resonance.real], [found.centre.imag, found.resonance.imag], color=ORANGE, lw=1.0)
    ax.plot([found.resonance.real], [found.resonance.imag], "o", color=ORANGE, ms=5.0, label="resonance")
    ax.axhline(0.0, color=EDGE, lw=0.6)
    ax.axvline(0.0, color=EDGE, lw=0.6)
    every = np.concatenate([around, found.mobility])
    middle = complex((every.real.min() + every.real.max()) / 2.0, (every.imag.min() + every.imag.max()) / 2.0)
    reach = 0.55 * max(float(np.ptp(every.real)), float(np.ptp(every.imag)))
    ax.set_xlim(middle.real - reach, middle.real + reach)
    ax.set_ylim(middle.imag - reach, middle.imag + reach)
    ax.set_aspect("equal")
    ax.locator_params(nbins=4)
    ax.set_xlabel("Re mobility")
    ax.set_ylabel("Im mobility")
    ax.set_title(title, color=DARK)


def draw_coherence(ax: Axes, frequency_hz: Real, coherence: Real, names: Sequence[str], shown_hz: float) -> None:
    """Multiple coherence (F, n_y) of up to four outputs."""
    seen = (frequency_hz > 0.0) & (frequency_hz <= shown_hz)
    for k, (name, colour) in enumerate(zip(names, (BLUE, ORANGE, GREEN, GREY), strict=False)):
        ax.plot(frequency_hz[seen], coherence[seen, k], color=colour, lw=0.9, label=name)
    ax.set_xlim(0.0, shown_hz)
    ax.set_ylim(0.0, 1.05)
    ax.set_xlabel("frequency [Hz]")
    ax.set_ylabel("coherence")
    ax.legend(ncols=4, loc="lower left", bbox_to_anchor=(0.0, 1.0), borderaxespad=0.2)
