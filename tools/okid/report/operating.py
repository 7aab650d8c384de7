# SPDX-License-Identifier: MIT
"""The section on what an ambient record shows without any model: operating deflection shapes, transmissibilities."""

from __future__ import annotations

import numpy as np

from okid.frf import deflection
from okid.modal import mac
from okid.report import page
from okid.report.material import Material
from okid.result import figures

MOST_CURVES = 4


def operating_section(m: Material) -> page.Section | None:
    """None without the spectra of two outputs or without a confident mode."""
    data = None if m.measured is None else m.measured.spectra
    if data is None or not m.result.confident or len(m.result.outputs) < 2:
        return None
    rows = []
    for k in m.result.confident:
        f = float(m.result.frequency_hz[k])
        line = float(data.frequency_hz[int(np.argmin(np.abs(data.frequency_hz - f)))])
        seen = deflection(data, [f])[0]
        rows.append([str(k + 1), f"{f:.4f}", f"{line:.4f}", f"{mac(seen, m.result.shapes[k]):.3f}"])
    power = np.diagonal(data.power, axis1=1, axis2=2).real
    reference = int(np.argmax(np.sum(power[1:] / np.maximum(np.median(power[1:], axis=0), 1e-300), axis=0)))
    others = [k for k in range(len(m.result.outputs)) if k != reference][:MOST_CURVES]
    drawing = figures.figure(9.6, 2.8)
    ax = drawing.add_subplot()
    shown = (data.frequency_hz > 0.0) & (data.frequency_hz <= m.result.shown_hz)
    for k in others:
        ratio = np.abs(data.power[shown, k, reference]) / np.maximum(power[shown, reference], 1e-300)
        ax.semilogy(data.frequency_hz[shown], ratio, lw=1.0, label=figures.short(m.result.outputs[k], 20))
    for k in m.result.confident:
        ax.axvline(float(m.result.frequency_hz[k]), color=figures.GRID, lw=0.8, zorder=0)
    figures.log_axis(ax)
    ax.set_xlim(0.0, m.result.shown_hz)
    ax.set_xlabel("frequency [Hz]")
    ax.set_ylabel("transmissibility")
    ax.legend(loc="best", ncols=2)
    words = (
        "Operating deflection shape: what moves at the line of the spectrum nearest to the mode, of all modes and "
        "forces together; where one mode rules, it is its shape (MAC near 1). Transmissibility: cross spectrum with "
        f"{m.result.outputs[reference]} over the spectrum of {m.result.outputs[reference]}; thin lines: the modes."
    )
    picture = m.pictures.inline(drawing, "transmissibilities of the outputs")
    table = page.table(["mode", "f [Hz]", "line [Hz]", "MAC of deflection and mode"], rows)
    return page.section("Operating deflection", table, picture, page.note(words), name="Deflection")
