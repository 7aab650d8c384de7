# SPDX-License-Identifier: MIT
"""The report as a browser shows it: quiet, self-contained, legible in light, dark and print, and moving."""

from __future__ import annotations

import csv
import json
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import okid
import pytest
from okid import report
from okid.record.demo import demo_record

OVERLAPS = """() => [...document.querySelectorAll('svg')].flatMap((svg) => {
  const all = [...svg.querySelectorAll('text')].map((e) => [e.getBoundingClientRect(), e.textContent]);
  return all.flatMap(([a, one], k) => all.slice(k + 1).filter(([b]) =>
    Math.min(a.right, b.right) - Math.max(a.left, b.left) > 1 &&
    Math.min(a.bottom, b.bottom) - Math.max(a.top, b.top) > 2.5).map(([, other]) => one + ' | ' + other));
})"""

OUTSIDE = """() => [...document.querySelectorAll('svg')].flatMap((svg) => {
  const box = svg.getBoundingClientRect();
  return [...svg.querySelectorAll('text')].filter((e) => { const a = e.getBoundingClientRect();
    return a.width > 0 && (a.left < box.left - 1 || a.right > box.right + 1 ||
      a.top < box.top - 1 || a.bottom > box.bottom + 1);
  }).map((e) => e.textContent);
})"""

# WCAG contrast of every text (SVG fill, HTML colour) with the nearest background that is painted
PALE = """() => {
  const rgb = (text) => (text.match(/[0-9.]+/g) || [0, 0, 0, 0]).map(Number);
  const light = (c) => { const v = c.slice(0, 3).map((x) => x / 255).map((x) => x <= 0.03928 ? x / 12.92 :
    ((x + 0.055) / 1.055) ** 2.4); return 0.2126 * v[0] + 0.7152 * v[1] + 0.0722 * v[2]; };
  const ground = (e) => { for (; e; e = e.parentElement) { const c = rgb(getComputedStyle(e).backgroundColor);
    if (c.length === 3 || c[3] > 0) return c; } return [255, 255, 255]; };
  const poor = [];
  for (const e of document.querySelectorAll('svg text, h1, h2, h3, p, td, th, li, a, button, pre, footer')) {
    if (!e.textContent.trim() || !e.getBoundingClientRect().width) continue;
    if (e.closest('svg[aria-label^="modal assurance"]')) continue;  // numbers on squares of many shades
    const style = getComputedStyle(e), ink = rgb(e.closest('svg') ? style.fill : style.color);
    const [a, b] = [light(ink), light(ground(e))];
    const ratio = (Math.max(a, b) + 0.05) / (Math.min(a, b) + 0.05);
    if (ratio < 4.5) poor.push(ratio.toFixed(2) + ' ' + e.textContent.slice(0, 40));
  }
  return poor;
}"""

LOOKS = [("light", "screen"), ("dark", "screen"), ("dark", "print")]


@contextmanager
def opened(browser: Any, path: Path, scheme: str = "light", media: str = "screen", **options: Any) -> Iterator[Any]:
    """The page at 1280 x 800 (print: A4 between its margins); fails on noise and on requests."""
    size = {"width": 703, "height": 1017} if media == "print" else {"width": 1280, "height": 800}
    page = browser.new_page(viewport=size, color_scheme=scheme, **options)
    noise: list[str] = []
    page.on("console", lambda message: noise.append(f"{message.type}: {message.text}"))
    page.on("pageerror", lambda fault: noise.append(f"error: {fault}"))
    page.on("dialog", lambda dialog: (noise.append(f"dialog: {dialog.message}"), dialog.dismiss()))
    page.on("request", lambda request: noise.append(request.url) if request.url != path.as_uri() else None)
    page.emulate_media(media=media, color_scheme=scheme)
    page.goto(path.as_uri())
    yield page
    page.close()
    assert noise == []


