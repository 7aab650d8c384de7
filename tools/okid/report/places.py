# SPDX-License-Identifier: MIT
"""The sections of a test of many files: every hit with its verdict, responses of each place, sensors of each set-up."""

from __future__ import annotations

from html import escape
from typing import Any

import numpy as np
from numpy.typing import NDArray

from okid.frf import Frf
from okid.report import drawings, page
from okid.report.material import Material
from okid.report.page import count_of
from okid.report.response_fit import explained_percent, reach_hz, synthesised_at
from okid.report.struck import name_of_hit
from okid.result import figures
from okid.result.shape_places import struck_at

Real = NDArray[np.float64]
MOST_DRIVE, MOST_SMALL, MOST_OPEN = (
    4,
    24,
    40,
)  # whole pictures of drive points, small pictures, hits that are not folded
GOOD_COHERENCE = 0.9


def _verdict(hit: dict[str, Any]) -> str:
    reason = hit.get("reason")
    if not hit.get("accepted"):
        return f"left out: {reason or 'not said'}"
    return f"used, though {reason}" if reason else "used"


def _seen(hit: dict[str, Any]) -> str:
    """The words of the verdict; of a good hit what is worth knowing beside its numbers."""
    text = str(hit.get("text") or "")
    return text if hit.get("reason") else text.partition("; ")[2]


def _hit_rows(hits: list[dict[str, Any]], unit: str) -> tuple[list[str], list[list[str]]]:
    def shown(value: Any, form: str, factor: float = 1.0) -> str:
        return format(float(value) * factor, form) if isinstance(value, int | float) else "–"

    head = [
        "place",
        "file",
        f"peak [{unit}]" if unit else "peak",
        "width [ms]",
        "up to [Hz]",
        "verdict",
        "what was seen",
    ]
    rows = [
        [str(hit.get("place", "–")), name_of_hit(hit), shown(hit.get("peak"), ".4g"),
         shown(hit.get("duration_s"), ".2f", 1e3), shown(hit.get("band_hz"), ".4g"), _verdict(hit),
         _seen(hit)]
        for hit in hits
    ]  # fmt: skip
    return head, rows


def hits_section(m: Material) -> page.Section | None:
    """Those left out first, then all of them. None for a result without hits."""
    hits: list[dict[str, Any]] = list(m.result.raw.get("hits") or [])
    if not hits:
        return None
    force = m.unit(m.result.inputs[0]) if m.result.inputs else ""
    left = [hit for hit in hits if not hit.get("accepted")]
    places = len({abs(int(hit.get("place") or 0)) for hit in hits})
    words = f"{len(hits) - len(left)} of {len(hits)} hits at {count_of(places, 'place')} were used."
    parts = [page.note(words)]
    if left:
        parts += [page.heading("Left out"), page.table(*_hit_rows(left, force), "hits")]
    table = page.table(*_hit_rows(hits, force), "hits")
    if len(hits) > MOST_OPEN:
        name = escape(f"All {len(hits)} hits (folded; not printed)")
        parts.append(f"<details><summary>{name}</summary>{table}</details>")
    elif len(left) < len(hits):
        parts += [page.heading("All hits"), table]
    parts.append(page.note(
        "Width: time above 10 % of the peak. Up to: frequency where the spectrum of the force has fallen by 20 dB; "
        "modes above it are hardly excited. A hit that is left out is in no average and in no mode."
    ))  # fmt: skip
    return page.section("Hits", *parts)


def _place(name: str) -> str:
    return str((struck_at(name) or (name, name))[1])


def _drive_points(m: Material) -> list[tuple[int, int]]:
    """(output, place) of the sensors at places that were struck."""
    dofs = m.result.raw.get("output_dofs") or []
    places = [_place(name) for name in m.result.inputs]
    return [(o, places.index(str(abs(dof)))) for o, dof in enumerate(dofs) if str(abs(dof)) in places][:MOST_DRIVE]


def _chosen(m: Material, explained: Real) -> list[tuple[int, int, str]]:
    """Pairs that are shown whole, with what they are: drive points, the best and the worst of the others."""
    out = [(o, k, "drive point") for o, k in _drive_points(m)]
    known = {(o, k) for o, k, _ in out}
    order = [divmod(int(k), explained.shape[1]) for k in np.argsort(-explained, axis=None, kind="stable")]
    others = [pair for pair in order if pair not in known]
    if others:
        out.append((*others[0], "best fit"))
    if len(others) > 1:
        out.append((*others[-1], "worst fit"))
    return out


