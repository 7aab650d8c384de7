# SPDX-License-Identifier: MIT
"""The sections for experts, the pictures of okid.plots beside them, and every figure as SVG, PNG and numbers."""

from __future__ import annotations

import csv
import io
import re
import xml.etree.ElementTree as ET
from pathlib import Path
from typing import Any

import numpy as np
import okid
import pytest
import scipy.linalg
from okid import report
from okid.record.demo import demo_frame, demo_record
from okid.result.circle import fit_circle, lines_around
from okid.result.expert_figures import spectrogram_of
from PIL import Image

FS = 1000.0


def truth() -> tuple[Any, Any]:
    """Natural frequencies in Hz and modal masses of the shapes whose largest entry is 1."""
    frame = demo_frame()
    squares, shapes = scipy.linalg.eigh(frame.K, frame.M)
    shapes = shapes / np.max(np.abs(shapes), axis=0)
    return np.sqrt(squares) / (2.0 * np.pi), np.diag(shapes.T @ frame.M @ shapes)


@pytest.fixture(scope="module")
def forced() -> tuple[Any, Any, Any]:
    u, y = demo_record(12000)
    names = {"input_names": ["force"], "output_names": ["a1", "a2", "a3"]}
    return okid.identify(u, y, fs=FS, p=25, input_dofs=[1], output_dofs=[1, 2, 3], sigma_blocks=0, **names), u, y


def section_of(page: str, name: str) -> str:
    text = page[page.index(f'<section id="{name}"') :]
    return text[: text.index("</section>")]


def cells(section: str) -> list[list[str]]:
    rows = re.findall(r"<tr>(.*?)</tr>", section)
    return [re.findall(r"<td[^>]*>(.*?)</td>", row) for row in rows if "<td" in row]


@pytest.mark.parametrize("sensing", ["acceleration", "velocity", "displacement"])
@pytest.mark.parametrize("zeta", [0.002, 0.02, 0.08])
def test_a_circle_gives_frequency_and_damping(sensing: str, zeta: float) -> None:
    """Of any place on the circle where the lines lie, with what other modes add and the other sign."""
    for shift in (0.0, 0.3):
        f = 40.0 * (1.0 + zeta * np.linspace(-2.0 + shift, 2.0 + shift, 17))
        omega, natural = 2 * np.pi * f, 80.0 * np.pi
        mobility = -1j * omega / (3.0 * (natural**2 - omega**2 + 2j * zeta * natural * omega)) + (2e-5 - 4e-5j)
        given = mobility * (1j * omega) ** {"acceleration": 1, "velocity": 0, "displacement": -1}[sensing]
        found = fit_circle(f, given, sensing)
        assert found.frequency_hz == pytest.approx(40.0, rel=1e-6)
        assert found.damping_ratio == pytest.approx(zeta, rel=1e-4)
        assert found.radius == pytest.approx(1.0 / (12.0 * zeta * natural), rel=1e-6)
        assert found.misfit < 1e-8
        assert found.resonance == pytest.approx(-1.0 / (6.0 * zeta * natural) + 2e-5 - 4e-5j, rel=1e-4)


def test_what_is_no_circle_is_refused() -> None:
    f = np.linspace(1.0, 2.0, 9)
    for values, words in ((np.ones(9), "no resonance"), (np.ones(8), "expected .F,."), (f * 1j, "no resonance")):
        with pytest.raises(okid.InputError, match=words):
            fit_circle(f, values, "velocity")
    with pytest.raises(okid.InputError, match="5 or more"):
        fit_circle(f[:4], np.ones(4))
    assert lines_around(f, 1.5, 1e-6).tolist() == [2, 3, 4, 5, 6]


def test_a_tone_that_moves_in_the_spectrogram() -> None:
    t = np.arange(8192) / 512.0
    y = np.sin(2 * np.pi * np.where(t < 8.0, 40.0, 100.0) * t) + 5.0
    y[2000] = np.nan
    times, line, power = spectrogram_of(y, 512.0)
    seen = line[np.nanargmax(np.nan_to_num(power), axis=0)]
    gap = np.any(np.isnan(power), axis=0)
    assert 0 < np.sum(gap) < len(times) / 4
    assert np.all(np.abs(seen[~gap & (times < 7.0)] - 40.0) < 2.0) and np.all(np.abs(seen[times > 9.0] - 100.0) < 2.0)
    whole = np.sum(power[:, times > 9.0], axis=0) * (line[1] - line[0])
    np.testing.assert_allclose(whole, 0.5, rtol=0.02)  # the mean square of a sine
    with pytest.raises(okid.InputError, match="256 samples"):
        spectrogram_of(y[:100], 512.0)