@pytest.mark.parametrize(("scheme", "media"), LOOKS)
@pytest.mark.parametrize("kind", ["frame", "wide", "ambient"])
def test_looks(browser: Any, pages: dict[str, Path], kind: str, scheme: str, media: str) -> None:
    with opened(browser, pages[kind], scheme, media) as page:
        assert page.evaluate("document.documentElement.scrollWidth <= innerWidth")
        assert page.evaluate("document.querySelectorAll('svg').length") >= 9
        assert page.evaluate(OVERLAPS) == []
        assert page.evaluate(OUTSIDE) == []
        assert page.evaluate(PALE) == []
        dark = page.evaluate("getComputedStyle(document.body).backgroundColor") == "rgb(20, 24, 29)"
        assert dark == (scheme == "dark" and media == "screen")
    assert pages[kind].stat().st_size < 3_000_000


def test_a_narrow_window_scrolls_tables_not_the_page(browser: Any, pages: dict[str, Path]) -> None:
    for kind in ("frame", "wide"):
        with opened(browser, pages[kind]) as page:
            page.set_viewport_size({"width": 420, "height": 800})
            assert page.evaluate("document.documentElement.scrollWidth <= innerWidth")


def test_names_are_text_everywhere(browser: Any, pages: dict[str, Path]) -> None:
    with opened(browser, pages["frame"]) as page:
        kinds = page.evaluate("[...document.scripts].map((s) => s.type || 'code')")
        assert kinds == ["application/json", "application/json", "code"]
        assert page.query_selector_all("img, link, iframe, main b, main i, main u") == []
        assert page.title() == "<u>A</u> & B"
        text = page.inner_text("#summary")
        assert "<script>alert(1)</script>" in text
        assert "<b>frame</b> & shaker" in text
        assert any("<script>" in one for one in page.locator("svg text").all_text_contents())
        assert "mqtt://…@host" in page.inner_text("#provenance")
        assert "secret" not in page.content()


def test_what_the_sections_say(browser: Any, pages: dict[str, Path]) -> None:
    with opened(browser, pages["frame"]) as page:
        verdict = page.inner_text(".verdict")
        assert verdict.startswith("3 confident modes from ")
        assert "samples are missing at 1 channel, at most 0.013 %" in verdict
        assert "1 alarm" in verdict
        assert "29996" in page.inner_text("#summary")
        assert "can0: 60000 frames, 4 lost (sequence 4), load 12.5 %; gaps: 4 samples by sequence." in page.content()
        tracking = page.inner_text("#tracking")
        assert "60 updates" in tracking
        assert "Hz instead of" in tracking
        assert "±" in page.inner_text("#m-k-r")
        assert "white" in page.inner_text("#residual")
        missing = "[...document.querySelectorAll('nav a')].filter((a) => !document.querySelector(a.hash)).length"
        assert page.evaluate(missing) == 0
    with opened(browser, pages["ambient"]) as page:
        assert "none: ambient" in page.inner_text("#summary")
        assert "PSD [unit²/Hz]" in page.text_content("#spectra")
        assert page.query_selector("#responses") is None


def picture(page: Any) -> str:
    return str(page.evaluate("document.querySelector('canvas').toDataURL()"))


def until_changed(page: Any, before: str) -> None:
    page.wait_for_function("(old) => document.querySelector('canvas').toDataURL() !== old", arg=before, timeout=120_000)


def test_shapes_move_and_stop(browser: Any, pages: dict[str, Path]) -> None:
    with opened(browser, pages["frame"], reduced_motion="no-preference") as page:
        until_changed(page, picture(page))
        page.click("button.go")
        assert page.inner_text("button.go") == "Play"
        still = picture(page)
        page.evaluate("new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)))")
        assert picture(page) == still
        page.click("button.go")
        assert page.inner_text("button.go") == "Pause"
        until_changed(page, still)


def test_the_keyboard_picks_every_mode_and_turns_the_picture(browser: Any, pages: dict[str, Path]) -> None:
    with opened(browser, pages["frame"], reduced_motion="reduce") as page:
        assert page.inner_text("button.go") == "Play"  # less motion: at rest
        count = page.locator("button[data-mode]").count()
        assert count == 3
        reached, seen = [], set()
        page.focus("button.go")
        for k in range(count):
            page.keyboard.press("Tab")
            page.keyboard.press("Enter")
            reached.append(page.evaluate("document.activeElement.dataset.mode"))
            pressed = "[...document.querySelectorAll('button[aria-pressed=true]')].map((b) => b.dataset.mode)"
            assert page.evaluate(pressed) == [str(k)]
            seen.add(picture(page))
        assert reached == ["0", "1", "2"]
        assert len(seen) == count
        page.keyboard.press("Tab")
        assert page.evaluate("document.activeElement.tagName") == "CANVAS"
        first = picture(page)
        for key in ("ArrowLeft", "ArrowUp", "+"):
            before = picture(page)
            page.keyboard.press(key)
            assert picture(page) != before
        page.keyboard.press("Home")
        assert picture(page) == first
        page.keyboard.press("Space")
        until_changed(page, first)