def _one(frf: Frf, coherence: Real, k: int) -> Frf:
    """The responses of one place."""
    return frf._replace(response=frf.response[:, :, [k]], coherence=coherence[:, :, k])


def _whole(m: Material, chosen: list[tuple[int, int, str]], frf: Frf, coherence: Real, line: Real, model: Any) -> str:
    with_coherence = bool(np.any(np.isfinite(coherence)))
    heights = [3.0, 1.3, 0.9][: 3 if with_coherence else 2]
    drawing = figures.figure(9.6, 3.7)
    grid = drawing.add_gridspec(1, 2 if len(chosen) > 1 else 1)
    for cell, (o, k, what) in enumerate(chosen[:2]):
        cells = grid[0, cell].subgridspec(len(heights), 1, height_ratios=heights)
        axes: list[Any] = list(np.asarray(cells.subplots(sharex=True), dtype=object))
        drawings.draw_estimators(axes, _one(frf, coherence, k), line, model[:, :, [k]], o)
        place = f"place {_place(m.result.inputs[k])}"
        axes[0].set_title(f"{figures.short(m.result.outputs[o])} / {place} ({what})")
        unit, force = m.unit(m.result.outputs[o]), m.unit(m.result.inputs[k])
        axes[0].set_ylabel(f"[({unit})/{force}]" if unit and force else "magnitude")
        axes[0].legend(loc="best", ncols=2)
        axes[1].set_ylabel("phase [°]")
        if with_coherence:
            axes[2].set_ylabel("coher.")
        axes[-1].set_xlabel("frequency [Hz]")
    text = "averaged frequency responses of the places over those of the model: "
    text += ", ".join(f"{m.result.outputs[o]} / place {_place(m.result.inputs[k])}" for o, k, _ in chosen[:2])
    rest = _whole(m, chosen[2:], frf, coherence, line, model) if len(chosen) > 2 else ""
    return m.pictures.inline(drawing, text) + rest


