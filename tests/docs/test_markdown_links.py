# SPDX-License-Identifier: MIT
"""Every relative link of every page leads to a file that is there, and every #anchor to a heading of it."""

from __future__ import annotations

import pathlib
import urllib.parse

import pytest
from markdown_pages import anchors, links, name_of, pages


@pytest.mark.parametrize("page", pages(), ids=name_of)
def test_links_and_anchors(page: pathlib.Path) -> None:
    text = page.read_text()
    for target in links(text):
        if urllib.parse.urlparse(target).scheme:
            continue
        path, _, anchor = urllib.parse.unquote(target).partition("#")
        there = (page.parent / path).resolve() if path else page
        assert there.exists(), f"{name_of(page)}: the link {target} leads to nothing"
        if anchor and there.suffix == ".md":
            known = anchors(there.read_text())
            assert anchor in known, f"{name_of(page)}: {target}: no such heading; there are {', '.join(sorted(known))}"


def test_the_reading_of_pages() -> None:
    """Anchors as a code host makes them; links in code are none."""
    text = "# A `b_c`: (d) – e\n## Same\n## Same\n```\n# no heading [x](y)\n```\n"
    text += "[one](a.md#b) `[no](c.md)` ![p](i/p.png)\n"
    assert anchors(text) == {"a-b_c-d--e", "same", "same-1"}
    assert list(links(text)) == ["a.md#b", "i/p.png"]
    assert len(pages()) > 20
