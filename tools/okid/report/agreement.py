# SPDX-License-Identifier: MIT
"""The sections on how well the model explains the record: fit, time histories, whiteness of what is left over."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from okid.report import drawings, page
from okid.report.loaded import known_fit
from okid.report.material import Material
from okid.report.residual import BOUND_95, Whiteness
from okid.result import figures

MOST_SHOWN = 4


def fit_section(m: Material) -> page.Section:
    """Fit percentages of every output: of the record when it is given, else those of the result."""
    names = m.result.outputs
    parts = [known_fit(m.result.raw, key) for key in ("simulation_percent", "prediction_percent")]
    origin = ""
    if m.measured is not None and m.measured.fit is not None:
        made, kind = m.measured.fit, 0 if m.result.inputs else 1
        known = [value for value in parts[kind] if value is not None]
        parts = [[part[name] for name in names] for part in (made.simulation_percent, made.prediction_percent)]
        own = ": the result itself has none"
        if known:
            ends = dict.fromkeys(f"{value:.1f}" for value in (min(known), max(known)))
            own = f"; the result itself says {' to '.join(ends)} %"
        origin = f" Computed by this report from {m.measured.source}{own}."
    if all(value is None for part in parts for value in part):
        if m.result.raw.get("set_ups"):
            words = "Modes of several set-ups have no fit of their own: see the report of each set-up."
        elif m.measured is None:
            words = f"The result holds no fit (a live result keeps no record): the picture {m.needs_record}."
        else:
            words = "The result holds no fit (a live result keeps no record), nor does the record give one."
        return page.section("Fit", page.absent(words))
    drawing = figures.figure(max(4.0, min(9.6, 2.0 + 0.6 * len(names))), 3.0)
    names_of = ("of the modes", "prediction") if m.result.raw.get("responses") else ("simulation", "prediction")
    figures.draw_fit(drawing.add_subplot(), names, parts[0], parts[1], names_of)
    words = "100 (1 − ‖y − ŷ‖ / ‖y − mean‖). Simulation: from input and initial state; prediction: one step ahead."
    if m.result.raw.get("responses"):
        words = "100 (1 − ‖H − Ĥ‖ / ‖H‖) of the responses of each output over the band of the result, Ĥ of its modes."
    title = "Fit, computed by this report" if origin else "Fit"
    picture = m.pictures.inline(drawing, "fit percentage of each output")
    return page.section(title, picture, page.note(words + origin), name="Fit")


def _listed(pairs: Sequence[tuple[int, int]], count: int) -> list[int]:
    """Outputs of the chosen responses first, up to four."""
    order = [out for out, _ in pairs] + list(range(count))
    return sorted(list(dict.fromkeys(order))[:MOST_SHOWN])


def history_section(m: Material, pairs: Sequence[tuple[int, int]]) -> page.Section | None:
    """Measured and simulated (ambient: predicted) responses over time with their difference; None without a record."""
    if m.measured is None or m.result.raw.get("responses"):
        return None
    title, excerpt = "Time histories, measured and modelled", m.measured.excerpt
    if excerpt is None:
        words = "The model gives no response to lay over the record (it is unstable, or no stretch is long enough)."
        return page.section(title, page.absent(words), name="Time histories")
    shown = _listed(pairs, len(m.result.outputs))
    pictures = []
    for place, out in enumerate(shown):
        drawing = figures.figure(9.6, 2.1 if 0 < place < len(shown) - 1 else 2.3)
        ax, error = drawing.subplots(2, 1, height_ratios=[2.4, 1.1])
        drawings.draw_overlay(ax, error, excerpt, out)
        ax.set_ylabel(m.with_unit(m.result.outputs[out]))
        error.set_ylabel("error")
        if place == 0:
            ax.legend(ncols=2, loc="lower right", bbox_to_anchor=(1.0, 1.0), borderaxespad=0.1)
        if place == len(shown) - 1:
            error.set_xlabel("time [s]")
        pictures.append(m.pictures.inline(drawing, f"measured and modelled {m.result.outputs[out]} over time"))
    kind = "simulated from the inputs alone" if excerpt.simulated else "predicted one sample ahead"
    where = "around the hardest hit" if excerpt.hit else "where the responses are largest"
    where += f" ({excerpt.file})" if excerpt.file else ""
    words = f"{len(excerpt.time_s)} samples {where}, {kind}. Shown: {len(shown)} of {len(m.result.outputs)} outputs."
    return page.section(title, *pictures, page.note(words), name="Time histories")


def _white_rows(m: Material, white: Whiteness) -> list[list[str]]:
    rows = []
    for k, name in enumerate(m.result.outputs):
        lag = int(np.argmax(np.abs(white.auto[1:, k]))) + 1
        within = 100.0 * float(np.mean(np.abs(white.auto[1:, k]) <= BOUND_95 / np.sqrt(float(white.used[k]))))
        row = [name, f"{white.rms[k]:.3g}", f"{white.auto[lag, k]:+.3f} at {lag}", f"{within:.0f} %"]
        row.append("< 0.0001" if white.p_value[k] < 1e-4 else f"{white.p_value[k]:.2g}")
        verdict = white.verdict(k)
        past = [white.beyond(k, into) for into in range(white.cross.shape[2])]
        if past:
            most = max(hits for hits, _ in past)
            row.append(f"{most} of {white.lags + 1}")
            left = "inputs" if any(hits > allowed for hits, allowed in past) else "no input"
            verdict += f"; {left} left in it"
        rows.append([*row, verdict])
    return rows


def _worst(white: Whiteness) -> list[int]:
    """Up to four outputs with the largest correlations, in their order."""
    largest = np.max(np.abs(white.auto[1:]), axis=0)
    return sorted(int(k) for k in np.argsort(-largest, kind="stable")[:MOST_SHOWN])


def _white_pictures(m: Material, white: Whiteness) -> list[str]:
    """A row each."""
    shown, n_u = _worst(white), len(m.result.inputs)
    columns = 2 if n_u else min(2, len(shown))
    a_row = 1 if n_u else columns
    rows = [shown[k : k + a_row] for k in range(0, len(shown), a_row)]
    pictures = []
    for row in rows:
        drawing = figures.figure(9.6, 1.95 if row is rows[-1] else 1.75)
        for place, out in enumerate(row):
            name = figures.short(m.result.outputs[out])
            ax = drawing.add_subplot(1, columns, place + 1)
            drawings.draw_autocorrelation(ax, white, out)
            ax.set_title(f"residual of {name} with itself")
            if n_u:
                into = int(np.argmax(np.max(np.abs(white.cross[:, out]), axis=0)))
                other = drawing.add_subplot(1, columns, 2)
                drawings.draw_cross(other, white, out, into)
                other.set_title("with the force" if m.struck else f"with input {figures.short(m.result.inputs[into])}")
        for one in drawing.axes if row is rows[-1] else ():
            one.set_xlabel("lag [samples]")
        named = ", ".join(m.result.outputs[out] for out in row)
        pictures.append(m.pictures.inline(drawing, f"correlations of the residual of {named}"))
    return pictures


def residual_section(m: Material) -> page.Section | None:
    """Correlations of the innovation with itself and with the inputs; None without a record."""
    if m.measured is None or m.result.raw.get("responses"):
        return None
    title, white = "Residual: is it noise?", m.measured.whiteness
    if white is None:
        words = "The result has no stable predictor, or the record is too short: no residual to look at."
        return page.section(title, page.absent(words), name="Residual")
    head = ["output", "rms", "largest ρ, lag", "within 95 %", "p-value"]
    head += ["inputs beyond 99 %"] if m.result.inputs else []
    words = (
        "Residual: the error of the one-step prediction. Band: 95 %, dashed: 99 % bounds of white noise. p-value: "
        f"Ljung-Box over {white.lags} lags; below 0.01 the residual is not white; nearly white when all correlations "
        "are below 0.1 (they explain less than 1 %). With more samples this test detects smaller effects."
    )
    if m.result.inputs:
        words += (
            " With an input: lags ≥ 0 are responses the model misses, negative ones feedback from the response to the "
            "force. Shown: the input with the largest correlation."
        )
    if m.measured.excerpt is not None and m.measured.excerpt.hit:
        words += " The force is a hit: its bounds are rough."
    if len(m.result.outputs) > MOST_SHOWN:
        words += f" Pictures: the {MOST_SHOWN} outputs with the largest correlations."
    rows = page.table([*head, "verdict"], _white_rows(m, white), "words")
    return page.section(title, rows, *_white_pictures(m, white), page.note(words), name="Residual")
