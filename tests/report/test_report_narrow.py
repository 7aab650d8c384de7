# SPDX-License-Identifier: MIT
"""The report on a telephone and on paper."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from test_report_browser import opened

SMALL_LETTERS = """() => [...document.querySelectorAll('svg text')].flatMap((e) => {
  const own = parseFloat(getComputedStyle(e).fontSize), scale = e.getScreenCTM();
  const size = own * Math.hypot(scale.a, scale.b);
  return size > 0 && size < 6 ? [size.toFixed(1) + ' ' + e.textContent] : [];
})"""
NARROW_CELLS = """() => [...document.querySelectorAll('table.facts td, table.files td, table.words td')].filter((e) => {
  const text = document.createRange(), box = e.getBoundingClientRect();
  text.selectNodeContents(e);
  return box.width > 0 && box.width < 60 && new Set([...text.getClientRects()].map((one) => one.top)).size > 2;
}).map((e) => e.textContent)"""
DAMPING = """() => [...document.querySelectorAll('#modes table')].map((table) => {
  const at = [...table.querySelectorAll('th')].findIndex((e) => e.textContent === 'ζ [%]');
  return table.querySelectorAll('tbody tr')[0].children[at].getBoundingClientRect().right;
})"""


@pytest.mark.parametrize("kind", ["frame", "wide", "ambient"])
def test_on_a_telephone(browser: Any, pages: dict[str, Path], kind: str) -> None:
    """Damping stands on the screen, letters in pictures can be read, no word stands letter by letter."""
    with opened(browser, pages[kind]) as page:
        page.set_viewport_size({"width": 390, "height": 844})
        assert page.evaluate("document.documentElement.scrollWidth <= innerWidth")
        assert max(page.evaluate(DAMPING)) <= 390
        assert page.evaluate(SMALL_LETTERS) == []
        assert page.evaluate(NARROW_CELLS) == []


@pytest.mark.parametrize("kind", ["frame", "wide", "ambient"])
def test_no_picture_takes_more_than_half_a_printed_page(browser: Any, pages: dict[str, Path], kind: str) -> None:
    """What does not fit below goes to the next page and leaves a hole of its own height."""
    tall = "() => Math.max(...[...document.querySelectorAll('svg')].map((e) => e.getBoundingClientRect().height))"
    with opened(browser, pages[kind], "light", "print") as page:
        assert page.evaluate(tall) < 0.55 * 1017
        assert page.evaluate(NARROW_CELLS) == []
    with opened(browser, pages["frame"], "light", "print") as page:
        stills = page.evaluate(
            "[...document.querySelectorAll('svg.still')].map((e) => e.getBoundingClientRect().height)"
        )
        assert min(stills) > 150  # a row of shapes: 4 cm and more
