# SPDX-License-Identifier: MIT
"""The section that lays the modes of another result beside those of this one: shifts with ± σ, MAC, CoMAC."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from okid import modal
from okid.report import page
from okid.report.loaded import Loaded
from okid.report.material import Material
from okid.result import figures
from okid.result.comparison import ComparedMode, Comparison, compare

Complex = NDArray[np.complex128]
MOST_MODES = 40  # in the picture


class Other(NamedTuple):
    """The earlier result and its name."""

    result: Loaded
    name: str


def _signed(percent: float, std: float | None, z: float | None) -> list[str]:
    return [f"{percent:+.3f}" + ("" if std is None else f" ± {std:.2g}"), "–" if z is None else f"{z:+.1f}"]


def _tables(found: Comparison) -> list[str]:
    frequencies, dampings = [], []
    for one in found.pairs:
        modes = [f"{one.a.mode}", f"{one.b.mode}"]
        frequencies.append([
            *modes, f"{one.a.frequency_hz:.4f}", f"{one.b.frequency_hz:.4f}",
            *_signed(one.shift_percent, one.shift_std_percent, one.z), "–" if one.mac is None else f"{one.mac:.3f}",
            one.verdict,
        ])  # fmt: skip
        dampings.append([
            *modes, f"{100.0 * one.a.damping_ratio:.3f}", f"{100.0 * one.b.damping_ratio:.3f}",
            *_signed(one.damping_shift_percent, one.damping_shift_std_percent, one.damping_z), one.damping_verdict,
        ])  # fmt: skip
    head = ["mode before", "now"]
    return [
        page.table([*head, "f before [Hz]", "f now [Hz]", "shift [%]", "z", "MAC", "verdict"], frequencies),
        page.table([*head, "ζ before [%]", "ζ now [%]", "shift [% of ζ]", "z", "verdict"], dampings),
    ]


def _alone(modes: list[ComparedMode], where: str) -> list[str]:
    listed = ", ".join(f"{one.mode} ({one.frequency_hz:.4g} Hz)" for one in modes)
    return [page.note(f"Only in {where}: mode {listed}.")] if modes else []


def _shapes(of: Loaded, modes: list[int], names: list[str]) -> Complex:
    return of.shapes[np.ix_([k - 1 for k in modes], [of.places.index(name) for name in names])]


def comparison_section(m: Material) -> page.Section | None:
    """None without an earlier result."""
    if m.other is None:
        return None
    before, now = m.other.result, m.result
    found = compare(before.whole, now.whole)
    raw = found.to_dict()
    title = f"Compared with {m.other.name}"
    parts = _tables(found) if found.pairs else [page.absent("No mode of one is a mode of the other.")]
    parts += [*_alone(found.only_a, f"{m.other.name}, the earlier one"), *_alone(found.only_b, "this result")]
    names = [name for name in raw["channels"] if name in before.places and name in now.places]
    if found.cross_mac.size and names:
        rows, columns = raw["a"]["modes"][:MOST_MODES], raw["b"]["modes"][:MOST_MODES]
        drawing = figures.figure(min(7.4, 2.7 + 0.5 * len(columns)), min(6.6, 1.9 + 0.5 * len(rows)))
        axes = drawing.add_subplot()
        labels = [f"{k}: {before.frequency_hz[k - 1]:.2f} Hz" for k in rows]
        figures.draw_mac(axes, _shapes(before, rows, names), labels, _shapes(now, columns, names))
        axes.set_xlabel("confident mode of this result, in its order")
        parts.append(m.pictures.inline(drawing, "modal assurance criterion of the modes of both results"))
    if found.pairs and len(names) > 1:
        first = _shapes(before, [one.a.mode for one in found.pairs], names)
        second = _shapes(now, [one.b.mode for one in found.pairs], names)
        drawing = figures.figure(max(4.0, min(9.6, 2.0 + 0.6 * len(names))), 2.4)
        figures.draw_comac(drawing.add_subplot(), names, modal.comac(first, second).tolist())
        parts.append(m.pictures.inline(drawing, "coordinate MAC of every common output"))
    words = (
        f"Shift = this result minus {m.other.name}, ± one standard deviation. More than chance: below "
        f"{100 * raw['false_alarm']:g} % over all {raw['tests']} shifts together (Holm; Student's t, "
        f"{raw['degrees_of_freedom']} degrees of freedom). Modes are paired by MAC and frequency at the {len(names)} "
        "outputs that both have. CoMAC: an output that is low in it is where the two differ (a sensor that was moved, "
        "exchanged or is faulty); it does not see signs."
    )
    parts += [page.note(text) for text in [words, *found.warnings]]
    return page.section(title, *parts, name="Comparison")