def _small(m: Material, places: list[int], o: int, frf: Frf, line: Real, model: Any) -> str:
    columns = min(4, len(places))
    bands = -(-len(places) // columns)
    drawing = figures.figure(9.6, 1.5 * bands)
    seen = (frf.frequency_hz > 0.0) & (frf.frequency_hz <= line[-1])
    low = 0.3 * min(float(np.min(np.abs(model[:, o, k]))) for k in places)
    high = 2.0 * max(float(np.max(np.abs(frf.response[seen, o, k]))) for k in places)
    for cell, k in enumerate(places, 1):
        ax = drawing.add_subplot(bands, columns, cell)
        f, size = drawings.thinned_peaks(frf.frequency_hz[seen], np.abs(frf.response[seen, o, k]))
        ax.semilogy(f, size, color=figures.GREY, lw=1.0)
        ax.semilogy(line[::3], np.abs(model[::3, o, k]), color=figures.BLUE, lw=0.9)
        ax.set_xlim(0.0, float(line[-1]))
        ax.set_ylim(max(low, 1e-6 * high), high)
        figures.log_axis(ax)
        ax.tick_params(labelsize=7.0, labelleft=(cell - 1) % columns == 0, labelbottom=cell > len(places) - columns)
        ax.set_title(f"place {_place(m.result.inputs[k])}", fontsize=8.0)
    return m.pictures.inline(drawing, "responses of every place, measured and of the model")


def _table(m: Material, explained: Real, coherence: Real, used: NDArray[np.bool_], averages: list[int]) -> str:
    outputs = m.result.outputs
    own = outputs if len(outputs) <= 4 else []
    head = ["place", "hits", *(f"explained {figures.short(name)} [%]" for name in own)]
    head += ([] if own else ["explained, least [%]"]) + ["coherence", f"lines above {GOOD_COHERENCE:g} [%]"]
    rows = []
    for k, name in enumerate(m.result.inputs):
        values = coherence[used, :, k]
        known = averages[k] > 1 and bool(np.any(np.isfinite(values)))
        row = [_place(name), str(averages[k])]
        row += [f"{one:.1f}" for one in (explained[:, k] if own else [np.min(explained[:, k])])]
        row += (
            [f"{np.nanmedian(values):.4f}", f"{100.0 * np.mean(values >= GOOD_COHERENCE):.0f}"] if known else ["–", "–"]
        )
        rows.append(row)
    return page.table(head, rows)


def place_section(m: Material) -> tuple[page.Section, list[tuple[int, int]]]:
    """Responses averaged over the good hits of each place, over those of the model; and the pairs shown whole."""
    title, name = "Frequency responses of the places", "Responses"
    line, model = synthesised_at(m.result, min(m.result.shown_hz, 1.05 * reach_hz(m.result)))
    given = m.measured
    if given is None or given.frf is None or given.struck is None:
        nothing = np.zeros((len(m.result.outputs), len(m.result.inputs)))
        pairs = [(o, k) for o, k, _ in _chosen(m, nothing)]
        return page.section(title, page.absent(f"The section {m.needs_record}."), name=name), pairs
    frf, struck = given.frf, given.struck
    compared = explained_percent(given, m.result)
    chosen = _chosen(m, compared)
    strongest = int(np.argmax(np.sum(np.abs(model) ** 2, axis=(0, 2))))
    worst = np.argsort(compared[strongest], kind="stable")[:MOST_SMALL]
    small = sorted(int(k) for k in worst)
    used = (frf.frequency_hz > 0.0) & (frf.frequency_hz <= reach_hz(m.result))
    count = len(m.result.inputs)
    said = f"all {count} places" if len(small) == count else f"the {len(small)} of {count} places that fit worst"
    drive = sum(what == "drive point" for *_, what in chosen)
    words = (
        f"Shown whole: {count_of(drive, 'drive point')}, and the best and the worst of the other pairs; small: {said}, "
        f"at {m.result.outputs[strongest]}; the table has every place. Averaged over the good hits of each place, "
        f"{frf.resolution_hz:.3g} Hz lines, no window. H1 errs low where the force is noisy, H2 high where the "
        "response is, Hv lies between; where they are one line the choice does not matter. Coherence: of the hits at "
        "this place; one hit has none. Model: synthesised from the modes of the result; it has no leakage, so that it "
        "is higher than the measured peak of a mode that still rings at the end of the record."
    )
    of_all = "" if len(m.result.outputs) == 1 else ", of all sensors"
    table_words = (
        f"Explained: 100 (1 − ‖H1 − Ĥ‖/‖H1‖) from 0 to {reach_hz(m.result):.4g} Hz, Ĥ from the simulated outputs with "
        f"the same segments. Coherence: median over these lines{of_all}."
    )
    parts = [
        page.note(words),
        _whole(m, chosen, frf, struck.coherence, line, model),
        page.heading(f"At {m.result.outputs[strongest]}"),
        _small(m, small, strongest, frf, line, model),
        page.heading("Every place"),
        _table(m, compared, struck.coherence, used, struck.averages),
        page.note(table_words),
    ]
    return page.section(f"{title}, measured and synthesised", *parts, name=name), [(o, k) for o, k, _ in chosen[:4]]


def set_ups_section(m: Material) -> page.Section | None:
    """Which sensors each set-up has, and the modes without a value at some. None of one set-up."""
    given = m.result.raw.get("set_ups")
    if not given:
        return None
    common = [name for name in m.result.outputs if all(name in one["outputs"] for one in given)]
    rows = [
        [str(k), str(one["name"]), ", ".join(name for name in one["outputs"] if name not in common) or "–"]
        for k, one in enumerate(given, 1)
    ]
    parts = [page.table(["set-up", "file", "its own sensors"], rows, "words")]
    parts.append(page.note(f"In every set-up: {', '.join(common) or 'none'}; the shapes are scaled there."))
    gaps = []
    for k in m.result.confident:
        lost = [name for name, entry in zip(m.result.places, m.result.shapes[k], strict=True) if not np.isfinite(entry)]
        if lost:
            gaps.append(f"mode {k + 1} at {', '.join(lost[:12])}{' ..' if len(lost) > 12 else ''}")
    if gaps:
        parts.append(page.note(f"Not measured, and left open in the shapes: {'; '.join(gaps)}."))
    return page.section("Set-ups", *parts)
