# SPDX-License-Identifier: MIT
"""The HTML of the report: one file, no script, nothing from outside."""

from __future__ import annotations

import base64
import io
from collections.abc import Iterable, Sequence
from html import escape

from matplotlib.figure import Figure

CSS = """
:root { color-scheme: light; }
body { margin: 0; background: #f4f6f8; color: #27323d;
  font: 15px/1.5 system-ui, -apple-system, "Segoe UI", Roboto, "Helvetica Neue", Arial, sans-serif; }
main { max-width: 1080px; margin: 0 auto; padding: 28px 24px 60px; }
h1 { font-size: 26px; margin: 0 0 4px; color: #173f70; }
h2 { font-size: 18px; margin: 0 0 10px; color: #173f70; }
h3 { font-size: 14px; margin: 14px 0 4px; color: #45505b; }
p.sub { margin: 0 0 18px; color: #5b6672; }
section { background: #fff; border: 1px solid #dde3e9; border-radius: 8px; padding: 18px 20px; margin: 16px 0; }
table { border-collapse: collapse; font-variant-numeric: tabular-nums; font-size: 14px; }
th { text-align: right; font-weight: 600; color: #45505b; border-bottom: 2px solid #c9d2db; padding: 4px 12px; }
td { text-align: right; padding: 3px 12px; border-bottom: 1px solid #edf0f3; white-space: nowrap; }
th:first-child, td:first-child { text-align: left; }
table.facts th { text-align: left; border-bottom: 1px solid #edf0f3; white-space: nowrap; vertical-align: top; }
table.facts td { text-align: left; white-space: normal; }
.scroll { overflow-x: auto; }
ul.warnings { margin: 0; padding: 0; list-style: none; }
ul.warnings li { background: #fff6e6; border-left: 4px solid #d9731a; padding: 6px 12px; margin: 6px 0; }
ul.warnings code { font-weight: 600; }
p.note { color: #5b6672; font-size: 13.5px; margin: 8px 0 0; }
p.absent { background: #eef2f6; border-left: 4px solid #9aa3ad; padding: 6px 12px; margin: 0; }
img { max-width: 100%; height: auto; display: block; margin: 0 auto; }
footer { color: #7a8590; font-size: 13px; margin-top: 20px; }
@media print { body { background: #fff; } section { break-inside: avoid; border: none; padding: 8px 0; } }
"""


def picture(drawing: Figure, text: str) -> str:
    """The figure as an <img> that carries its SVG; the same numbers always give the same bytes."""
    drawing.draw_without_rendering()
    drawing.set_layout_engine("none")
    for axes in drawing.axes:  # the layout solver is not repeatable in its last digits
        axes.set_position(tuple(round(x, 4) for x in axes.get_position(original=True).bounds))
    buffer = io.BytesIO()
    drawing.savefig(buffer, format="svg", metadata={"Date": None, "Creator": None})
    code = base64.b64encode(buffer.getvalue()).decode("ascii")
    return f'<img alt="{escape(text, quote=True)}" src="data:image/svg+xml;base64,{code}">'


def table(head: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """A table of numbers; cells are escaped."""
    top = "".join(f"<th>{escape(cell)}</th>" for cell in head)
    body = "\n".join("<tr>" + "".join(f"<td>{escape(cell)}</td>" for cell in row) + "</tr>" for row in rows)
    return f'<div class="scroll"><table><thead><tr>{top}</tr></thead><tbody>\n{body}\n</tbody></table></div>'


def facts(rows: Iterable[tuple[str, str]]) -> str:
    """Names and values, one pair a line."""
    body = "\n".join(f"<tr><th>{escape(name)}</th><td>{escape(value)}</td></tr>" for name, value in rows)
    return f'<table class="facts"><tbody>\n{body}\n</tbody></table>'


def note(text: str) -> str:
    """A remark below a picture."""
    return f'<p class="note">{escape(text)}</p>'


def absent(text: str) -> str:
    """Why a picture is not here."""
    return f'<p class="absent">{escape(text)}</p>'


def section(title: str, *parts: str) -> str:
    """A white box with a heading."""
    body = "\n".join(part for part in parts if part)
    return f"<section>\n<h2>{escape(title)}</h2>\n{body}\n</section>"


def page(title: str, subtitle: str, sections: Iterable[str], foot: str) -> str:
    """The whole file."""
    body = "\n".join(sections)
    return (
        f'<!DOCTYPE html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
        f'<meta name="viewport" content="width=device-width, initial-scale=1">\n<title>{escape(title)}</title>\n'
        f"<style>{CSS}</style>\n</head>\n<body>\n<main>\n<h1>{escape(title)}</h1>\n"
        f'<p class="sub">{escape(subtitle)}</p>\n{body}\n<footer>{escape(foot)}</footer>\n</main>\n</body>\n</html>\n'
    )
