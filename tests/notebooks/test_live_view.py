# SPDX-License-Identifier: MIT
"""LiveView: what it tells a browser, and what a browser makes of it, with a model of its own in place of Jupyter."""

from __future__ import annotations

import json
from typing import Any

import numpy as np
import okid
import pytest
from okid.notebook import LiveView, lanes


def fed(**options: Any) -> LiveView:
    force, acceleration = okid.demo_record()
    session = okid.Session(["shaker"], ["a1", "a2", "a3"], fs=1000.0, **options)
    view = LiveView(session, seconds=2.0)
    rows = np.hstack([force, acceleration])
    for start in range(0, len(rows), 1000):
        view.feed(rows[start : start + 1000])
    return view


def test_the_view_tells_what_the_session_finds() -> None:
    view = fed(p=20)
    view.update()
    assert [row["frequency_hz"] for row in view.modes] == [
        pytest.approx(mode.frequency_hz, rel=1e-5) for mode in view.session.modes()
    ]
    assert view.signals["names"] == ["shaker", "a1", "a2", "a3"]
    assert view.signals["to_s"] - view.signals["from_s"] == pytest.approx(2.0)
    assert any(one["stable"] and one["f"] == pytest.approx(10.96, abs=0.05) for one in view.poles)
    json.dumps([view.signals, view.modes, view.poles], allow_nan=False)
    assert "a1" not in view.status and view.status.startswith(f"{view.session.samples} samples")


def test_a_session_shows_itself_as_it_is_fed() -> None:
    force, acceleration = okid.demo_record()
    rows = np.hstack([force, acceleration])
    session = okid.Session(["shaker"], ["a1", "a2", "a3"], fs=1000.0, p=20)
    shown = session._repr_mimebundle_()
    (view,) = session._views
    assert "application/vnd.jupyter.widget-view+json" in shown[0] and shown[0] == session._repr_mimebundle_()[0]
    session.feed(rows[:3000])
    assert view.status.startswith("3000 samples") and len(view.modes) == len(session.modes()) > 0
    masked = np.ma.masked_array(rows[3000:4000], mask=False)
    masked.mask[:, 2] = True
    view.feed(masked)
    assert session.samples == 4000 and view._kept.shape == (4000, 4) and np.isnan(view._kept[3000:, 2]).all()


def test_lanes_keep_extremes_and_gaps() -> None:
    values = np.zeros((4000, 2))
    values[1234, 0], values[2000:2100, 1] = 7.0, np.nan
    first, second = lanes(values)
    assert max(pair[1] for pair in first if pair[1] is not None) == 7.0 and len(first) == 400
    assert sum(pair == [None, None] for pair in second) == 10


def test_a_session_without_samples_and_wrong_arguments() -> None:
    session = okid.Session(1, 2, fs=100.0)
    view = LiveView(session)
    view.update()
    assert view.modes == [] and view.poles == []
    with pytest.raises(okid.InputError, match="seconds is 0"):
        LiveView(session, seconds=0)


MODEL = """
window.model = {values: %s, heard: {}, saved: 0,
  get(k) { return this.values[k]; },
  set(k, v) { this.values[k] = v; (this.heard["change:" + k] || []).forEach((f) => f()); },
  save_changes() { this.saved += 1; },
  on(k, f) { (this.heard[k] ||= []).push(f); }};
"""


def test_a_browser_draws_it_and_picks(browser: Any) -> None:
    view = fed(p=20)
    values = {key: getattr(view, key) for key in ("signals", "modes", "poles", "picked", "status")}
    values["modes"][0]["frequency_std_hz"] = None
    module = str(LiveView._esm).replace("export default", "window.widget =")
    page = browser.new_page()
    faults: list[str] = []
    page.on("pageerror", lambda fault: faults.append(str(fault)))
    page.set_content("<div id=place></div>")
    page.evaluate(MODEL % json.dumps(values) + module)
    page.evaluate("() => { window.end = widget.render({model, el: document.getElementById('place')}); }")
    assert page.locator("table tr").count() == 1 + len(view.modes)
    assert page.locator("table tr").nth(1).inner_text().split()[2] == "–"
    inked = (
        "(n) => { const c = document.querySelector(n);"
        "return c.getContext('2d').getImageData(0, 0, c.width, c.height).data.some((v) => v); }"
    )
    page.wait_for_function(f"() => ({inked})('canvas.okid-shape')")
    assert page.evaluate(inked, "canvas.okid-signals") and page.evaluate(inked, "canvas.okid-poles")
    pole = next(one for one in view.poles if one["stable"])
    far = max(one["f"] for one in view.poles) * 1.03
    tall = max(one["order"] for one in view.poles) + 1
    place = {"x": 30 + 660 * pole["f"] / far, "y": 220 - 20 - 190 * pole["order"] / tall}
    page.locator("canvas.okid-poles").click(position=place)
    picked = page.evaluate("() => model.values.picked")
    assert len(picked) == 1 and picked[0]["order"] == pole["order"] and abs(picked[0]["f"] - pole["f"]) < 2.0
    page.locator("canvas.okid-poles").click(position=place)
    assert page.evaluate("() => [model.values.picked.length, model.saved]") == [0, 2]
    page.evaluate("() => window.end()")
    assert faults == []
    page.close()


def test_pictures_have_one_style() -> None:
    result = okid.demo()
    force, acceleration = okid.demo_record()
    measured = okid.frf.h1(force, acceleration, fs=1000.0)
    named = okid.identify(force, acceleration, fs=1000.0, method="okid-era")
    pictures = [
        okid.plots.stabilization(named),
        okid.plots.shapes(result),
        okid.plots.mac(result),
        okid.plots.fit(result),
    ]
    pictures += [okid.plots.singular_values(named), okid.plots.frf(result, measured, 2)]
    for picture in pictures:
        drawn = picture._repr_svg_()
        assert drawn.lstrip().startswith("<?xml") and okid.plots.STYLE["axes.labelcolor"] in drawn
    with pytest.raises(okid.InputError, match="output 3, force 0"):
        okid.plots.frf(result, output=3)
    session = okid.Session(["shaker"], ["a1", "a2", "a3"], fs=1000.0, p=20)
    session.feed(np.hstack([force, acceleration]))
    with pytest.raises(okid.InputError, match="not a stream"):
        okid.plots.fit(session.identify())
