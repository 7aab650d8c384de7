# SPDX-License-Identifier: MIT
"""What is clicked in headless Chromium: the start page, the slider of a replay, the report, saved pictures."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from lines import line
from live_process import Live
from PIL import Image
from program import okid
from two_masses import rig_text, simulate_rig

READY = "() => okidLive.page.result && okidLive.page.diagram && Object.values(okidLive.plots).some((one) => one.draws)"
MODES = "#modes-table tbody td:nth-child(2)"


@pytest.fixture(scope="module")
def rig(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two masses, whose springs change at 6 of 12 s: the journal a.okj; and the table t.csv."""
    text = rig_text(12.0, 500.0) + "[[change]]\nat_s = 6.0\nsprings = [2.4e4, 2e4]\n"
    folder = simulate_rig(tmp_path_factory.mktemp("start"), text, lags=20)
    config = (folder / "a.toml").read_text().replace("update_s = 1.0", "update_s = 0.5\nwindow_s = 3.0")
    (folder / "a.toml").write_text(config)
    okid("convert", folder / "a.log", folder / "a.okj", "-c", folder / "a.toml", status=0)
    okid("convert", folder / "a.log", folder / "t.csv", "-c", folder / "a.toml", status=0)
    return folder


class Tab:
    """One page opened by the address that was printed; what it complains of and asks for is kept."""

    def __init__(self, browser: Any, live: Live, address: str | None = None) -> None:
        self.live, self.complaints, self.asked = live, [], []  # type: ignore[var-annotated]
        self.page = browser.new_page(viewport={"width": 1280, "height": 800})
        self.page.on("console", lambda message: self.complaints.append(message.text))
        self.page.on("pageerror", lambda fault: self.complaints.append(str(fault)))
        self.page.on("request", lambda request: self.asked.append(request.url))
        self.page.goto(address or live.address)
        self.wait("() => window.okidLive && okidLive.page.run !== null")

    def wait(self, condition: str) -> None:
        self.page.wait_for_function(condition, timeout=1_800_000)

    def saved(self, button: str) -> tuple[str, Path]:
        with self.page.expect_download(timeout=1_800_000) as waiting:
            self.page.click(button)
        return waiting.value.suggested_filename, waiting.value.path()

    def check_quiet(self) -> None:
        refused = "Failed to load resource: the server responded with a status of 4"  # Chromium's own remark on these
        assert [one for one in self.complaints if not one.startswith(refused)] == []
        assert all(url.startswith((self.live.url, "data:")) for url in self.asked), self.asked
        assert not any(self.live.token in url.partition("#")[0] for url in self.asked)


def test_from_a_name_to_modes_and_report(rig: Path, browser: Any, okid_live: Callable[..., Live]) -> None:
    live = okid_live()
    tab = Tab(browser, live)
    page = tab.page
    assert page.is_visible("#start") and not page.is_visible("#modes") and page.inner_text("#link") == "ready"
    page.fill("#start-path", "/no/such")
    page.click("#start-look")
    tab.wait("() => document.getElementById('start-note').textContent.includes('no such file')")
    page.fill("#start-path", str(rig))
    page.click("#start-look")
    page.click("#start-list button >> text='t.csv'")
    tab.wait("() => document.querySelectorAll('#start-channels tbody tr').length === 3")
    sides = page.eval_on_selector_all("#start-channels select", "(all) => all.map((one) => one.value)")
    assert sides == ["inputs", "outputs", "outputs"] and page.input_value("#start-fs") == "500"
    for row, dof in enumerate(("1", "1", "2"), 1):
        page.fill(f"#start-channels tbody tr:nth-child({row}) input", dof)
    page.select_option("#start-method", "okid-era")
    page.click("#start-identify")
    tab.wait(READY)
    said = page.inner_text("#start-command")
    assert f"okid identify {rig / 't.csv'} --inputs=force1 --outputs=acc1,acc2" in said
    assert "--output-dofs=1,2" in said and 'inputs = ["force1"]' in said and "fs_hz = 500" in said
    assert page.inner_text("#result-parts h3 >> nth=0") == "M [kg]" and page.is_visible("#modes")
    name, path = tab.saved("#report")
    assert name == "report.html" and "<!DOCTYPE html>" in path.read_text(encoding="utf-8")[:40]
    tab.wait("() => document.getElementById('report').textContent === 'Report'")
    tab.check_quiet()
    assert live.end() == (0, "")


def test_a_dropped_file_and_what_fails(rig: Path, browser: Any, okid_live: Callable[..., Live]) -> None:
    live = okid_live()
    tab = Tab(browser, live)
    tab.page.set_input_files("#start-files", str(rig / "t.csv"))
    tab.wait("() => document.querySelectorAll('#start-channels tbody tr').length === 3")
    assert "okid-live-" in tab.page.inner_text("#start-list")
    tab.page.fill("#start-channels tbody tr:nth-child(2) input", "7")
    tab.page.click("#start-identify")
    tab.wait("() => document.getElementById('link').textContent === 'failed'")
    assert "dofs" in tab.page.inner_text("#log")
    looker = Tab(browser, live, live.url)  # without the key: it looks on
    assert "the key" in looker.page.inner_text("#start-note") and not looker.page.is_visible("#report")
    looker.page.fill("#start-path", str(rig))
    looker.page.click("#start-look")
    looker.wait("() => document.getElementById('start-note').textContent.includes('holds the key')")
    tab.check_quiet()
    assert live.end() == (0, "")


