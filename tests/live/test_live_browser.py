# SPDX-License-Identifier: MIT
"""The page in headless Chromium while logs play: what is seen, in light and dark, and what a hostile name does."""

from __future__ import annotations

import json
import subprocess
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from live_process import Live
from okid_feed import WHOLE, OkidFeed, channel, mode, modes, samples, start
from PIL import Image
from program import PROGRAM
from two_masses import rig_text, simulate_rig

SIZE = {"width": 1280, "height": 800}
PUBLISH = '\n[publish]\nsocket = "s"\nsamples = true\n'
GEOMETRY = '[geometry]\nnodes = [[0,0,0],[0,0,1],[0,0,2]]\nlines = [[1,2],[2,3]]\ndofs = [[2,"x"],[3,"x"]]\n'
ALL_DRAWN = "() => Object.values(okidLive.plots).every((plot) => plot.draws > 0)"

WIDER = """() => [...document.querySelectorAll('main *, header *')]
  .filter((e) => !e.closest('.scroll, svg, #chooser, #result') && e.getBoundingClientRect().right > innerWidth + 1)
  .map((e) => e.outerHTML.slice(0, 100))"""
OVERLAPS = """() => {
  const meet = (a, b) => Math.min(a.right, b.right) - Math.max(a.left, b.left) > 2
    && Math.min(a.bottom, b.bottom) - Math.max(a.top, b.top) > 3;
  return [...document.querySelectorAll('.plot')].flatMap((plot) => {
    const boxes = [...plot.querySelectorAll('svg text')].map((e) => [e.textContent, e.getBoundingClientRect()])
      .filter(([text, box]) => text.trim() && box.width > 0);
    return boxes.flatMap(([text, a], i) =>
      boxes.slice(i + 1).filter(([, b]) => meet(a, b)).map(([other]) => [text, other]));
  });
}"""
RED = """() => {
  const lanes = document.getElementById('lanes');
  const data = lanes.getContext('2d').getImageData(0, 0, lanes.width, lanes.height).data;
  let red = 0;
  for (let k = 0; k < data.length; k += 4) red += data[k] > 150 && data[k + 1] < 80 && data[k + 2] < 80;
  return red;
}"""


class Page:
    """One tab; what it complains of and what it asks for is kept."""

    def __init__(self, browser: Any, live: Live, scheme: str = "light") -> None:
        self.tab = browser.new_page(viewport=SIZE, color_scheme=scheme)
        self.complaints: list[str] = []
        self.asked: list[str] = []
        self.tab.on("console", lambda message: self.complaints.append(message.text))
        self.tab.on("pageerror", lambda fault: self.complaints.append(str(fault)))
        self.tab.on("dialog", lambda dialog: (self.complaints.append(f"dialog {dialog.message}"), dialog.dismiss()))
        self.tab.on("request", lambda request: self.asked.append(request.url))
        self.tab.goto(live.url)
        self.wait("() => window.okidLive && okidLive.page.run !== null")

    def text(self, selector: str) -> str:
        return str(self.tab.inner_text(selector))

    def wait(self, condition: str) -> None:
        self.tab.wait_for_function(condition, timeout=120_000)

    def see_everything(self) -> None:
        """Every plot is drawn before anybody scrolls; then scroll through the page, which draws what is new."""
        self.wait(ALL_DRAWN)
        self.scroll_through()

    def scroll_through(self) -> None:
        for y in range(0, int(self.tab.evaluate("document.documentElement.scrollHeight")), 600):
            self.tab.evaluate(f"window.scrollTo(0, {y})")
            self.tab.wait_for_timeout(250)

    def check_layout(self, width: int = SIZE["width"]) -> None:
        """Nothing is wider than the page, no text of a plot lies on another."""
        assert self.tab.evaluate("document.documentElement.scrollWidth") <= width
        assert self.tab.evaluate(WIDER) == []
        assert self.tab.evaluate(OVERLAPS) == []

    def check_quiet(self, live: Live) -> None:
        assert self.complaints == []
        assert all(url.startswith((live.url, "data:")) for url in self.asked), self.asked


class Replay:
    """`okid replay` of a folder's a.log with b.toml in the background."""

    def __init__(self, folder: Path, speed: str) -> None:
        self.process = subprocess.Popen(
            [PROGRAM, "replay", folder / "a.log", "-c", folder / "b.toml", "--speed", speed],
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
        )

    def end(self) -> int:
        return self.process.wait(1800)


