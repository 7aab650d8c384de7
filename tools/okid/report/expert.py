# SPDX-License-Identifier: MIT
"""The sections for experts: modal masses, singular values over frequency, Nyquist circles, spectrogram."""

from __future__ import annotations

import numpy as np

from okid._errors import InputError
from okid.abi.host import unit as si_of
from okid.mechanics.modal_mass import modal_masses
from okid.report import page
from okid.report.material import Material
from okid.report.modes import plain
from okid.result import expert_figures, figures
from okid.result.circle import Circle, fit_circle, lines_around

MOST_CIRCLES, A_ROW = 6, 3
OFF_PHASE = 20.0  # degrees beyond which a modal mass is doubtful
_QUANTITIES = {"m/s²": "acceleration", "m/s": "velocity", "m": "displacement"}


def _sensing(m: Material) -> list[str] | None:
    """What each output measures, by its unit; without units accelerations, None where the result mixes quantities."""
    found = []
    for name in m.result.outputs:
        unit = m.unit(name).replace("²", "^2")
        si = (si_of(unit) or (1.0, unit))[1].replace("^2", "²")
        found.append(_QUANTITIES.get(si))
    if all(one is not None for one in found):
        return [str(one) for one in found]
    return None if m.result.raw.get("shape_quantity") else ["acceleration"] * len(found)


def _axis_hz(m: Material) -> float:
    """Upper end of the frequency axes: above the confident modes; a rejected one does not press them together."""
    highest = 2.0 * float(np.max(m.result.frequency_hz[m.result.confident], initial=0.0))
    return min(m.result.shown_hz, highest) if highest > 0.0 else m.result.shown_hz


def _with(value: float, deviation: float | None) -> str:
    return f"{value:.4g}" + ("" if deviation is None else f" ±{deviation:.2g}")


def modal_mass_section(m: Material) -> page.Section | None:
    """None without a drive point."""
    found, rows = modal_masses(m.result.raw), []
    for k in m.result.confident if found else []:
        one = found[k]
        head = [str(k + 1), f"{m.result.frequency_hz[k]:.4f}"]
        if one is None:
            rows.append([*head, *["–"] * 5])
            continue
        scale = 1.0 / np.sqrt(one.mass_kg) if one.mass_kg > 0.0 else None
        sure = one.mass_kg > 0.0 and abs(one.phase_deg) <= OFF_PHASE
        rows.append([*head, _with(one.mass_kg, one.mass_std) + ("" if sure else " ?"),
                     _with(one.stiffness_n_m, one.stiffness_std), _with(one.damping_n_s_m, one.damping_std),
                     plain(scale, ".4g"), f"{abs(one.phase_deg):.1f}"])  # fmt: skip
    if not rows:
        return None
    head = ["mode", "f [Hz]", "mass [kg]", "stiffness [N/m]", "damping [N s/m]", "1/√mass [1/√kg]", "phase [°]"]
    units = all(m.unit(name) for name in m.result.outputs)
    words = "Of the shape whose largest entry is 1, from the residues at the drive point; the shape times 1/√mass is "
    words += "mass-normalised. Phase: how far the residue is from that of a real mode; beyond 20° (?) the mass is "
    words += "doubtful."
    words += "" if units else " Units: if the force is in N and the responses in m/s²."
    return page.section(
        "Modal mass, stiffness and damping", page.table(head, rows), page.note(words), name="Modal mass"
    )


def indicator_section(m: Material) -> page.Section | None:
    """FDD of an ambient record, CMIF of measured responses; None without them."""
    given = m.measured
    if given is None or (given.frf is None and given.spectra is None):
        return None
    if given.frf is not None:
        line, matrices, title = given.frf.frequency_hz, given.frf.response, "Mode indicator (CMIF)"
        of, unit = "measured responses", "singular value"
    else:
        assert given.spectra is not None
        line, matrices, title = given.spectra.frequency_hz, given.spectra.power, "Frequency domain decomposition (FDD)"
        of, unit = "spectra of the outputs", "singular value [unit²/Hz]"
    hz, sure = m.result.frequency_hz.tolist(), m.result.confident
    drawing = figures.figure(9.6, 3.2)
    ax = drawing.add_subplot()
    values = expert_figures.singular_values_over(matrices[1:])
    expert_figures.draw_singular_spectra(
        ax, line[1:], values, min(_axis_hz(m), float(line[-1])), [hz[k] for k in sure],
        [f for k, f in enumerate(hz) if k not in sure],
    )  # fmt: skip
    ax.set_ylabel(unit)
    words = f"Singular values of the {of} at every line. The first peaks at each mode; where the second peaks too, two "
    words += "modes are close. Green: the confident modes, dotted: the doubtful ones."
    picture = m.pictures.inline(drawing, f"singular values of the {of} over frequency")
    return page.section(title, picture, page.note(words), name="FDD" if given.frf is None else "CMIF")


