# SPDX-License-Identifier: MIT
"""The HTML of the report: one file, its own two scripts, nothing from outside."""

from __future__ import annotations

import base64
import hashlib
import json
import re
from collections.abc import Iterable, Sequence
from html import escape
from importlib.resources import files
from typing import Any, NamedTuple

_NO_TEXT = re.compile("[\x00-\x08\x0b-\x1f\x7f\ud800-\udfff]")  # what HTML and UTF-8 cannot hold


class Section(NamedTuple):
    """A box of the page: `name` stands in the list of contents, `body` is HTML."""

    name: str
    body: str


def table(
    head: Sequence[str], rows: Iterable[Sequence[str]], kind: str = "", boxes: Sequence[tuple[int, bool]] = ()
) -> str:
    """A table of numbers; cells are escaped. boxes: of each row the number of its mode, and whether it is chosen."""
    top = ('<th class="pick"></th>' if boxes else "") + "".join(f"<th>{escape(cell)}</th>" for cell in head)
    picks = [
        f'<td class="pick"><input type="checkbox" data-mode="{number}" aria-label="mode {number}"'
        f"{' checked' if chosen else ''}></td>"
        for number, chosen in boxes
    ]
    lines = ["".join(f"<td>{escape(cell)}</td>" for cell in row) for row in rows]
    body = "\n".join(f"<tr>{pick}{line}</tr>" for pick, line in zip(picks or [""] * len(lines), lines, strict=True))
    name = f' class="{kind}"' if kind else ""
    whole = f"<table{name}><thead><tr>{top}</tr></thead><tbody>\n{body}\n</tbody></table>"
    return f'<div class="scroll" tabindex="0">{whole}</div>'


def facts(rows: Iterable[tuple[str, str]]) -> str:
    """Names and values, one pair a line."""
    body = "\n".join(f"<tr><th>{escape(name)}</th><td>{escape(value)}</td></tr>" for name, value in rows)
    return f'<table class="facts"><tbody>\n{body}\n</tbody></table>'


def count_of(number: int, word: str) -> str:
    """ "1 mode", "3 modes"."""
    return f"{number} {word}{'' if number == 1 else 's'}"


def note(text: str) -> str:
    """A remark below a picture."""
    return f'<p class="note">{escape(text)}</p>'


def absent(text: str) -> str:
    """Why a picture is not here."""
    return f'<p class="absent">{escape(text)}</p>'


def heading(text: str) -> str:
    """A heading inside a section."""
    return f"<h3>{escape(text)}</h3>"


def section(title: str, *parts: str, name: str | None = None) -> Section:
    """A box with a heading; `name` is the shorter word of the list of contents."""
    body = "\n".join(part for part in parts if part)
    key = anchor(name or title)
    return Section(name or title, f'<section id="{key}">\n<h2>{escape(title)}</h2>\n{body}\n</section>')


def anchor(name: str) -> str:
    """The name of a section as the browser's address line has it."""
    return re.sub(r"[^a-z0-9]+", "-", name.lower()).strip("-")


def beside(*parts: str) -> str:
    """Parts beside each other where the page is wide enough."""
    return f'<div class="columns">{"".join(f"<div>{part}</div>" for part in parts if part)}</div>'


def data(key: str, value: Any) -> str:
    """JSON inside the page, for the script; nothing in it can end the element."""
    text = json.dumps(value, allow_nan=False, separators=(",", ":"))
    for sign in "<>&":
        text = text.replace(sign, f"\\u{ord(sign):04x}")
    return f'<script type="application/json" id="{key}">{text}</script>'


def _asset(*place: str) -> str:
    """The text of a file of the package."""
    return files("okid").joinpath(*place).read_text(encoding="utf-8")


_SAVE = ("web", "selection.js")
_SHAPES = tuple(("web", f"{name}.js") for name in ("structure", "pens", "shapes"))
_SCRIPTS = {  # of the page that holds these data, in their order
    "shapes-data": (_SAVE, *_SHAPES, ("report", "player.js")),
    "modes-data": (_SAVE, ("report", "selection_buttons.js")),
    "poles-data": (_SAVE, ("report", "picker.js")),
}


def page(title: str, subtitle: str, sections: Iterable[Section], foot: str) -> str:
    """The whole file. Its policy forbids the browser every request and every script but the page's own."""
    listed = list(sections)
    body = "\n".join(one.body for one in listed)
    links = "\n".join(f'<a href="#{anchor(one.name)}">{escape(one.name)}</a>' for one in listed)
    script, shut = "", "script-src 'none'"
    wanted = list(dict.fromkeys(place for key, places in _SCRIPTS.items() if f'id="{key}"' in body for place in places))
    if wanted:
        code = "\n" + "".join(_asset(*place) for place in wanted)
        digest = base64.b64encode(hashlib.sha256(code.encode("utf-8")).digest()).decode("ascii")
        script, shut = f"<script>{code}</script>\n", f"script-src 'sha256-{digest}'"
    policy = f"default-src 'none'; style-src 'unsafe-inline'; {shut}"
    whole = (
        f'<!DOCTYPE html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
        f'<meta http-equiv="Content-Security-Policy" content="{policy}">\n'
        f'<meta name="viewport" content="width=device-width, initial-scale=1">\n<title>{escape(title)}</title>\n'
        f"<style>\n{_asset('report', 'page.css')}</style>\n"
        "<noscript><style>.player, .pick, .picker, .save { display: none; } .still { display: block; }"
        "</style></noscript>\n"
        f"</head>\n<body>\n<main>\n<h1>{escape(title)}</h1>\n"
        f'<p class="sub">{escape(subtitle)}</p>\n<nav aria-label="contents">\n{links}\n</nav>\n{body}\n'
        f"<footer>{escape(foot)}</footer>\n</main>\n{script}</body>\n</html>\n"
    )
    return _NO_TEXT.sub("\ufffd", whole)