@pytest.mark.usefixtures("words_only")
def test_sections_of_a_forced_record(forced: tuple[Any, Any, Any]) -> None:
    result, u, y = forced
    record = okid.Record(["force", "a1", "a2", "a3"], np.hstack([u, y]), FS, ["N", "m/s^2", "m/s^2", "m/s^2"])
    page = report.build(report.loaded_from(result.to_dict(), "r"), record)
    rows = cells(section_of(page, "modal-mass"))
    assert [float(row[2]) for row in rows] == pytest.approx(truth()[1], rel=0.02)
    assert [float(row[5]) for row in rows] == pytest.approx(1.0 / np.sqrt(truth()[1]), rel=0.02)
    assert "Units: if the force" not in page and 'aria-label="singular values of the measured responses' in page
    circles = cells(section_of(page, "nyquist-circles"))
    assert [float(row[3]) for row in circles] == pytest.approx(truth()[0], rel=0.02)
    assert "Power density of a1" in section_of(page, "spectrogram") and 'id="fdd"' not in page
    elsewhere = okid.identify(u, y, fs=FS, p=25, sigma_blocks=0)
    assert 'id="modal-mass"' not in report.build(report.loaded_from(elsewhere.to_dict(), "r"))


@pytest.mark.usefixtures("words_only")
def test_sections_of_an_ambient_record(forced: tuple[Any, Any, Any]) -> None:
    _, _, y = forced
    result = okid.identify(None, y, fs=FS, method="okid-era", sigma_blocks=0)
    page = report.build(report.loaded_from(result.to_dict(), "r"), okid.Record(["y1", "y2", "y3"], y, FS))
    assert "Frequency domain decomposition (FDD)" in section_of(page, "fdd")
    assert all(f'id="{name}"' not in page for name in ("cmif", "nyquist-circles", "modal-mass"))


def test_every_figure_in_three_files(forced: tuple[Any, Any, Any], tmp_path: Path) -> None:
    result, u, y = forced
    result.save(tmp_path / "r.json")
    record = okid.Record(["force", "a1", "a2", "a3"], np.hstack([u, y]), FS)
    okid.formats.write_record(tmp_path / "r.csv", record)
    given = [str(tmp_path / "r.json"), "--record", str(tmp_path / "r.csv")]
    assert report.main([*given, "--figures", str(tmp_path / "figs" / "own")]) == 0
    page = (tmp_path / "r.html").read_text(encoding="utf-8")
    names = sorted(path.stem for path in (tmp_path / "figs" / "own").glob("*.svg"))
    assert len(names) == page.count('<svg class="fig"') >= 12
    for name in names:
        place = tmp_path / "figs" / "own" / name
        assert ET.parse(place.with_suffix(".svg")).getroot().tag.endswith("svg")
        assert min(Image.open(place.with_suffix(".png")).size) > 200
        rows = list(csv.DictReader(place.with_suffix(".csv").open(encoding="utf-8")))
        assert rows and list(rows[0]) == ["panel", "curve", "x", "y", "value"]
    hankel = next(path for path in (tmp_path / "figs" / "own").glob("*hankel*.csv"))
    rows = list(csv.DictReader(hankel.open(encoding="utf-8")))
    shown = [float(row["y"]) for row in rows if row["curve"] == "curve 1"]
    assert shown == pytest.approx(result.singular_values[: len(shown)].tolist()) and len(shown) >= 12
    (tmp_path / "file").write_text("x", encoding="utf-8")
    assert report.main([*given, "--figures", str(tmp_path / "file")]) == 2
    plain = (tmp_path / "r.html").read_text(encoding="utf-8")
    assert report.main(given) == 0
    assert re.sub("Written.*", "", plain) == re.sub("Written.*", "", (tmp_path / "r.html").read_text(encoding="utf-8"))


def test_pictures_of_a_notebook(forced: tuple[Any, Any, Any], tmp_path: Path) -> None:
    result, u, y = forced
    measured = okid.frf.h1(u, y, FS, nperseg=4096)
    plots = okid.plots
    made = {
        "fdd": plots.fdd(y, FS, result), "cmif": plots.cmif(measured, result), "coherence": plots.coherence(measured),
        "spectrogram": plots.spectrogram(y[:, 0], FS, 100.0), "nyquist": plots.nyquist(result, measured, 1),
        "mac": plots.mac(result, result), "complexity": plots.complexity(result), "shapes": plots.shapes(result),
    }  # fmt: skip
    for name, picture in made.items():
        rows = list(csv.DictReader(io.StringIO(picture.numbers())))
        assert rows, name
        for kind in ("csv", "svg", "png"):
            picture.save(tmp_path / f"{name}.{kind}")
            assert (tmp_path / f"{name}.{kind}").stat().st_size > 100
    rows = list(csv.DictReader(io.StringIO(made["mac"].numbers())))
    assert [float(row["value"]) for row in rows if row["x"] == row["y"]] == pytest.approx([1.0, 1.0, 1.0])
    lines = [float(row["x"]) for row in csv.DictReader(io.StringIO(made["fdd"].numbers())) if row["y"] == ""]
    assert lines == pytest.approx([mode.frequency_hz for mode in result.confident_modes])
    first = [row for row in csv.DictReader(io.StringIO(made["cmif"].numbers())) if row["curve"] == "singular value 1"]
    assert [float(row["y"]) for row in first] == pytest.approx(okid.frf.cmif(measured.response[1:]).tolist())
    with pytest.raises(okid.InputError, match=r"x.txt: expected a name that ends in .csv"):
        made["mac"].save(tmp_path / "x.txt")
    with pytest.raises(okid.InputError, match="mode is 7, expected 0 to 2"):
        plots.nyquist(result, measured, 7)
    with pytest.raises(okid.InputError, match="no coherence"):
        plots.coherence(measured._replace(coherence=np.full_like(measured.coherence, np.nan)))
