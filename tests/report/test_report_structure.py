# SPDX-License-Identifier: MIT
"""The structure in the report as a browser draws it: the same motion as in Python, fills its canvas, can be saved."""

from __future__ import annotations

import base64
import io
import json
import xml.etree.ElementTree as ET
from pathlib import Path
from typing import Any

import numpy as np
import okid
import pytest
from okid import report
from okid.report.geometry import read_geometry
from okid.report.loaded import loaded_from
from PIL import Image
from test_report_browser import opened

HOSTILE = 'a"><script>alert(1)</script>&\x07'
FLOOR = [(0, 0), (4, 0), (4, 3), (0, 3)]


def tower() -> dict[str, list[Any]]:
    """Three floors on four columns, a sensor at one corner of each; the third along -x, and one node apart from all."""
    nodes = [[x, y, 3.0 * k] for k in range(4) for x, y in FLOOR] + [[9.0, 9.0, 1.0]]
    return {
        "nodes": nodes, "dofs": [[5, "x"], [9, "x"], [13, "-x"]],
        "lines": [[4 * k + c + 1, 4 * k + c + 5] for k in range(3) for c in range(4)],
        "surfaces": [[4 * k + c + 1 for c in range(4)] for k in (1, 2, 3)],
    }  # fmt: skip


@pytest.fixture(scope="module")
def given(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, dict[str, Any]]:
    """The report and the result: shapes with imaginary parts, one place of the second mode not measured."""
    folder = tmp_path_factory.mktemp("structure")
    raw = okid.demo().to_dict()
    names = [HOSTILE, "a2", "a3"]
    raw["outputs"] = names
    raw["fit"] = {key: dict(zip(names, values.values(), strict=True)) for key, values in raw["fit"].items()}
    raw["modes"][0]["shape_im"] = [0.3, -0.1, 0.2]
    (folder / "g.toml").write_text("[geometry]\n" + "".join(f"{k} = {json.dumps(v)}\n" for k, v in tower().items()))
    report.write_report(raw, folder / "r.html", geometry=folder / "g.toml")
    return folder / "r.html", raw


def test_python_and_the_browser_move_it_alike(browser: Any, given: tuple[Path, dict[str, Any]]) -> None:
    path, raw = given
    result = loaded_from(raw, "r")
    structure = read_geometry(path.with_name("g.toml"), raw)
    assert structure is not None and structure.at_rest == [1, 2, 3, 4]
    ask = (
        "(shape) => { const found = okidMotion(JSON.parse(document.getElementById('shapes-data').textContent).geometry)"
    )
    ask += ".of(shape); return [[...found.re], [...found.im], found.measured]; }"
    with opened(browser, path, reduced_motion="reduce") as page:
        for lost in (None, 1):
            shape = result.shapes[0].copy()
            if lost is not None:
                shape[lost] = np.nan
            sent = {part: [None if np.isnan(x) else x for x in getattr(shape, kind).tolist()]
                    for part, kind in (("re", "real"), ("im", "imag"))}  # fmt: skip
            re, im, measured = page.evaluate(ask, sent)
            own = structure.moved(shape)
            np.testing.assert_allclose(np.reshape(re, (-1, 3)), own.real, atol=1e-9)
            np.testing.assert_allclose(np.reshape(im, (-1, 3)), own.imag, atol=1e-9)
            assert measured == structure.measured(shape).tolist()
            assert np.all(np.abs(own[5:8, 0]) > 0.5 * np.abs(own[4, 0]))  # the other corners of the floor come along


def filled(page: Any) -> tuple[float, float]:
    """Width and height of what is drawn below the heading, as shares of the canvas."""
    url = page.evaluate("document.querySelector('.player canvas').toDataURL()")
    ink = np.asarray(Image.open(io.BytesIO(base64.b64decode(url.partition(",")[2]))))[..., 3] > 0
    rows, columns = np.nonzero(ink[28:])
    return np.ptp(columns) / ink.shape[1], np.ptp(rows) / ink.shape[0]


def test_it_fills_its_canvas_at_every_angle(browser: Any, given: tuple[Path, dict[str, Any]]) -> None:
    with opened(browser, given[0], reduced_motion="reduce") as page:
        for _ in range(6):
            wide, high = filled(page)
            assert 0.75 < max(wide, high) <= 1.0
            page.focus(".player canvas")
            for key in ("ArrowLeft", "ArrowLeft", "ArrowLeft", "ArrowDown"):
                page.keyboard.press(key)