def test_the_slider_goes_to_any_time_and_pictures_are_saved(
    rig: Path, browser: Any, okid_live: Callable[..., Live]
) -> None:
    live = okid_live(rig / "a.okj")
    tab = Tab(browser, live)
    page = tab.page
    tab.wait(READY)
    tab.wait("() => document.getElementById('link').textContent === 'ended: result' && okidLive.lanes.end === 1200")
    newest = float(page.inner_text(f"{MODES} >> nth=0"))
    slide = (
        "(t) => { const one = document.getElementById('when'); one.value = t; one.dispatchEvent(new Event('input')); }"
    )
    page.evaluate(slide, 5.2)
    tab.wait("() => okidLive.page.then && okidLive.page.then.t === 5")
    before = float(page.inner_text(f"{MODES} >> nth=0"))
    assert before == pytest.approx(17.35, abs=0.1) and newest < before - 0.5  # the springs were stiffer then
    assert page.inner_text("#clock") == "t = 5.2 s" and page.evaluate("okidLive.lanes.heldAt") == 520
    assert page.inner_text("#shape-mode option >> nth=0").startswith("1: 17.3")
    tab.wait("() => document.querySelector('#tracking .plot').layout.shapes.some((one) => one.x0 === 5.2)")
    page.click("#newest")
    tab.wait(f"() => document.querySelector('{MODES}').textContent === '{page.inner_text(MODES + ' >> nth=0')}'")
    assert page.evaluate("okidLive.page.at") is None and not page.is_visible("#newest")
    page.select_option("#lanes-span", "all")
    tab.wait("() => okidLive.lanes.span === 12")
    name, path = tab.saved("#tracking button[data-picture='svg']")
    assert name == "tracking.svg" and path.read_text(encoding="utf-8").startswith("<svg")
    name, path = tab.saved("#tracking button[data-picture='png']")
    with Image.open(path) as picture:
        colours = picture.convert("RGB").getcolors(1 << 24)
        assert name == "tracking.png" and picture.width > 800 and colours is not None and len(colours) > 50
    name, path = tab.saved("#lanes-save")
    with Image.open(path) as picture:
        assert name == "signals.png" and picture.width > 2000
    tab.check_quiet()
    assert live.end() == (0, "")


def test_a_geometry_typed_as_a_table(rig: Path, tmp_path: Path, browser: Any, okid_live: Callable[..., Live]) -> None:
    """Pasted from a spreadsheet on a phone; what is wrong is said beside it, the key is asked for."""
    result = tmp_path / "r.json"
    columns = ("--inputs", "force1", "--outputs", "acc1,acc2", "--p", "20")
    okid("identify", rig / "t.csv", *columns, "--json", result, status=0)
    live = okid_live(result)
    tab = Tab(browser, live)
    page = tab.page
    page.set_viewport_size({"width": 390, "height": 800})
    tab.wait("() => okidLive.page.result && !document.getElementById('geometry').hidden")
    page.click("#geometry summary")
    page.fill("#geometry-table", "node,1,0,0")
    page.click("#geometry-draw")
    tab.wait("() => document.querySelector('#geometry-note.bad')?.textContent.includes('the table')")
    page.fill(
        "#geometry-table", "node\t1\t0\t0\t2\nnode\t2\t0\t0\t1\nline\t1\t2\nsensor\tacc1\t1\tx\nsensor\tacc2\t2\tx"
    )
    page.click("#geometry-draw")
    tab.wait("() => document.getElementById('geometry-toml').textContent.startsWith('[geometry]')")
    tab.wait("() => okidLive.page.result && okidLive.page.facts.geometry?.nodes.length === 2")
    assert page.evaluate("document.documentElement.scrollWidth") <= 390
    tab.check_quiet()
    assert not Tab(browser, live, live.url).page.is_visible("#geometry")


def test_a_run_begins_and_ends_on_the_page(
    rig: Path, tmp_path: Path, browser: Any, okid_live: Callable[..., Live]
) -> None:
    """A serial line is named, its config proposed and changed; the run goes on while no page is open."""
    rows = [row for row in (rig / "t.csv").read_text().splitlines() if row[:1] in "-0123456789"]
    live, device, config = okid_live(), tmp_path / "tty", tmp_path / "lab.toml"
    tab = Tab(browser, live)
    page = tab.page
    with line(device) as ours:
        page.fill("#start-path", str(device))
        page.click("#start-look")
        tab.wait("() => !document.getElementById('start-bus').hidden")
        assert page.is_visible("#bus-fields") and not page.is_visible("#bus-dbc")
        page.fill("#bus-config", str(config))
        page.fill("#bus-fields", "force,a1,a2")
        page.fill("#bus-rate", "500")
        page.click("#bus-propose")
        tab.wait("() => document.getElementById('run-toml').value.includes('name = \"a2\"')")
        toml = page.input_value("#run-toml").replace("# counter_field = 0", "counter_field = 0")
        for field in (2, 1, 0):  # the number of a line came to be the first
            toml = toml.replace(f"\nfield = {field}", f"\nfield = {field + 1}")
        page.fill("#run-toml", toml)
        page.click("#run-start")
        tab.wait("() => document.getElementById('link').textContent === 'live'")
        page.close()
        for n, row in enumerate(rows):
            ours.write(f"{n},{row}\n".encode())
        again = Tab(browser, live)
        again.wait("() => document.querySelectorAll('#modes-table tbody tr').length >= 2")
        again.page.click("#run-end")
        again.wait("() => okidLive.page.result && document.getElementById('link').textContent === 'ended: result'")
        again.check_quiet()
    tab.check_quiet()
    assert live.end() == (0, "")
