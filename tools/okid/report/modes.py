# SPDX-License-Identifier: MIT
"""The sections on modes: table, shapes as sticks or on a structure, complexity, AutoMAC."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from okid import modal
from okid.formats.uff import mode_sets, nodes_of, shape_places
from okid.formats.uff_model import structure_text, units_text
from okid.report import drawings, page
from okid.report.material import Material
from okid.result import figures

MOST_SHAPES, MOST_SQUARES = 16, 60


def plain(value: Any, digits: str, factor: float = 1.0) -> str:
    """A number, or a dash."""
    return "–" if value is None else format(float(value) * factor, digits)


def table_section(m: Material) -> page.Section:
    """Frequencies, damping ratios, their deviations and the indicators; doubtful modes apart, with the reason."""
    modes, sure = m.result.raw["modes"], m.result.confident
    if not modes:
        return page.section("Modes", page.absent("The result holds no underdamped mode."))
    parts = [_table(modes, sure, True) if sure else page.absent("This result has no confident mode.")]
    doubtful = [k for k in range(len(modes)) if k not in sure]
    if doubtful:
        words = "Not counted as modes of the structure, and not in the pictures below."
        parts += [page.heading("Doubtful"), _table(modes, doubtful, False), page.note(words)]
    return page.section("Modes", *parts, _save(m), page.note(
        "MPC: phase collinearity of the shape; EMAC: consistency of the mode over the Hankel matrix; CMI: MPC times "
        "EMAC. 1 is best for all three; below 0.5 a mode is probably noise."))  # fmt: skip


def _table(modes: Sequence[dict[str, Any]], shown: Sequence[int], sure: bool) -> str:
    """The modes numbered in `shown`, from 0; not sure: with why."""
    f_std = any(modes[k].get("frequency_std_hz") is not None for k in shown)
    z_std = any(modes[k].get("damping_ratio_std") is not None for k in shown)
    voted = any(modes[k].get("found_in") is not None for k in shown)
    weighed = any(modes[k].get("modal_mass") is not None and "modal_stiffness" not in modes[k] for k in shown)
    head = ["mode", "f [Hz]", *(["± σ [Hz]"] if f_std else []), "ζ [%]", *(["± σ [%]"] if z_std else [])]
    head += ["mass [kg]"] if weighed else []
    head += ["MPC", "EMAC", "CMI", *(["found in"] if voted else []), *([] if sure else ["why doubtful"])]
    rows = []
    for k in shown:
        one = modes[k]
        row = [str(k + 1), plain(one["frequency_hz"], ".4f")]
        row += [plain(one.get("frequency_std_hz"), ".2g")] if f_std else []
        row.append(plain(one["damping_ratio"], ".4f", 100.0))
        row += [plain(one.get("damping_ratio_std"), ".2g", 100.0)] if z_std else []
        row += [plain(one.get("modal_mass"), ".4g")] if weighed else []
        both = one.get("mpc") is not None and one.get("emac") is not None
        cmi = one.get("cmi", float(one["mpc"]) * float(one["emac"]) if both else None)
        row += [plain(one.get("mpc"), ".4f"), plain(one.get("emac"), ".4f"), plain(cmi, ".4f")]
        row += [f"{plain(one.get('found_in'), '.0f', 100.0)} %"] if voted else []
        rows.append(row if sure else [*row, against(one)])
    return page.table(head, rows, "" if sure else "words", [(k + 1, sure) for k in shown])


def against(mode: dict[str, Any]) -> str:
    """The codes of why a mode is doubtful, with their words."""
    codes = [str(code) for code in mode.get("why") or ["noise_shape"]]
    texts = [str(text) for text in mode.get("why_text") or ()]
    return (
        "; ".join(f"{c}: {t}" for c, t in zip(codes, texts, strict=True))
        if len(texts) == len(codes)
        else ", ".join(codes)
    )


def _save(m: Material) -> str:
    """Buttons that save the chosen modes, and what they save."""
    whole = {**m.result.whole, "markov": None, "singular_values": None}
    structure = m.structure
    places = shape_places(m.result.raw) if structure is None else nodes_of(structure.places)
    head = units_text() + ("" if structure is None else structure_text(structure.geometry))
    sets = mode_sets(m.result.raw, places)
    buttons = "".join(
        f'<button type="button" data-save="{kind}">{kind.upper()}</button>' for kind in ("csv", "json", "uff")
    )
    return (
        f'<div class="save"><span class="chosen" role="status"></span><span>Download selected:</span>{buttons}</div>\n'
        + page.data("modes-data", {"result": whole, "uff": {"head": head, "modes": sets}})
    )


def _shown(m: Material, most: int) -> list[int]:
    """The confident modes (without any: all) with the highest EMAC, ascending in frequency."""
    modes = m.result.raw["modes"]
    among = m.result.confident or list(range(len(modes)))
    return sorted(sorted(among, key=lambda k: -float(modes[k].get("emac") or 0.0))[:most])


def _sticks(m: Material) -> list[str]:
    shown = _shown(m, MOST_SHAPES)
    columns = min(4, len(shown)) if len(m.result.places) <= 12 else min(2, len(shown))
    letters = max(len(figures.short(name)) for name in m.result.places)
    height = 1.9 + (0.06 * letters if letters > 6 else 0.0)  # long names stand upright
    pictures = []
    for row in [shown[k : k + columns] for k in range(0, len(shown), columns)]:
        drawing = figures.figure(9.6 if len(m.result.places) > 12 else min(9.6, 3.2 * columns), height)
        for place, k in enumerate(row, 1):
            damping = 100.0 * float(m.result.raw["modes"][k]["damping_ratio"])
            title = f"{k + 1}: {m.result.frequency_hz[k]:.2f} Hz, {damping:.2f} %"
            figures.draw_shape(drawing.add_subplot(1, columns, place), m.result.shapes[k], m.result.places, title)
        named = ", ".join(str(k + 1) for k in row)
        pictures.append(m.pictures.inline(drawing, f"mode shapes against the outputs, modes {named}"))
    along = "the numbers are the places" if m.result.raw.get("shape_dofs") else "outputs in their order"
    words = f"Sign from the real part, largest entry 1, {along}."
    if not np.all(np.isfinite(m.result.shapes[shown])):
        words += " A place without a bar was not measured."
    count = len(m.result.confident)
    if count > len(shown):
        words += f" The {len(shown)} of {count} confident modes with the highest EMAC are shown."
    return [*pictures, page.note(words)]


def _rounded(values: Any) -> list[float | None]:
    """As JSON has them; an entry that was not measured is null."""
    return [round(float(x), 5) if np.isfinite(x) else None for x in values]


def _player(m: Material) -> list[str]:
    """Moving shapes on the screen, all modes; on paper a still picture of each."""
    structure, result = m.structure, m.result
    assert structure is not None
    geometry, chosen = structure.geometry, _shown(m, len(result.shapes))
    names = [f"{k + 1}: {result.frequency_hz[k]:.2f} Hz" for k in chosen]
    buttons = "\n".join(
        f'<button type="button" data-mode="{place}" aria-pressed="{"false" if place else "true"}">{name}</button>'
        for place, name in enumerate(names)
    )
    others = "".join(f'<option value="{place}">{name}</option>' for place, name in enumerate(names))
    saves = "".join(
        f'<button type="button" data-picture="{kind}">{kind.upper()}</button>' for kind in ("gif", "png", "svg")
    )
    payload = {
        "geometry": {
            "nodes": geometry.nodes, "lines": geometry.lines, "surfaces": geometry.surfaces, "fixed": structure.at_rest,
            "dofs": structure.places, "names": result.places,
        },
        "shapes": [
            {"re": _rounded(shape.real), "im": _rounded(shape.imag), "name": name}
            for shape, name in zip(result.shapes[chosen], names, strict=True)
        ],
    }  # fmt: skip
    live = (
        f'<div class="player"><div class="bar" role="group" aria-label="mode">\n'
        f'<button type="button" class="go">Pause</button>\n{buttons}</div>\n'
        '<canvas tabindex="0" role="img" aria-label="moving mode shape"></canvas>\n'
        f'<div class="bar below"><label>beside it <select class="other"><option value="-1">nothing</option>{others}'
        '</select></label><label><input type="checkbox" class="arrows"> arrows</label>'
        f"<span>Download:</span>{saves}</div>\n"
        '<p class="note">Drag or arrow keys: turn; +, − and the wheel: zoom; space: stop; Home: the first view.</p>'
        "</div>\n" + page.data("shapes-data", payload)
    )
    return [live, *_stills(m, chosen, names), page.note(_moved(m))]


def _stills(m: Material, chosen: Sequence[int], names: Sequence[str]) -> list[str]:
    """The structure in each mode, a row of pictures each."""
    assert m.structure is not None
    columns = min(3, len(chosen)) if len(chosen) != 4 else 2
    out = []
    for first in range(0, len(chosen), columns):
        drawing = figures.figure(9.6 if columns > 1 else 5.0, 3.0 if columns > 1 else 3.6)
        for place, k in enumerate(chosen[first : first + columns]):
            ax = drawing.add_subplot(1, columns, place + 1)
            drawings.draw_at_rest_and_moved(ax, m.structure, m.result.shapes[k])
            ax.set_title(names[first + place])
        shown = ", ".join(names[first : first + columns])
        out.append(m.pictures.inline(drawing, f"still pictures of the mode shapes {shown}", "still"))
    return out


def _moved(m: Material) -> str:
    """What the picture of the structure shows, by the rule of okid.data.structure_motion."""
    structure, shapes = m.structure, m.result.shapes
    assert structure is not None
    words = "Dashed: at rest."
    sensor = np.array([structure.measured(shape) for shape in shapes])
    at_rest = np.zeros(sensor.shape[1], dtype=np.bool_)
    at_rest[[node - 1 for node in structure.at_rest]] = True
    follow = int(np.sum(~np.all(sensor, axis=0) & ~at_rest))
    if follow:
        words += (
            f" {follow} of {sensor.shape[1]} nodes are not measured in every mode (rings): each follows its neighbours."
        )
    absent = [name for name, place in zip(m.result.places, structure.places, strict=True) if place is None]
    return words + (f" Not on the geometry: {', '.join(absent)}." if absent else "")


def shape_sections(m: Material) -> list[page.Section]:
    """Nothing without modes."""
    if not len(m.result.shapes):
        return []
    moving = _player(m) if m.structure is not None else []
    parts = [
        *moving,
        *([page.heading("By place" if m.result.raw.get("shape_dofs") else "By output")] if moving else []),
        *_sticks(m),
    ]
    out = [page.section("Mode shapes", *parts, name="Shapes")]
    if len(m.result.places) < 2:
        return out
    return [*out, _complexity(m), _automac(m)]


def _complexity(m: Material) -> page.Section:
    shown = _shown(m, MOST_SHAPES)
    columns = min(6, len(shown))
    bands = -(-len(shown) // columns)
    drawing = figures.figure(1.6 * columns, 1.75 * bands)
    for place, k in enumerate(shown, 1):
        figures.draw_compass(
            drawing.add_subplot(bands, columns, place),
            m.result.shapes[k],
            f"{k + 1}: {m.result.frequency_hz[k]:.2f} Hz",
        )
    words = (
        "Every entry of a shape in the complex plane: proportionally damped structures lie on one line. MPD: mean "
        "deviation from that line; MCF = 1 − MPC; both 0 for a real mode."
    )
    if len(m.result.confident) > len(shown):
        words += f" Pictures: {len(shown)} of {len(m.result.confident)} confident modes, those with the highest EMAC."
    rows = [
        [str(k + 1), f"{m.result.frequency_hz[k]:.2f}", f"{modal.mpd(m.result.shapes[k]):.1f}",
         f"{modal.mcf(m.result.shapes[k]):.4f}"]
        for k in m.result.confident
    ]  # fmt: skip
    table = page.table(["mode", "f [Hz]", "MPD [°]", "MCF"], rows) if rows else ""
    picture = m.pictures.inline(drawing, "entries of the shapes in the complex plane")
    return page.section("Complexity", picture, table, page.note(words))


def _automac(m: Material) -> page.Section:
    shown = _shown(m, MOST_SQUARES)
    size = min(6.6, 1.9 + 0.5 * len(shown))
    drawing = figures.figure(size + 0.8, size)
    labels = [f"{k + 1}: {m.result.frequency_hz[k]:.2f} Hz" for k in shown]
    figures.draw_mac(drawing.add_subplot(), m.result.shapes[shown], labels)
    words = "MAC of every pair of modes: full ink is 1 (the same shape), no ink 0. Off the diagonal it should be pale."
    places = len(m.result.places)
    if places < len(shown) or places < 3:
        words = (
            f"MAC of every pair of modes, seen at {places} places only: at most {places} shapes can be told apart with "
            "so few sensors, so that a high value here does not say that two modes are one."
        )
    if len(m.result.confident) > len(shown):
        words += f" Shown: {len(shown)} of {len(m.result.confident)} confident modes, those with the highest EMAC."
    picture = m.pictures.inline(drawing, "modal assurance criterion of every pair of modes")
    return page.section("AutoMAC", picture, page.note(words))
