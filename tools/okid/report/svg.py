# SPDX-License-Identifier: MIT
"""A matplotlib figure as inline SVG whose ink follows the page: colours become CSS variables, text stays text."""

from __future__ import annotations

import io
import re
import warnings
from html import escape
from itertools import count
from pathlib import Path

from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.backends.backend_svg import FigureCanvasSVG
from matplotlib.figure import Figure

from okid.data.whole_file import safe_part
from okid.report.layout import arrange
from okid.result import figures
from okid.result.figure_numbers import figure_csv

INK = {
    figures.DARK: "--ink",
    figures.EDGE: "--muted",
    figures.GRID: "--grid",
    figures.FAINT: "--faint",
    figures.BLUE: "--blue",
    figures.ORANGE: "--orange",
    figures.GREEN: "--green",
    figures.RED: "--red",
    figures.GREY: "--grey",
    figures.PAPER: "--paper",
}
_NUMBERS = re.compile(r"\b(d|x|y|points|transform|width|height)=\"([^\"]*)\"")
_LONG = re.compile(r"-?\d+\.\d{3,}")


def _short(found: re.Match[str]) -> str:
    return f"{round(float(found.group()), 2) + 0.0:g}"


class Pictures:
    """Makes the pictures of one page; every picture has its own names for clips and markers. folder: where each is also
    written as .svg, .png and .csv (its numbers), by its number and the words of its description."""

    def __init__(self, folder: Path | None = None) -> None:
        self._numbers, self._folder = count(1), folder

    def inline(self, drawing: Figure, text: str, kind: str = "fig") -> str:
        """The figure as <svg role="img"> with `text` for those who cannot see it; same numbers, same bytes."""
        numbers = figure_csv(drawing) if self._folder is not None else ""
        raw = _raw(drawing)
        root = raw[raw.index("<svg") :]
        number = next(self._numbers)
        if self._folder is not None:
            _write(self._folder / f"{number:02d}-{_file_name(text)}", raw, drawing, numbers)
        mark = f"f{number}-"
        used = set(re.findall(r"(?:url\(#|href=\"#)([^)\"]+)", root))

        def tag(found: re.Match[str]) -> str:
            return _tag(found.group(), mark, used)

        body = re.sub(r"<[^>]*>", tag, re.sub(r"<metadata>.*?</metadata>|<style.*?</style>", "", root, flags=re.S))
        body = re.sub(r"\n\s*", "\n", body.strip())
        body = body.replace("<defs>\n</defs>\n", "")
        for _ in range(3):  # groups of nothing, one inside the other
            body = re.sub(r"<g>\s*</g>\n?", "", body)
        size = re.search(r"viewBox=\"([^\"]+)\"", body)
        assert size is not None  # matplotlib always writes one
        width = float(size.group(1).split()[2])
        label = escape(text, quote=True)
        top = f'<svg class="{kind}" role="img" aria-label="{label}" viewBox="{size.group(1)}"'
        top += f' style="--w:{width:.0f}px">'
        picture = re.sub(r"<svg[^>]*>", lambda _: top, body, count=1)
        return f'<div class="picture {kind}">{picture}</div>'


def _file_name(text: str) -> str:
    return re.sub(r"[^a-z0-9]+", "-", text.lower()).strip("-")[:60].strip("-")


def _write(place: Path, raw: str, drawing: Figure, numbers: str) -> None:
    """The picture in three files; OSError where the folder takes none."""
    for ending, text in ((".svg", raw), (".csv", numbers)):
        with safe_part(place.with_suffix(ending)) as part:
            part.write_text(text, encoding="utf-8")
    with warnings.catch_warnings(), safe_part(place.with_suffix(".png")) as part:
        warnings.filterwarnings("ignore", message=".*missing from.*font")
        FigureCanvasAgg(drawing).print_figure(part, dpi=200, facecolor="white")


def _raw(drawing: Figure) -> str:
    """The SVG as matplotlib writes it, with places that are the same every time."""
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", message=".*missing from.*font")  # the reader's browser has its own fonts
        canvas = FigureCanvasSVG(drawing)
        arrange(drawing)
        buffer = io.StringIO()
        # savefig would draw everything twice
        canvas.print_svg(buffer, metadata={"Date": None, "Creator": None})  # type: ignore[no-untyped-call]
    return buffer.getvalue()


def _tag(text: str, mark: str, used: set[str]) -> str:
    """One tag: own names, short numbers, colours of the page, fonts of the page."""
    text = re.sub(r" id=\"([^\"]+)\"", lambda m: f' id="{mark}{m[1]}"' if m[1] in used else "", text)
    text = re.sub(r"(url\(#|href=\"#)", rf"\g<1>{mark}", text).replace("xlink:href", "href")
    text = _NUMBERS.sub(lambda m: f'{m[1]}="{_LONG.sub(_short, m[2])}"', text)
    text = re.sub(r"(font: [^;\"]*?[\d.]+px) [^;\"]*", r"\1 var(--sans)", text)
    text = re.sub(r"font-family: [^;\"]*", "font-family: var(--sans)", text)
    return re.sub(r"#[0-9a-f]{6}\b", lambda m: f"var({INK.get(m[0], m[0])})" if m[0] in INK else m[0], text)
