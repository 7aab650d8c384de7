# SPDX-License-Identifier: MIT
"""Pictures of the report and of the live page, taken in headless Chromium."""

from __future__ import annotations

import contextlib
import io
import shutil
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from docs_pictures import runs

WIDE, PHONE = {"width": 1280, "height": 1040}, {"width": 390, "height": 844}
GEOMETRY = """
[geometry]
nodes = [[0, 0, 0], [0, 0, 1], [0, 0, 2], [0, 0, 3]]
dofs = [[2, "x"], [3, "x"], [4, "x"]]
lines = [[1, 2], [2, 3], [3, 4]]
"""
PUBLISH = '\n[publish]\nsocket = "okid.sock"\nsamples = true\n'


@contextlib.contextmanager
def chromium() -> Iterator[Any]:
    """A browser that reads as people do, motion off."""
    from playwright.sync_api import sync_playwright

    path = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")
    with sync_playwright() as play:
        browser = play.chromium.launch(executable_path=path, args=["--no-sandbox"])
        yield browser
        browser.close()


def keep(name: str, picture: bytes, width: int = 1000) -> str:
    """A PNG of few colours, at most so wide, below docs/images."""
    from PIL import Image

    image = Image.open(io.BytesIO(picture)).convert("RGB")
    if image.width > width:
        image = image.resize((width, round(image.height * width / image.width)), Image.Resampling.LANCZOS)
    # By coverage: colours of small marks stay.
    image.quantize(128, Image.Quantize.MAXCOVERAGE, dither=Image.Dither.NONE).save(runs.IMAGES / name, optimize=True)
    return name


def sections(browser: Any, page: Path, wanted: dict[str, str]) -> list[str]:
    """Sections of a report by their ids, each as a picture."""
    tab = browser.new_page(viewport={"width": 900, "height": 1000}, device_scale_factor=1.5, reduced_motion="reduce")
    tab.goto(page.as_uri())
    tab.wait_for_timeout(500)
    made = [keep(name, tab.locator(f"#{part}").screenshot()) for part, name in wanted.items()]
    tab.close()
    return made


def stacked(browser: Any, page: Path, wanted: tuple[str, ...], name: str) -> str:
    """Some sections of a report below each other."""
    from PIL import Image

    tab = browser.new_page(viewport={"width": 900, "height": 1000}, device_scale_factor=1.5, reduced_motion="reduce")
    tab.goto(page.as_uri())
    parts = [Image.open(io.BytesIO(tab.locator(f"#{part}").screenshot())) for part in wanted]
    tab.close()
    whole = Image.new("RGB", (max(one.width for one in parts), sum(one.height for one in parts)), "white")
    for k, one in enumerate(parts):
        whole.paste(one, (0, sum(before.height for before in parts[:k])))
    out = io.BytesIO()
    whole.save(out, "PNG")
    return keep(name, out.getvalue())


def reports() -> list[str]:
    runs.hammer()
    runs.frame()
    runs.demo()
    runs.bridge()
    (runs.FOLDER / "geometry.toml").write_text(GEOMETRY)
    hammer = runs.report("hammer.json", "--record", "hits.csv", "--geometry", "geometry.toml")
    frame = runs.report("matrices.json", "--record", "frame.csv", "--geometry", "geometry.toml")
    demo = runs.report("demo.json", "--record", "demo.csv")
    order = runs.report("order.json", "--record", "hits.csv")
    bridge = runs.report("bridge.json", "--events", "bridge.jsonl", "--config", "bridge.toml")
    with chromium() as browser:
        return [
            *sections(
                browser,
                hammer,
                {
                    "summary": "report-summary.png",
                    "responses": "recipe-hammer.png",
                    "stabilization": "stabilization.png",
                    "impulse-response": "impulse-response.png",
                    "residual": "residual.png",
                    "automac": "automac.png",
                    "time-histories": "time-histories.png",
                },
            ),
            stacked(browser, frame, ("stabilization", "responses"), "report.png"),
            stacked(browser, demo, ("modes", "responses"), "demo-report.png"),
            *sections(browser, order, {"singular-values": "singular-values.png"}),
            *sections(browser, frame, {"m-k-r": "recipe-matrices.png", "shapes": "recipe-arduino.png"}),
            *sections(browser, bridge, {"tracking": "recipe-bridge.png"}),
        ]