def test_the_mouse_turns_the_picture_and_the_dark_page_its_ink(browser: Any, pages: dict[str, Path]) -> None:
    with opened(browser, pages["frame"], reduced_motion="reduce") as page:
        before = picture(page)
        page.emulate_media(color_scheme="dark")
        until_changed(page, before)
        page.locator("canvas").scroll_into_view_if_needed()
        box = page.locator("canvas").bounding_box()
        before = picture(page)
        page.mouse.move(box["x"] + 200, box["y"] + 200)
        page.mouse.down()
        page.mouse.move(box["x"] + 260, box["y"] + 170)
        page.mouse.up()
        assert picture(page) != before


def test_stills_take_the_place_of_the_animation(browser: Any, pages: dict[str, Path]) -> None:
    shown = "(what) => getComputedStyle(document.querySelector(what)).display !== 'none'"
    for media, javascript, moving in (("screen", True, True), ("print", True, False), ("screen", False, False)):
        context = browser.new_context(java_script_enabled=javascript)
        page = context.new_page()
        page.emulate_media(media=media)
        page.goto(pages["frame"].as_uri())
        if javascript:
            assert page.evaluate(shown, ".player") == moving
            assert page.evaluate(shown, "svg.still") == (not moving)
        else:
            assert page.locator(".player").is_visible() == moving
            assert page.locator("svg.still").is_visible() == (not moving)
        context.close()


def test_what_is_selected_is_what_is_saved(browser: Any, tmp_path: Path) -> None:
    """Three modes, one of them doubtful: it stands apart with its reason, and is saved when it is chosen."""
    u, y = demo_record(3000)
    raw = okid.identify(u, y, fs=1000.0, method="n4sid-moesp", order=6, sigma_blocks=0).to_dict()
    raw["modes"][1].update(confident=False, why=["tone"], why_text=["a steady line"], found_in=0.75)
    report.write_report(raw, tmp_path / "r.html")
    with opened(browser, tmp_path / "r.html") as page:
        assert "2 confident modes from " in page.inner_text(".verdict")
        assert "1 doubtful mode listed apart" in page.inner_text(".verdict")
        assert "tone: a steady line" in page.inner_text("#modes table.words")
        assert page.inner_text(".save .chosen") == "2 of 3 modes selected"
        page.uncheck("input[data-mode='1']")
        page.check("input[data-mode='2']")
        saved = {}
        for kind in ("csv", "json", "uff"):
            with page.expect_download() as waiting:
                page.click(f"button[data-save='{kind}']")
            saved[kind] = tmp_path / f"modes.{kind}"
            waiting.value.save_as(saved[kind])
            assert waiting.value.suggested_filename == f"modes.{kind}"
        page.uncheck("input[data-mode='2']")
        page.uncheck("input[data-mode='3']")
        assert page.is_disabled("button[data-save='uff']")
    wanted = [raw["modes"][k]["frequency_hz"] for k in (1, 2)]
    rows = list(csv.DictReader(saved["csv"].read_text(encoding="utf-8").splitlines()))
    assert [(row["mode"], float(row["frequency_hz"])) for row in rows] == [
        ("2", wanted[0]),
        ("3", wanted[1]),
    ]
    assert [float(row["y3 re"]) for row in rows] == [raw["modes"][k]["shape_re"][2] for k in (1, 2)]
    found = okid.Result.from_dict(json.loads(saved["json"].read_text(encoding="utf-8")))
    assert [mode.frequency_hz for mode in found.confident_modes] == wanted
    assert found.warnings[-1].code == "modes_chosen"
    modes = okid.read_uff(saved["uff"]).modes
    assert [(mode.number, mode.confident) for mode in modes] == [(2, False), (3, True)]
    assert [mode.frequency_hz for mode in modes] == pytest.approx(wanted, rel=1e-5)
