# SPDX-License-Identifier: MIT
"""The sections on order and responses: singular values, stabilization, responses or spectra, impulse response."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from okid._errors import Error
from okid.frf import cmif, synthesise_spectra
from okid.modal import mac
from okid.record.identify_frf import identify_frf
from okid.report import drawings, page
from okid.report.material import Material
from okid.report.response_fit import explained_percent, picture_lines, reach_hz, synthesised_at
from okid.result import figures
from okid.result.shape_places import struck_at
from okid.result.stabilization import Stabilization

Real = NDArray[np.float64]
Complex = NDArray[np.complex128]
MOST_PAIRS = 4
MOST_ROWS = 60  # of the table of pairs


def singular_section(m: Material) -> page.Section:
    """Singular values with the order; why there are none of method "auto"."""
    if len(m.result.singular_values) == 0:
        why = "This method compares many models: there is no one Hankel matrix. Its modes are those they agree on."
        if m.result.raw.get("responses"):
            why = "Modes of frequency responses come from matrix fractions: there is no Hankel matrix."
        return page.section("Singular values", page.absent(why))
    drawing = figures.figure(9.6, 3.0)
    figures.draw_singular_values(drawing.add_subplot(), m.result.singular_values, int(m.result.raw["order"]))
    words = (
        "How strong each further state of a model would be, the largest first. Blue: the "
        f"{int(m.result.raw['order'])} that this model keeps. A step down behind the dashed line says that the order "
        "is clear; without a step, compare the orders in the stabilization diagram."
    )
    picture = m.pictures.inline(drawing, "singular values of the Hankel matrix")
    return page.section("Singular values", picture, page.note(words))


def _background(m: Material) -> tuple[Real, Real] | None:
    """Largest singular value of the measured responses or spectra over frequency."""
    if m.measured is None:
        return None
    if m.measured.frf is not None:
        return m.measured.frf.frequency_hz[1:], cmif(m.measured.frf.response[1:])
    if m.measured.spectra is not None:
        return m.measured.spectra.frequency_hz[1:], np.sqrt(cmif(m.measured.spectra.power[1:]))
    return None


def _how_to_read(m: Material, rows: Stabilization) -> list[str]:
    """The caption of the diagram, for somebody who sees one for the first time."""
    order, tried, limits = int(m.result.raw["order"]), sorted({row.order for row in rows}), rows.criteria
    again, two = "the record was identified again with orders", " (a mode takes two)"
    line = f"Blue dashed line: order {order}, that of the model of this report; green"
    if m.struck or m.result.raw.get("responses"):
        again, two, line = "matrix fractions (pLSCF) were fitted to the measured responses, with degrees", "", "Green"
    apart = len(m.result.frequency_hz) - len(m.result.confident)
    rejected = f" Grey dotted: the {page.count_of(apart, 'doubtful mode')}, with the reason in Modes." if apart else ""
    words = [
        f"How to read it: {again} from {tried[0]} to {tried[-1]}{two}. A mark is a pole: a mode that the model of "
        "this order has at this frequency. Modes of the structure appear at every order and form a column of "
        "green dots; poles of noise scatter.",
        f"{line} vertical lines: the {page.count_of(len(m.result.confident), 'confident mode')} of this report. A "
        "column without a line is a mode that the model lacks (try a higher order), a green line without a column "
        f"deserves a doubt.{rejected}",
        "Marks: a value is stable when the next lower order has a pole near it, within "
        f"{100.0 * limits.frequency:g} % in frequency, {100.0 * limits.damping:g} % in damping and with the same shape "
        f"(MAC ≥ {limits.mac:g}). Green dot: all three are stable. Blue triangle: frequency and shape, the damping "
        "not. Orange diamond: frequency and damping, the shape not. Red cross: the frequency alone. Grey point: none.",
        f"Blue bands: {page.count_of(len(rows.modes), 'column')} found by the program in at least "
        f"{100.0 * limits.share:g} % of the orders, whatever the order used; ring: the pole nearest the medians.",
    ]
    if _background(m) is not None:
        kind = "responses" if m.measured is not None and m.measured.frf is not None else "spectra of the outputs"
        words[-1] += f" Behind: largest singular value of the measured {kind} (CMIF) in dB, without a scale: it peaks "
        words[-1] += "at the resonances."
    return words


def stabilization_section(m: Material) -> page.Section:
    """Poles over frequency and order with the modes of the result."""
    title = "Stabilization diagram"
    if m.measured is None or m.measured.rows is None:
        why = m.needs_record if m.measured is None else "is left out: the responses by themselves give no stable model"
        return page.section(title, page.absent(f"The diagram {why}."), name="Stabilization")
    of_responses = m.struck or bool(m.result.raw.get("responses"))
    drawing = figures.figure(9.6, 4.8)
    behind = _background(m)
    figures.draw_stabilization(
        drawing.add_subplot(),
        m.measured.rows,
        m.result.shown_hz,
        m.result.frequency_hz[m.result.confident].tolist(),
        behind,
        None if of_responses else int(m.result.raw["order"]),
        [f for k, f in enumerate(m.result.frequency_hz.tolist()) if k not in m.result.confident],
    )
    picture = m.pictures.inline(drawing, "poles over frequency and model order")
    return page.section(title, picture, *map(page.note, _how_to_read(m, m.measured.rows)), name="Stabilization")


def choose_pairs(response: Complex, coherence: Real | None) -> list[tuple[int, int]]:
    """Up to four (output, input): the strongest response weighted by coherence, every input once before any twice."""
    power = np.sqrt(np.mean(np.abs(response) ** 2, axis=0))
    scale = np.max(power, axis=1, keepdims=True)
    score = np.divide(power, scale, out=np.zeros_like(power), where=scale > 0.0)
    if coherence is not None and np.any(np.isfinite(coherence)):
        score = score * np.nanmean(coherence, axis=0)[:, None]
    n_y, n_u = score.shape
    order = [divmod(int(k), n_u) for k in np.argsort(-score, axis=None, kind="stable")]
    chosen: list[tuple[int, int]] = []
    for most in range(1, n_y + 1):  # how often an input may appear
        for pair in order:
            fresh = pair not in chosen and all(pair[0] != o for o, _ in chosen)
            if len(chosen) < MOST_PAIRS and fresh and sum(pair[1] == i for _, i in chosen) < most:
                chosen.append(pair)
    for pair in order:
        if len(chosen) < min(MOST_PAIRS, n_y * n_u) and pair not in chosen:
            chosen.append(pair)
    return sorted(chosen)


def in_rows(items: Sequence[Any]) -> list[Sequence[Any]]:
    """Rows of pictures, each drawn by itself: a printed page breaks between them. Up to three a row, else two."""
    columns = len(items) if len(items) <= 3 else 2
    return [items[k : k + columns] for k in range(0, len(items), columns)]


def _frf_title(m: Material, pair: tuple[int, int]) -> str:
    out, into = m.result.outputs[pair[0]], m.result.inputs[pair[1]]
    struck = struck_at(into) if m.struck else None
    units = [m.unit(out), m.unit(into)]
    unit = f"  [({units[0]})/{units[1]}]" if all(units) else ""
    return f"{figures.short(out)} / {figures.short(into) if struck is None else f'place {struck[1]}'}{unit}"


def _frf_words(m: Material, shown: int, with_coherence: bool) -> str:
    measured = m.measured
    total = len(m.result.outputs) * len(m.result.inputs)
    words = f"Magnitude: output unit over input unit. Shown: {shown} of {total} pairs"
    words += ", the strongest with the best coherence and every input." if shown < total else "."
    if measured is not None and measured.frf is None:
        return f"{words} Model only, the measured responses are left out: {measured.no_frf}."
    if measured is None or measured.frf is None:
        return f"{words} Model only. Measured responses: the picture {m.needs_record}."
    data = measured.frf
    if m.result.raw.get("responses"):
        return f"{words} Measured: as the files have them, {len(data.frequency_hz)} lines."
    averages = page.count_of(data.averages, "average")
    words += f" Measured: H1, {averages}, {data.resolution_hz:.3g} Hz lines; multiple coherence."
    return words + ("" if with_coherence else " Too few averages for a coherence.")


def frf_section(m: Material) -> tuple[page.Section, list[tuple[int, int]]]:
    """Frequency responses of the chosen pairs, and which those are."""
    line, model = synthesised_at(m.result, m.result.shown_hz)
    data = None if m.measured is None else m.measured.frf
    pairs = choose_pairs(model if data is None else data.response[1:], None if data is None else data.coherence[1:])
    with_coherence = data is not None and bool(np.any(np.isfinite(data.coherence)))
    heights = [3.0, 1.3, 0.9][: 3 if with_coherence else 2]
    title = "Frequency responses" if data is None else "Frequency responses, measured and synthesised"
    measured = "" if data is None else " and of the files" if m.result.raw.get("responses") else " and of the record"
    pictures = []
    for row in in_rows(pairs):
        drawing = figures.figure(9.6, 3.7)
        grid = drawing.add_gridspec(1, len(in_rows(pairs)[0]))
        for place, pair in enumerate(row):
            cells = grid[0, place].subgridspec(len(heights), 1, height_ratios=heights)
            axes: list[Any] = list(np.asarray(cells.subplots(sharex=True), dtype=object))
            figures.draw_frf(axes, data, line, model, pair)
            axes[0].set_title(_frf_title(m, pair))
            axes[0].set_ylabel("magnitude")
            if data is not None:
                axes[0].legend(loc="best")
            axes[1].set_ylabel("phase [°]")
            if with_coherence:
                axes[2].set_ylabel("coher.")
            axes[-1].set_xlabel("frequency [Hz]")
        named = ", ".join(f"{m.result.outputs[o]} / {m.result.inputs[k]}" for o, k in row)
        pictures.append(m.pictures.inline(drawing, f"frequency responses of the model{measured}: {named}"))
    words = page.note(_frf_words(m, len(pairs), with_coherence))
    return page.section(title, *pictures, words, *_every_pair(m), name="Responses"), pairs


def _every_pair(m: Material) -> list[str]:
    """A table of all responses where the file gave them; the worst of very many."""
    if m.measured is None or m.measured.frf is None or not m.result.raw.get("responses"):
        return []
    explained = explained_percent(m.measured, m.result)
    order = np.argsort(explained, axis=None, kind="stable")
    rows = [
        [m.result.outputs[o], m.result.inputs[k], f"{explained[o, k]:.1f}"]
        for o, k in sorted(divmod(int(one), explained.shape[1]) for one in order[:MOST_ROWS])
    ]
    words = f"Explained: 100 (1 − ‖H − Ĥ‖/‖H‖) up to {reach_hz(m.result):.4g} Hz, Ĥ synthesised from the result."
    if len(order) > len(rows):
        words += f" The {len(rows)} of {len(order)} pairs that fit worst."
    size = len(rows) if len(rows) <= 12 else -(-len(rows) // 3)
    head = ["response", "force", "explained [%]"]
    return [page.beside(*(page.table(head, rows[k : k + size]) for k in range(0, len(rows), size))), page.note(words)]


def _around(m: Material, k: int, line: Real) -> NDArray[np.bool_]:
    """The lines around the resonance of a mode: two half-power widths to either side, at least three lines."""
    f, zeta = float(m.result.frequency_hz[k]), float(m.result.raw["modes"][k]["damping_ratio"])
    return np.abs(line - f) <= max(4.0 * zeta * f, 3.0 * float(line[1] - line[0]))


def check_section(m: Material) -> page.Section | None:
    """Each confident mode against the measured responses: how much of them around it the model explains, and where the
    responses themselves have it. None without measured responses."""
    if m.measured is None or m.measured.frf is None or m.measured.simulated is None or not m.result.confident:
        return None
    data, made, own = m.measured.frf, m.measured.simulated, m.measured.own_modes
    of_responses = bool(m.result.raw.get("responses"))
    if own is None and not of_responses:
        try:
            own = identify_frf(data, band=(0.0, min(m.result.shown_hz, 0.98 * m.result.fs / 2.0))).confident_modes
        except Error:
            own = []
    scale = np.maximum(np.linalg.norm(data.response, axis=0), 1e-300)
    rows = []
    for k in m.result.confident:
        near = _around(m, k, data.frequency_hz)
        whole, left = data.response[near] / scale, (data.response[near] - made.response[near]) / scale
        size = float(np.linalg.norm(whole))
        share = 100.0 * (1.0 - float(np.linalg.norm(left)) / size) if size > 0.0 else 0.0
        f, zeta = float(m.result.frequency_hz[k]), float(m.result.raw["modes"][k]["damping_ratio"])
        row = [str(k + 1), f"{f:.4f}", f"{100.0 * zeta:.3f}", f"{share:.1f} %"]
        if own is None:
            rows.append(row)
            continue
        there = [one for one in own if len(one.shape) == len(m.result.places)]
        close = [one for one in there if abs(one.frequency_hz / f - 1.0) < max(0.02, 2.0 * zeta)]
        best = max(close, key=lambda one: mac(one.shape, m.result.shapes[k]), default=None)
        cells = ["–"] * 3
        if best is not None:
            cells = [f"{best.frequency_hz:.4f}", f"{100.0 * best.damping_ratio:.3f}",
                    f"{mac(best.shape, m.result.shapes[k]):.3f}"]  # fmt: skip
        rows.append([*row, *cells])
    if own is None:
        words = "Explained: 100 (1 − ‖H − Ĥ‖/‖H‖) over two half-power widths around the mode, Ĥ of the result."
        words += " A window makes a measured resonance wider; the damping of the result is without it."
        table = page.table(["mode", "f [Hz]", "ζ [%]", "explained"], rows)
        return page.section("Check in the frequency domain", table, page.note(words), name="Check")
    head = ["mode", "f [Hz]", "ζ [%]", "H1 explained", "f of H1 [Hz]", "ζ of H1 [%]", "MAC"]
    words = (
        "H1 explained: 100 (1 − ‖H − Ĥ‖/‖H‖) over two half-power widths around the mode, Ĥ estimated from the "
        "simulated outputs with the same segments and window, so that leakage is in both. Beside it what the measured "
        "responses give by themselves (pLSCF): their ζ holds the widening by the window where a resonance is only a "
        f"few lines of {data.resolution_hz:.3g} Hz wide."
    )
    return page.section("Check in the frequency domain", page.table(head, rows), page.note(words), name="Check")


def _strongest(power: Complex) -> list[int]:
    """Up to four outputs whose spectra rise highest above their own medians, in their order."""
    own = np.abs(np.diagonal(power, axis1=1, axis2=2))
    rise = np.max(own, axis=0) / np.maximum(np.median(own, axis=0), 1e-300)
    return sorted(int(k) for k in np.argsort(-rise, kind="stable")[:MOST_PAIRS])


def spectra_section(m: Material) -> page.Section:
    """Spectra of the outputs of an ambient record, measured and of the innovation model."""
    title, data = "Spectra of the outputs", None if m.measured is None else m.measured.spectra
    if data is None:
        why = m.needs_record if m.measured is None else f"is left out: {m.measured.no_frf}"
        return page.section(title, page.absent(f"The picture {why}."), name="Spectra")
    assert m.measured is not None
    line = picture_lines(m.result.shown_hz)
    model, usable = m.result.model()
    made = None
    if usable and m.measured.innovation is not None:
        made = synthesise_spectra(model.A, model.K, model.C, m.measured.innovation, model.dt, line)
    shown = _strongest(data.power[1:])
    pictures = []
    for row in in_rows(shown):
        drawing = figures.figure(9.6, 2.7)
        for place, out in enumerate(row, 1):
            ax = drawing.add_subplot(1, len(in_rows(shown)[0]), place)
            drawings.draw_spectra(ax, data, line, made, m.result.shown_hz, out)
            ax.set_title(figures.short(m.result.outputs[out], 30))
            ax.set_xlabel("frequency [Hz]")
            unit = m.unit(m.result.outputs[out])
            ax.set_ylabel(f"PSD [({unit})²/Hz]" if unit else "PSD [unit²/Hz]")
            ax.legend(loc="best")
        named = ", ".join(m.result.outputs[out] for out in row)
        pictures.append(m.pictures.inline(drawing, f"spectra of the outputs of the record: {named}"))
    averages = page.count_of(data.averages, "average")
    words = f"Shown: {len(shown)} of {len(m.result.outputs)} outputs. Measured: Welch, {averages}."
    words += " Model: the innovations through the predictor of the result." if made is not None else ""
    return page.section(title, *pictures, page.note(words), name="Spectra")


def markov_section(m: Material, pairs: Sequence[tuple[int, int]]) -> page.Section | None:
    """Markov parameters of the chosen pairs over time; None when the result has none."""
    if len(m.result.markov) < 2:
        return None
    pictures = []
    for row in in_rows(pairs):
        drawing = figures.figure(9.6, 2.1)
        for place, pair in enumerate(row, 1):
            ax = drawing.add_subplot(1, len(in_rows(pairs)[0]), place)
            figures.draw_markov(ax, m.result.markov, 1.0 / m.result.fs, pair, _frf_title(m, pair))
            ax.locator_params(axis="y", nbins=5)
            ax.set_xlabel("time [s]")
            ax.set_ylabel("Y")
        named = ", ".join(f"{m.result.outputs[o]} / {m.result.inputs[k]}" for o, k in row)
        pictures.append(m.pictures.inline(drawing, f"Markov parameters: {named}"))
    words = "Markov parameters over time; the dot is Y₀ = D, the direct feed-through."
    return page.section("Impulse response", *pictures, page.note(words))