def _circles(m: Material, sensing: list[str]) -> list[tuple[int, int, int, Circle]]:
    """(mode, output, input, circle) of each confident mode whose lines give one, of its strongest pair."""
    assert m.measured is not None and m.measured.frf is not None
    data, out = m.measured.frf, []
    for k in m.result.confident:
        f, zeta = float(m.result.frequency_hz[k]), float(m.result.raw["modes"][k]["damping_ratio"])
        near = lines_around(data.frequency_hz, f, zeta)
        o, i = divmod(int(np.argmax(np.max(np.abs(data.response[near]), axis=0))), data.response.shape[2])
        try:
            found = fit_circle(data.frequency_hz[near], data.response[near, o, i], sensing[o])
        except InputError:
            continue
        out.append((k, o, i, found))
    return out


def circle_section(m: Material) -> page.Section | None:
    """Nyquist circles of the confident modes; None without measured responses."""
    sensing = _sensing(m)
    if m.measured is None or m.measured.frf is None or not m.result.confident or sensing is None:
        return None
    found = _circles(m, sensing)
    if not found:
        return None
    shown, pictures, rows = found[:MOST_CIRCLES], [], []
    for first in range(0, len(shown), A_ROW):
        row = shown[first : first + A_ROW]
        drawing = figures.figure(9.6, 3.4)
        for place, (k, o, _, circle) in enumerate(row, 1):
            ax = drawing.add_subplot(1, A_ROW, place)
            expert_figures.draw_circle(ax, circle, f"mode {k + 1}, {figures.short(m.result.outputs[o])}")
        pictures.append(
            m.pictures.inline(drawing, f"Nyquist circles of modes {', '.join(str(k + 1) for k, *_ in row)}")
        )
    for k, o, i, circle in found:
        zeta = 100.0 * float(m.result.raw["modes"][k]["damping_ratio"])
        pair = f"{figures.short(m.result.outputs[o])} / {figures.short(m.result.inputs[i])}"
        rows.append([str(k + 1), pair, str(len(circle.lines_hz)), f"{circle.frequency_hz:.4f}",
                     f"{m.result.frequency_hz[k]:.4f}", f"{100.0 * circle.damping_ratio:.3f}", f"{zeta:.3f}",
                     f"{100.0 * circle.misfit:.1f}"])  # fmt: skip
    head = ["mode", "pair", "lines", "circle: f [Hz]", "f [Hz]", "circle: ζ [%]", "ζ [%]", "misfit [%]"]
    words = (
        "Mobility (response as velocity per force) of the strongest pair at the lines around each mode, grey, and the "
    )
    words += "circle through them; orange: the resonance. A window and few lines make the damping of the circle too "
    words += "large. Misfit: distance of the lines from the circle over its radius."
    left = len(m.result.confident) - len(found)
    words += f" {page.count_of(left, 'mode')} without a circle: the lines around it show no resonance." if left else ""
    words += f" Pictures: the first {len(shown)}." if len(found) > len(shown) else ""
    return page.section("Nyquist circles", *pictures, page.table(head, rows), page.note(words))


def spectrogram_section(m: Material) -> page.Section | None:
    """Power of the strongest output over time; None without a record, and of hammer tests."""
    record = None if m.measured is None else m.measured.record
    if record is None or m.struck or m.result.raw.get("responses") or not m.result.outputs:
        return None
    places = [m.channels.index(name) for name in m.result.outputs]
    strong = np.nanvar(record.samples[:, places], axis=0)
    o = int(np.nanargmax(strong)) if np.any(np.isfinite(strong)) else 0
    drawing = figures.figure(9.6, 3.2)
    try:
        found = expert_figures.spectrogram_of(record.samples[:, places[o]], m.result.fs)
        expert_figures.draw_spectrogram(drawing.add_subplot(), *found, _axis_hz(m))
    except InputError as fault:
        return page.section("Spectrogram", page.absent(f"The picture is left out: {fault}."))
    name = m.result.outputs[o]
    words = f"Power density of {name}, the output with the largest variance. A mode and a steady machine are level "
    words += "lines; a line that ends, begins or slants is a machine or a change."
    picture = m.pictures.inline(drawing, f"power density of {name} over time and frequency")
    return page.section("Spectrogram", picture, page.note(words))
