# SPDX-License-Identifier: MIT
"""The Markdown pages of the repository: headings with the anchors a code host gives them, links, fenced blocks."""

from __future__ import annotations

import pathlib
import re
from collections.abc import Iterator
from typing import NamedTuple

from command_help import ROOT

FENCE = re.compile(r"(?m)^( *)(`{3,})([^\n`]*)\n(.*?)^\1\2 *$", re.DOTALL)


def pages() -> list[pathlib.Path]:
    """README.md and the like, those of tools/, and all of docs/."""
    return [*sorted(ROOT.glob("*.md")), *sorted((ROOT / "tools").glob("*.md")), *sorted((ROOT / "docs").rglob("*.md"))]


def name_of(page: pathlib.Path) -> str:
    """The page as seen from the root of the repository."""
    return str(page.relative_to(ROOT))


def prose(text: str) -> str:
    """The text without its fenced blocks, comments and code in backquotes: what can hold links."""
    text = re.sub(r"<!--.*?-->", "", FENCE.sub("", text), flags=re.DOTALL)
    return re.sub(r"(`+)(?:(?!\1).)+?\1", "``", text)


def anchors(text: str) -> set[str]:
    """Of the headings: small letters, no punctuation, dashes for blanks; the second of a name gets -1, and so on."""
    out: set[str] = set()
    for heading in re.findall(r"(?m)^#{1,6} +(.+?) *#*$", FENCE.sub("", text)):
        words = re.sub(r"\[([^\]]*)\]\([^)]*\)", r"\1", heading)
        slug = re.sub(r"[^\w\- ]", "", words.lower()).strip().replace(" ", "-")
        number, unique = 0, slug
        while unique in out:
            number += 1
            unique = f"{slug}-{number}"
        out.add(unique)
    return out | set(re.findall(r'<a (?:id|name)="([^"]+)"', text))


def links(text: str) -> Iterator[str]:
    """Targets of links and images in the prose, as they are written."""
    yield from re.findall(r"\]\(\s*<?([^)\s>]+)>?(?:\s+\"[^\"]*\")?\s*\)", prose(text))


class Block(NamedTuple):
    """A fenced block: language, text, whether the comment before it calls it a fragment, and the line it begins at."""

    language: str
    text: str
    fragment: bool
    line: int


def blocks(page: pathlib.Path) -> list[Block]:
    """All fenced blocks of a page in order."""
    text, out = page.read_text(), []
    for found in FENCE.finditer(text):
        before = text[: found.start()].rstrip("\n")
        language = found[3].strip().split(" ")[0]
        indent = found[1]
        body = re.sub(rf"(?m)^{indent}", "", found[4]) if indent else found[4]
        out.append(Block(language, body, before.endswith("<!-- fragment -->"), before.count("\n") + 2))
    return out