def colours_apart(one: Image.Image, other: Image.Image) -> float:
    """Share of pixels that differ by more than what eight levels a colour make."""
    difference = np.abs(np.asarray(one.convert("RGB"), int) - np.asarray(other.convert("RGB"), int))
    return float(np.mean(np.max(difference, axis=2) > 40))


def saved(page: Any, kind: str, folder: Path) -> Path:
    with page.expect_download() as waiting:
        page.click(f"button[data-picture='{kind}']")
    target = folder / str(waiting.value.suggested_filename)
    waiting.value.save_as(target)
    return target


def test_two_modes_beside_each_other_are_saved(
    browser: Any, given: tuple[Path, dict[str, Any]], tmp_path: Path
) -> None:
    with opened(browser, given[0], reduced_motion="reduce", accept_downloads=True) as page:
        one = page.evaluate("document.querySelector('.player canvas').toDataURL()")
        page.check("input.arrows")
        assert page.evaluate("document.querySelector('.player canvas').toDataURL()") != one
        page.uncheck("input.arrows")
        assert page.evaluate("document.querySelector('.player canvas').toDataURL()") == one
        page.select_option("select.other", "2")
        assert page.evaluate("document.querySelector('.player canvas').toDataURL()") != one
        assert "beside that of mode 3: " in page.get_attribute(".player canvas", "aria-label")
        paths = {kind: saved(page, kind, tmp_path) for kind in ("gif", "png", "svg")}
        width, height = page.evaluate(
            "[document.querySelector('.player canvas')].flatMap((c) => [c.clientWidth, c.clientHeight])"
        )
    assert sorted(path.name for path in paths.values()) == ["mode-1.gif", "mode-1.png", "mode-1.svg"]
    still = Image.open(paths["png"])
    assert still.size == (2 * width, 2 * height)
    moving = Image.open(paths["gif"])
    assert (moving.n_frames, moving.info["loop"], moving.info["duration"]) == (24, 0, 70)
    frames = []
    for k in range(24):
        moving.seek(k)
        frames.append(moving.convert("RGB"))
    small = still.resize(frames[0].size, Image.Resampling.BOX)
    apart = [colours_apart(frame, small) for frame in frames]
    assert apart[0] == min(apart) and apart[0] < 0.5 * apart[12]  # the first phase is what the page shows
    assert len({frame.tobytes() for frame in frames}) >= 12
    assert colours_apart(frames[0], frames[12]) > 0.005
    picture = ET.parse(paths["svg"]).getroot()
    texts = [one.text for one in picture.iter("{http://www.w3.org/2000/svg}text")]
    assert [name for name in texts if name and name.startswith("a")] == 2 * [
        HOSTILE.replace("\x07", "�")[:23] + "…", "a2", "a3",
    ]  # fmt: skip
    assert picture.find(".//{http://www.w3.org/2000/svg}script") is None
    faces = [one for one in picture.iter("{http://www.w3.org/2000/svg}path") if one.get("fill-opacity")]
    assert len(faces) == 2 * 3


def test_the_codes_of_a_gif(browser: Any, given: tuple[Path, dict[str, Any]], tmp_path: Path) -> None:
    """Noise fills the table of the code several times, one colour never: both come back pixel by pixel."""
    make = """([seed, width, height]) => {
      let state = seed;
      const frame = new ImageData(width, height);
      for (let k = 0; k < frame.data.length; k += 4) {
        state = seed ? (state * 1103515245 + 12345) % 2147483648 : 0;
        frame.data.set([(state >> 16 & 7) << 5, (state >> 19 & 7) << 5, (state >> 22 & 3) << 6, 255], k);
      }
      return [[...okidPens.gif([frame], 7)], [...frame.data]];
    }"""
    with opened(browser, given[0], reduced_motion="reduce") as page:
        for seed in (0, 7):
            packed, pixels = page.evaluate(make, [seed, 211, 97])
            (tmp_path / "a.gif").write_bytes(bytes(packed))
            found = np.asarray(Image.open(tmp_path / "a.gif").convert("RGB"), int)
            wanted = np.array(pixels).reshape(97, 211, 4)[..., :3]
            assert np.max(np.abs(found - (wanted | (wanted >> 5)))) == 0


def test_what_the_note_says(given: tuple[Path, dict[str, Any]]) -> None:
    page = given[0].read_text()
    assert "10 of 17 nodes are not measured in every mode (rings): each follows its neighbours." in page
