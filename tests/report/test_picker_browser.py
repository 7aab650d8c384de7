# SPDX-License-Identifier: MIT
"""Modes picked with the mouse in a report, saved, and identified again from the file."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import okid
import pytest
from okid import report
from okid.record.demo import demo_record
from test_report_browser import PALE, opened

NAMES = ["acc 1", "acc <2>", "acc 3"]


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> tuple[okid.Result, Path]:
    folder = tmp_path_factory.mktemp("picker")
    result = okid.identify(*demo_record(6000), fs=1000.0, method="auto", stabilization=True, output_names=NAMES)
    result.save(folder / "all.json")
    report.write_report(result, folder / "all.html")
    return result, folder / "all.html"


def pick_near(page: Any, share: float) -> str:
    """Click the first pole below the mouse on its way down, at this share of the width; its words."""
    box = page.locator(".picker canvas").bounding_box()
    for step in range(10, int(box["height"]) - 40, 4):
        page.mouse.move(box["x"] + share * box["width"], box["y"] + step)
        if page.inner_text(".picker .hover"):
            page.mouse.down()
            page.mouse.up()
            return str(page.inner_text(".picker .hover"))
    raise AssertionError("no pole there")


def picks_of(page: Any) -> list[str]:
    return [text.replace("drop", "").strip() for text in page.locator(".picker .picked li").all_inner_texts()]


def test_pick_save_and_identify_again(browser: Any, made: tuple[okid.Result, Path], tmp_path: Path) -> None:
    result, path = made
    with opened(browser, path, accept_downloads=True) as page:
        page.locator(".picker").scroll_into_view_if_needed()
        assert picks_of(page) == [] and page.locator(".picker .keep").is_disabled()
        page.click(".picker .propose")
        assert len(picks_of(page)) == len(result.confident_modes) == 3
        page.locator(".picker .picked button").first.click()
        left = picks_of(page)
        assert len(left) == 2
        page.click(".picker .undo")
        assert len(picks_of(page)) == 3
        page.click(".picker .redo")
        assert picks_of(page) == left
        words = pick_near(page, 0.5)
        assert "Hz, ζ " in words and ", order " in words and " samples at " in words
        assert len(picks_of(page)) == 3
        page.click(".picker .undo")
        page.fill(".picker .hz", "11")
        page.keyboard.press("Enter")
        assert picks_of(page)[0] == "11 Hz"
        with page.expect_download() as download:
            page.click(".picker .keep")
        download.value.save_as(tmp_path / "picks.json")
        assert "--picks picks.json" in page.inner_text(".picker .command")
    kept = json.loads((tmp_path / "picks.json").read_text())["modes"]
    again = okid.identify(*demo_record(6000), fs=1000.0, picks=tmp_path / "picks.json", output_names=NAMES)
    assert len(kept) == len(again.modes) == 3
    for mode, true in zip(again.modes, result.confident_modes, strict=True):
        assert mode.frequency_hz == pytest.approx(true.frequency_hz, rel=1e-6)


def test_a_band_is_looked_into_and_left(browser: Any, made: tuple[okid.Result, Path]) -> None:
    with opened(browser, made[1]) as page:
        page.locator(".picker").scroll_into_view_if_needed()
        whole = page.evaluate("document.querySelector('.picker canvas').toDataURL()")
        box = page.locator(".picker canvas").bounding_box()
        page.mouse.move(box["x"] + 60, box["y"] + 50)
        page.mouse.down()
        page.mouse.move(box["x"] + 160, box["y"] + 60, steps=4)
        page.mouse.up()
        assert page.evaluate("document.querySelector('.picker canvas').toDataURL()") != whole
        assert picks_of(page) == []
        page.click(".picker .whole")
        page.mouse.move(5, 5)
        assert page.evaluate("document.querySelector('.picker canvas').toDataURL()") == whole


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_legible_and_no_wider_than_a_phone(browser: Any, made: tuple[okid.Result, Path], scheme: str) -> None:
    with opened(browser, made[1], scheme) as page:
        assert page.evaluate(PALE) == []
        page.set_viewport_size({"width": 390, "height": 800})
        assert page.evaluate("document.documentElement.scrollWidth <= innerWidth")