@pytest.fixture(scope="module")
def rig(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Twenty seconds of two masses; the springs change in the middle."""
    text = rig_text(20.0, 500.0) + "[[change]]\nat_s = 11.0\nsprings = [2.4e4, 2e4]\n"
    folder = simulate_rig(tmp_path_factory.mktemp("page"), text, lags=20)
    config = (folder / "a.toml").read_text().replace("update_s = 1.0", "update_s = 0.25\nwindow_s = 4.0")
    (folder / "b.toml").write_text(config + PUBLISH + GEOMETRY)
    return folder


def modes_shown(page: Page) -> list[float]:
    return [float(x) for x in page.tab.locator("#modes-table tbody td:nth-child(2)").all_inner_texts()]


def test_a_run_from_its_first_sample_to_its_result(
    rig: Path, browser: Any, okid_live: Callable[..., Live], tmp_path: Path
) -> None:
    live = okid_live(rig / "b.toml")
    light = Page(browser, live)
    assert light.text("#link") == "waiting for okid"
    replay = Replay(rig, "2")
    light.wait("() => ['live', 'ended'].includes(okidLive.page.state.link)")
    # on a busy computer the run may be over before the page has drawn often
    light.wait("() => document.querySelectorAll('#modes-table tbody tr').length === 2 && okidLive.lanes.draws > 1")
    assert light.tab.locator("#chooser input").count() == 3
    light.see_everything()
    light.wait("() => document.getElementById('link').textContent === 'ended: result'")
    assert replay.end() == 0
    for page in (light, Page(browser, live, "dark")):  # the second comes when everything is over
        page.see_everything()
        page.wait("() => okidLive.page.result && okidLive.page.diagram && okidLive.page.diagram.poles")
        assert len(modes_shown(page)) == 2
        events = page.text("#log")
        assert "alarm: mode" in events and "the structure changed" in events and "result: order" in events
        assert page.tab.locator("#channel-table tbody tr").count() == 3 and "100.000 %" in page.text("#channel-table")
        assert [page.tab.locator("#result-parts h3").nth(k).inner_text() for k in range(3)] == [
            "M [kg]", "K [N/m]", "R [N s/m]",
        ]  # fmt: skip
        page.check_layout()
        page.check_quiet(live)
        page.tab.evaluate("window.scrollTo(0, 0)")
        page.tab.screenshot(path=tmp_path / f"page-{page is light}.png", full_page=True)
    check_numbers(light)
    check_words(light)
    check_narrow(light, tmp_path)
    dark = page.tab.evaluate("getComputedStyle(document.body).backgroundColor")
    assert dark != light.tab.evaluate("getComputedStyle(document.body).backgroundColor")
    assert live.end() == (0, "")


def check_numbers(page: Page) -> None:
    """What is drawn is what okid found: poles of the diagram, model in the response, a shape that moves."""
    result = page.tab.evaluate("okidLive.page.result")
    found = page.tab.evaluate("okidLive.page.diagram.modes.map((mode) => mode[0])")
    for k, one in enumerate(result["modes"]):
        assert modes_shown(page)[k] == pytest.approx(one["frequency_hz"], rel=1e-4)
        assert min(abs(f / one["frequency_hz"] - 1) for f in found) < 0.01
    names = page.tab.evaluate("document.querySelector('#frf .plot').data.map((trace) => trace.name)")
    assert "measured (H1)" in names and "model" in names and "coherence" in names
    marks = page.tab.evaluate("document.querySelector('#tracking .plot').data.map((trace) => trace.name)")
    assert "change" in marks and "alarm" in marks
    moving = "document.getElementById('shape-canvas').toDataURL()"
    page.tab.evaluate("document.getElementById('shape-canvas').scrollIntoView()")
    before = page.tab.evaluate(moving)
    page.wait(f"() => {moving} !== {json.dumps(before)}")
    page.tab.click("#shape-play")
    assert page.text("#shape-play") == "Play"
    page.tab.select_option("#shape-mode", index=1)
    alone = page.tab.evaluate(moving)
    page.tab.select_option("#shape-other", index=1)
    assert page.tab.evaluate(moving) != alone
    with page.tab.expect_download() as waiting:
        page.tab.click("#shape-save button[data-picture='gif']")
    assert waiting.value.suggested_filename == "mode-2.gif"
    assert Image.open(waiting.value.path()).n_frames == 24
    assert page.tab.evaluate("okidLive.lanes.end * okidLive.lanes.seconds") == pytest.approx(20.0, abs=0.05)


def check_words(page: Page) -> None:
    """The checks of M, K, R in words, none by its key; as many modes in the note as there are lines below."""
    told = page.text("#result-parts")
    assert "M positive definite" in told and "residual of W Wᵀ = 0 (doubtful above 0.03)" in told
    assert "_positive_definite" not in told and "ww_residual" not in told and "true" not in told
    page.tab.uncheck("#modes-table tbody tr:first-child input")
    with page.tab.expect_download() as waiting:
        page.tab.click("#modes-save button[data-save='csv']")
    saved = waiting.value.path().read_text(encoding="utf-8").splitlines()
    assert len(saved) == 2 and saved[1].startswith("2,") and page.text("#modes-note").startswith("result: 2 confident")
    lines = page.tab.evaluate("document.querySelector('#diagram .plot').layout.shapes.length")
    assert lines == 2 and page.text("#diagram-note").endswith("2 modes hold")


def check_narrow(page: Page, folder: Path) -> None:
    """A telephone: the page is not wider than it, and all columns of the modes stand in it; short tables are short."""
    empty = """(id) => { const box = document.getElementById(id), rows = [...box.querySelectorAll('tr, li')].pop();
      return box.getBoundingClientRect().bottom - rows.getBoundingClientRect().bottom; }"""
    assert max(page.tab.evaluate(empty, name) for name in ("health", "events")) < 348 - 120
    assert min(page.tab.evaluate(empty, name) for name in ("health", "events")) < 40
    page.tab.set_viewport_size({"width": 390, "height": 844})
    page.tab.wait_for_timeout(300)
    page.scroll_through()
    page.tab.wait_for_timeout(1200)  # a plot is drawn once a second at most
    page.check_layout(390)
    inside = "document.getElementById('modes-table').getBoundingClientRect().right <= "
    assert page.tab.evaluate(inside + "document.getElementById('modes').getBoundingClientRect().right")
    assert page.tab.evaluate(empty, "modes") < 40
    cells = (
        "[...document.querySelectorAll('#bus-table td')].map((e) => [e.dataset.label, e.getBoundingClientRect().right])"
    )
    seen = dict(page.tab.evaluate(cells))
    assert {"received", "lost", "errors", "load"} <= set(seen) and max(seen.values()) <= 390
    page.tab.screenshot(path=folder / "narrow.png", full_page=True)
    page.tab.set_viewport_size(SIZE)


HOSTILE = ["<script>alert(1)</script>", "<img src=x onerror=alert(2)>", '<b>bold</b> & <i>"x"</i>', "${alert(3)}"]


def hostile_feed(feed: OkidFeed) -> None:
    channels = [
        channel(name, "force" if k == 0 else "acceleration", f"<u>{k}</u>", k + 1) for k, name in enumerate(HOSTILE)
    ]
    begin = {**start(channels), "notes": {"title": HOSTILE[0]}, "config": HOSTILE[1], "wall_time": HOSTILE[2]}
    counts = {name: {"expected": 9, "received": 8, "missing": 1, "completeness_percent": 88.8} for name in HOSTILE}
    bus = {"received": 1, "lost": 1, "lost_by": {HOSTILE[0]: 1}, "out_of_order": 0, "duplicate": 0, "decode_errors": 0}
    feed.send(begin, {**modes(1.0, []), "modes": [mode(k, 10.0 * k, n_y=3) for k in (1, 2)]})
    feed.send({"type": "stats", "t": 1.0, "bus": {HOSTILE[1]: bus}, "channel": counts})
    feed.send({"type": "gap", "t": 1.0, "channel": HOSTILE[0], "first": 1, "last": 5, "count": 5, "cause": HOSTILE[1]})
    feed.send({"type": "bus", "t": 1.0, "bus": HOSTILE[0], "event": HOSTILE[1], "text": HOSTILE[2]})
    feed.send({"type": "hit", "t": 1.0, "number": 1, "sample": 1, "accepted": False, "reason": HOSTILE[0],
               "text": HOSTILE[1], "accepted_hits": 0, "left": 1})  # fmt: skip
    random = np.random.default_rng(0)
    for first in range(0, 9000, 100):
        feed.send(samples(first, random.standard_normal((4, 100))))


def test_names_are_text_and_nothing_else(tmp_path: Path, browser: Any, okid_live: Callable[..., Live]) -> None:
    (tmp_path / "b.toml").write_text(WHOLE + PUBLISH)
    feed = OkidFeed(tmp_path / "s")
    live = okid_live(tmp_path / "b.toml")
    page = Page(browser, live)
    feed.accept()
    hostile_feed(feed)
    page.wait("() => okidLive.page.spectra && okidLive.page.spectra.averages > 2")
    page.scroll_through()
    warning = {"code": HOSTILE[0], "text": HOSTILE[1]}
    result = {
        "order": 4,
        "method": HOSTILE[1],
        "p": 4,
        "samples": 1,
        "gaps": 0,
        "inputs": [HOSTILE[0]],
        "outputs": HOSTILE[1:],
        "modes": [mode(1, 10.0, n_y=3)],
        "warnings": [warning],
        "model": None,
        "fit": {"prediction_percent": {HOSTILE[2]: 99.0}},
    }
    feed.send({"type": "result", "t": 9.0, "result": result})
    feed.close()
    page.wait("() => okidLive.page.result")
    page.scroll_through()
    page.tab.evaluate("window.scrollTo(0, 0)")
    page.tab.click("#chooser summary")
    for name in HOSTILE:
        assert name in page.text("#chooser") and name in page.text("#channel-table")
    assert HOSTILE[0] in page.text("h1") and page.tab.title().startswith(HOSTILE[0])
    assert HOSTILE[0] in page.text("#result-warnings") and HOSTILE[1] in page.text("#log")
    assert page.tab.evaluate("document.querySelectorAll('img, main script, main b, main u, main i').length") == 0
    legend = page.tab.evaluate("[...document.querySelectorAll('#spectra svg .legendtext')].map((e) => e.textContent)")
    assert any("<script>" in text for text in legend)
    page.check_quiet(live)


def test_without_samples_it_says_what_to_add(tmp_path: Path, browser: Any, okid_live: Callable[..., Live]) -> None:
    (tmp_path / "b.toml").write_text(WHOLE + '[publish]\nsocket = "s"\n')
    feed = OkidFeed(tmp_path / "s")
    live = okid_live(tmp_path / "b.toml")
    page = Page(browser, live)
    feed.accept()
    channels = [
        channel("f", "force", "N", 1),
        channel("a", "acceleration", "m/s^2", 1),
        channel("b", "velocity", "m/s", 2),
    ]
    feed.send(start(channels), *[modes(float(k), [10.0, 20.0 + 0.01 * k]) for k in range(1, 30)])
    page.wait("() => document.querySelectorAll('#modes-table tbody tr').length === 2")
    for panel in ("signals", "frf", "spectra", "diagram"):
        page.tab.evaluate(f"document.getElementById('{panel}').scrollIntoView()")
        page.wait(f"() => document.querySelector('#{panel} .absent').innerText.includes('samples = true')")
    page.wait("() => okidLive.plots.tracking.draws > 0")
    feed.close()
    page.wait("() => document.getElementById('link').textContent.includes('okid ended')")
    again = OkidFeed(tmp_path / "s")
    again.accept()
    again.send(start(channels[:2], number=9))
    page.wait(
        "() => document.getElementById('link').textContent === 'live' && okidLive.page.facts.channels.length === 2"
    )
    assert page.text("#modes .absent") == "no modes yet" and page.tab.locator("#log li").count() == 1
    again.close()
    page.check_quiet(live)
    assert live.end()[0] == 0
    page.wait("() => document.getElementById('link').textContent === 'okid-live does not answer'")


def test_sixty_channels(tmp_path: Path, browser: Any, okid_live: Callable[..., Live]) -> None:
    (tmp_path / "b.toml").write_text(WHOLE + PUBLISH + "[identification]\np = 3\n")
    feed = OkidFeed(tmp_path / "s")
    live = okid_live(tmp_path / "b.toml")
    page = Page(browser, live)
    feed.accept()
    feed.send(
        start([channel(f"node {k:02d}", "force" if k == 0 else "acceleration", "m/s^2", k + 1) for k in range(60)])
    )
    data = np.random.default_rng(1).standard_normal((60, 12000))
    data[3, 11000:11400] = np.nan
    for first in range(0, 12000, 200):
        feed.send(samples(first, data[:, first : first + 200]))
    page.wait("() => okidLive.lanes.end === 1200 && okidLive.lanes.draws > 0")
    assert page.tab.evaluate("okidLive.lanes.marks[3].slice(1100, 1140).every((mark) => mark === 1)")
    column = page.tab.evaluate("[okidLive.lanes.low[59][777], okidLive.lanes.high[59][777]]")
    assert column == pytest.approx([data[59, 7770:7780].min(), data[59, 7770:7780].max()], abs=1e-4)
    page.tab.focus("#lanes")
    page.tab.keyboard.press("PageDown")
    assert page.tab.evaluate("okidLive.lanes.top") == 5
    page.tab.click("#chooser summary")
    page.tab.click("#chooser button >> nth=1")
    page.tab.check("#chooser input >> nth=3")
    assert page.tab.evaluate("[okidLive.lanes.shown, okidLive.lanes.top]") == [[3], 0]
    page.tab.keyboard.press("Escape")
    page.tab.select_option("#lanes-span", "60")
    page.tab.click("#lanes-pause")
    feed.send(samples(12000, data[:, :200]))
    page.wait("() => okidLive.lanes.end === 1220")
    assert page.tab.evaluate("okidLive.lanes.heldAt") == 1200
    assert page.tab.evaluate(RED) > 500
    feed.close()
    page.check_quiet(live)
