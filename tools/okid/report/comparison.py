# SPDX-License-Identifier: MIT
"""The section that lays the modes of another result beside those of this one: table, MAC, CoMAC."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from okid import modal
from okid.report import page
from okid.report.loaded import Loaded
from okid.report.material import Material
from okid.result import figures

Complex = NDArray[np.complex128]
NEAR, ALIKE, MOST_MODES = 0.15, 0.5, 40  # in frequency; MAC


class Other(NamedTuple):
    """Another result and its name."""

    result: Loaded
    name: str


def _common(a: Loaded, b: Loaded) -> tuple[list[str], Complex, Complex]:
    """Places that the shapes of both have, and the shapes of the confident modes at them."""
    names = [name for name in a.places if name in b.places]
    own, other = (
        one.shapes[one.confident][:, [one.places.index(name) for name in names]] if one.confident else
        np.zeros((0, len(names)), np.complex128) for one in (a, b)
    )  # fmt: skip
    return names, own[:MOST_MODES], other[:MOST_MODES]


def pairs_of(a: Loaded, b: Loaded, mac: NDArray[np.float64]) -> list[tuple[int, int]]:
    """Places among the confident modes of both that are one mode: within 15 %, MAC of 0.5 or more, the best first."""
    f, g = a.frequency_hz[a.confident], b.frequency_hz[b.confident]
    ranked = sorted(
        (abs(g[j] / f[i] - 1.0) + 0.2 * (1.0 - mac[i, j]), i, j) for i, j in np.ndindex(mac.shape)
        if abs(g[j] / f[i] - 1.0) < NEAR and mac[i, j] >= ALIKE
    )  # fmt: skip
    out: list[tuple[int, int]] = []
    for _, i, j in ranked:
        if all(i != one and j != two for one, two in out):
            out.append((i, j))
    return sorted(out)


def _table(a: Loaded, b: Loaded, mac: NDArray[np.float64], pairs: list[tuple[int, int]]) -> str:
    rows = []
    for i, j in pairs:
        here, there = a.raw["modes"][a.confident[i]], b.raw["modes"][b.confident[j]]
        f, g = float(here["frequency_hz"]), float(there["frequency_hz"])
        zeta = f"{100.0 * here['damping_ratio']:.3f}", f"{100.0 * there['damping_ratio']:.3f}"
        rows.append([str(a.confident[i] + 1), str(b.confident[j] + 1), f"{f:.4f}", f"{g:.4f}",
                     f"{100.0 * (g / f - 1.0):+.3f}", *zeta, f"{mac[i, j]:.3f}"])  # fmt: skip
    return page.table(["mode", "its mode", "f [Hz]", "its f [Hz]", "change [%]", "ζ [%]", "its ζ [%]", "MAC"], rows)


def comparison_section(m: Material) -> page.Section | None:
    """None without another result."""
    if m.other is None:
        return None
    a, b = m.result, m.other.result
    names, own, other = _common(a, b)
    title = f"Beside {m.other.name}"
    if not names or not len(own) or not len(other):
        words = "no output of the same name" if not names else "a confident mode in one of them only"
        return page.section(title, page.absent(f"There is {words}: nothing can be compared."), name="Comparison")
    mac = modal.mac_matrix(own, other)
    pairs = pairs_of(a, b, mac)
    drawing = figures.figure(min(7.4, 2.7 + 0.5 * len(other)), min(6.6, 1.9 + 0.5 * len(own)))
    labels = [f"{k + 1}: {a.frequency_hz[k]:.2f} Hz" for k in a.confident[:MOST_MODES]]
    axes = drawing.add_subplot()
    figures.draw_mac(axes, own, labels, other)
    axes.set_xlabel("mode of the other result, in its order")
    parts = [_table(a, b, mac, pairs)] if pairs else [page.absent("No mode of one is a mode of the other.")]
    parts.append(m.pictures.inline(drawing, "modal assurance criterion of the modes of both results"))
    if pairs and len(names) > 1:
        first, second = (shapes[[pair[k] for pair in pairs]] for k, shapes in enumerate((own, other)))
        values = modal.comac(first, second)
        drawing = figures.figure(max(4.0, min(9.6, 2.0 + 0.6 * len(names))), 2.4)
        figures.draw_comac(drawing.add_subplot(), names, values.tolist())
        parts.append(m.pictures.inline(drawing, "coordinate MAC of every common output"))
    words = (
        f"Modes of both within {100 * NEAR:.0f} % and with a MAC of {ALIKE} or more at the {len(names)} outputs of one "
        "name. CoMAC: an output that is low in it is where the two differ (a sensor that was moved, exchanged or is "
        "faulty); it does not see signs."
    )
    return page.section(title, *parts, page.note(words), name="Comparison")