def campaign() -> list[str]:
    """The report of a year: the verdict, frequencies and control charts, without damping and temperature."""
    hide = """([first, next]) => { let hidden = false;
      for (const one of document.getElementById("frame").children) {
        if ([first, next].includes(one.textContent)) hidden = one.textContent === first;
        if (hidden) one.style.display = "none";
      } }"""
    with chromium() as browser:
        tab = browser.new_page(viewport={"width": 1000, "height": 1000}, device_scale_factor=1.5)
        tab.goto(runs.campaign().as_uri())
        tab.evaluate(hide, ["Damping over time", "Control charts"])
        return [keep("campaign.png", tab.locator("main").screenshot())]


def notebook() -> list[str]:
    """The modes of an executed notebook as its page shows them, and a session that shows itself."""
    with chromium() as browser:
        tab = browser.new_page(viewport={"width": 1280, "height": 1000}, device_scale_factor=1.5)
        tab.goto((runs.site() / "notebooks" / "shaker_test.html").as_uri())
        part = """() => {
          const all = [...document.querySelectorAll("h2")], first = all.findIndex((h) => h.id === "modes");
          const from = all[first].getBoundingClientRect(), end = all[first + 2].getBoundingClientRect();
          return { x: from.x - 10, y: from.y + scrollY - 10, width: from.width + 20, height: end.y - from.y }; }"""
        return [keep("notebook.png", tab.screenshot(full_page=True, clip=tab.evaluate(part))), live_view(browser)]


def live_view(browser: Any) -> str:
    """okid.notebook.LiveView of the demo, with a model of its own in place of Jupyter's."""
    import numpy as np
    import okid

    session = okid.Session(["shaker"], ["a1", "a2", "a3"], fs=1000.0, p=20)
    view = okid.notebook.LiveView(session)
    session.feed(np.hstack(okid.demo_record()))
    view.update()
    values = {key: getattr(view, key) for key in ("signals", "modes", "poles", "picked", "status")}
    tab = browser.new_page(viewport={"width": 760, "height": 800}, device_scale_factor=1.5)
    tab.set_content('<body style="font: 14px sans-serif"><div id="place" style="padding: 10px"></div>')
    tab.evaluate(str(view._esm).replace("export default", "window.widget ="))
    show = """(values) => {
      widget.render({ model: { get: (key) => values[key], on() {} }, el: document.getElementById("place") }); }"""
    tab.evaluate(show, values)
    tab.wait_for_timeout(500)
    return keep("notebook-live.png", tab.locator("#place").screenshot())


def live() -> list[str]:
    """The page while a log plays, wide and on a phone."""
    runs.frame()
    text = (runs.FOLDER / "lab.toml").read_text().replace("[identification]", "[identification]\nwindow_s = 12.0")
    (runs.FOLDER / "page.toml").write_text(text + PUBLISH + GEOMETRY)
    server = subprocess.Popen(
        [sys.executable, "-m", "okid.live", "page.toml", "--port", "0"],
        cwd=runs.FOLDER,
        stdout=subprocess.PIPE,
        text=True,
    )
    assert server.stdout
    address = server.stdout.readline().split()[1]
    made = []
    try:
        with chromium() as browser:
            wide = browser.new_page(viewport=WIDE)
            wide.goto(address)
            play = subprocess.Popen(
                [runs.OKID, "replay", "frame.log", "-c", "page.toml", "--speed", "2"],
                cwd=runs.FOLDER,
                stdout=subprocess.DEVNULL,
                stderr=subprocess.DEVNULL,
            )
            wide.wait_for_timeout(17_000)
            made.append(keep("live.png", wide.screenshot(), 1280))
            phone = browser.new_page(viewport=PHONE, device_scale_factor=2)
            phone.goto(address)
            phone.wait_for_timeout(2_000)
            made.append(keep("live-phone.png", phone.screenshot(), 480))
            play.wait(60)
            wide.wait_for_timeout(1_500)
            made.append(keep("live-result.png", wide.screenshot(full_page=True), 900))
    finally:
        server.terminate()
        server.wait(20)
    return made
