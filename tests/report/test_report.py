# SPDX-License-Identifier: MIT
"""okid-report: one file, nothing from outside, the right pictures, clear refusals."""

from __future__ import annotations

import hashlib
import io
import json
import re
import subprocess
import sys
import xml.etree.ElementTree as ElementTree
from contextlib import redirect_stdout
from pathlib import Path

import numpy as np
import okid
import pytest
import systems
from okid import report


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    folder = tmp_path_factory.mktemp("report")
    s = systems.w2()
    u, y = systems.record(s, 8000, 1.0, 1)
    names = ["shaker A", "shaker <B>"] + [f"a{k}" for k in range(1, 7)]
    result = okid.identify(u, y, fs=s.fs, p=20, input_names=names[:2], output_names=names[2:])
    result.save(folder / "r.json")
    rows = "\n".join(",".join(f"{x:.9g}" for x in row) for row in np.hstack([u, y]))
    (folder / "r.csv").write_text(f"# fs_hz = {s.fs}\n{','.join(names)}\n{rows}\n", encoding="utf-8")
    return folder / "r.json", folder / "r.csv"


def pictures(html: str) -> dict[str, str]:
    """Label -> SVG of every picture; each must be whole XML, in the colours of the page, with names of its own."""
    found = re.findall(r'(<svg [^>]*aria-label="([^"]+)"[^>]*>.*?</svg>)', html, re.DOTALL)
    out = {label: svg for svg, label in found}
    for svg in out.values():
        ElementTree.fromstring(svg)
        assert not re.findall(r"#[0-9a-f]{6}\b", svg)
    names = re.findall(r' id="([^"]+)"', html)
    assert len(names) == len(set(names))
    assert {name for name in re.findall(r'(?:url\(|href=")#([^)"]+)', html)} <= set(names)
    return out


@pytest.fixture(scope="module")
def page(made: tuple[Path, Path]) -> str:
    """The report of both, written twice, a day apart: the same bytes but for one line, which tells the time."""
    written = []
    for epoch in (0, 86400):
        target = made[0].with_name(f"{epoch}.html")
        given = [str(made[0]), "--record", str(made[1]), "--out", str(target), "--title", "A & B"]
        with pytest.MonkeyPatch.context() as patch, redirect_stdout(io.StringIO()) as said:
            patch.setenv("SOURCE_DATE_EPOCH", str(epoch))
            assert report.main(given) == 0
        assert str(target) in said.getvalue()
        written.append(target.read_text(encoding="utf-8"))
    ((first, second),) = [(a, b) for a, b in zip(*(one.splitlines() for one in written), strict=True) if a != b]
    assert "1970-01-01 00:00:00 UTC" in first
    assert "1970-01-02 00:00:00 UTC" in second
    return written[0]


def test_report_with_record(made: tuple[Path, Path], page: str) -> None:
    html = page
    shown = pictures(html)
    for words in ("singular", "poles", "of the record", "mode shapes", "complex plane", "assurance", "fit", "Markov"):
        assert any(words in alt for alt in shown), words
    assert "<title>A &amp; B</title>" in html
    assert "shaker &lt;B&gt;" in html
    assert "<B>" not in html
    html = re.sub(r"<script.*?</script>", "", html, flags=re.DOTALL)  # the page's own: the browser tests look at them
    assert not re.findall(r"(?:https?:)?//\w|@import|<script|<link|<img|url\((?!#)", html)
    result = json.loads(made[0].read_text(encoding="utf-8"))
    for mode in result["modes"]:
        assert f"<td>{mode['frequency_hz']:.4f}</td>" in html
        assert mode["frequency_std_hz"] is not None
    assert html.count("<th>± σ [Hz]</th><th>ζ [%]</th><th>± σ [%]</th>") == 1
    assert html.count("<h2>") == 17
    assert "No quality warning" in html
    for kind, path in (("result", made[0]), ("record", made[1])):
        digest = hashlib.sha256(path.read_bytes()).hexdigest()
        assert f"<td>{kind}</td><td>{path}</td><td>{path.stat().st_size}</td><td>{digest}</td>" in html


def test_report_without_record_says_what_is_missing(made: tuple[Path, Path]) -> None:
    html = report.build(report.load_result(made[0]))
    assert html.count("--record") == 3
    assert len(pictures(html)) == 10


@pytest.mark.usefixtures("words_only")
def test_uncertainties_fill_their_columns(made: tuple[Path, Path], tmp_path: Path) -> None:
    data = json.loads(made[0].read_text(encoding="utf-8"))
    for mode in data["modes"]:
        mode.update(frequency_std_hz=0.00123, damping_ratio_std=None)
    data["modes"][0]["damping_ratio_std"] = 0.000456
    path = tmp_path / "sigma.json"
    path.write_text(json.dumps(data), encoding="utf-8")
    html = report.build(report.load_result(path))
    assert "± σ [Hz]" in html
    assert "<td>0.0012</td>" in html
    assert "<td>0.046</td>" in html
    assert "<td>–</td>" in html


@pytest.mark.usefixtures("words_only")
def test_live_results_without_fit_and_modes(made: tuple[Path, Path], tmp_path: Path) -> None:
    data = json.loads(made[0].read_text(encoding="utf-8"))
    data["model"]["x0"] = None
    data["fit"] = {"simulation_percent": None, "prediction_percent": None}
    data["modes"] = []
    path = tmp_path / "live.json"
    path.write_text(json.dumps(data), encoding="utf-8")
    html = report.build(report.load_result(path))
    assert "no underdamped mode" in html
    assert "holds no fit" in html
    data["modes"] = json.loads(made[0].read_text(encoding="utf-8"))["modes"]
    path.write_text(json.dumps(data), encoding="utf-8")
    live, own = report.load_result(path), report.load_result(made[0])
    html = report.build(live, made[1])
    assert "holds no fit" not in html
    assert "<h2>Fit, computed by this report</h2>" in html
    assert f"Computed by this report from {made[1]}" in html
    assert f"Computed by this report from {made[1]}: the result itself has none" in html
    assert f"Computed by this report from {made[1]}; the result itself says 99.0 %" in report.build(own, made[1])
    assert "omputed by this report" not in report.build(own)
    computed = report.measure(live, made[1]).fit
    assert computed is not None
    for key in ("simulation_percent", "prediction_percent"):
        assert getattr(computed, key) == pytest.approx(own.raw["fit"][key], abs=1e-4)


@pytest.mark.usefixtures("words_only")
def test_records_with_regular_gaps(made: tuple[Path, Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    lines = made[1].read_text(encoding="utf-8").splitlines()
    for every, words in ((97, "Hz lines; multiple coherence"), (60, "left out: the longest stretch")):
        holed = [",".join(["nan"] * 8) if k >= 2 and k % every == 0 else line for k, line in enumerate(lines)]
        (tmp_path / "gaps.csv").write_text("\n".join(holed) + "\n", encoding="utf-8")
        target = tmp_path / "gaps.html"
        status = report.main([str(made[0]), "--record", str(tmp_path / "gaps.csv"), "--out", str(target)])
        assert status == 0, capsys.readouterr().err
        html = target.read_text(encoding="utf-8")
        assert words in html
        assert ("Behind: largest singular value" in html) == (every == 97)


@pytest.mark.usefixtures("words_only")
def test_a_record_of_another_rate_is_refused(
    made: tuple[Path, Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    text = made[1].read_text(encoding="utf-8")
    rate = text.splitlines()[0].split("=")[1].strip()
    for factor, status in ((1.002, 2), (1.0005, 0)):
        (tmp_path / "r.csv").write_text(text.replace(rate, repr(float(rate) * factor), 1), encoding="utf-8")
        arguments = [str(made[0]), "--record", str(tmp_path / "r.csv"), "--out", str(tmp_path / "r.html")]
        assert report.main(arguments) == status
        message = capsys.readouterr().err
        assert ("sampled at" in message) == (status == 2)
        assert message.count("\n") == (status == 2)


def test_many_outputs_show_the_best_pairs() -> None:
    rng = np.random.default_rng(1)
    response = rng.standard_normal((50, 28, 2)) + 1j * rng.standard_normal((50, 28, 2))
    coherence = np.full((50, 28), 0.5)
    coherence[:, 20] = 1.0
    pairs = report.choose_pairs(response, coherence)
    assert len(pairs) == 4
    assert {into for _, into in pairs} == {0, 1}
    assert 20 in {out for out, _ in pairs}
    assert len({out for out, _ in pairs}) == 4
    assert report.choose_pairs(response[:, :1, :1], None) == [(0, 0)]
    assert report.choose_pairs(response[:, :1, :], None) == [(0, 0), (0, 1)]


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (None, "No such file"),
        ("{", "r.json:1:2: not JSON"),
        ("[]", "schema is None"),
        ('{"schema": "okid.result/2"}', "okid.result/2"),
        ('{"schema": "okid.result/1"}', "'fs_hz' is missing"),
    ],
)
def test_unreadable_results(
    tmp_path: Path, content: str | None, words: str, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "r.json"
    if content is not None:
        path.write_text(content, encoding="utf-8")
    assert report.main([str(path)]) == 2
    message = capsys.readouterr().err
    assert words in message
    assert message.startswith("okid-report: ")
    assert not list(tmp_path.glob("*.html"))


@pytest.mark.usefixtures("words_only")
def test_broken_matrices_and_foreign_records(
    made: tuple[Path, Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    data = json.loads(made[0].read_text(encoding="utf-8"))
    data["model"]["B"] = data["model"]["B"][:-1]
    broken = tmp_path / "broken.json"
    broken.write_text(json.dumps(data), encoding="utf-8")
    assert report.main([str(broken)]) == 2
    assert "model.B" in capsys.readouterr().err
    other = tmp_path / "other.csv"
    other.write_text("# fs_hz = 10\nx,y\n1,2\n", encoding="utf-8")
    assert report.main([str(made[0]), "--record", str(other), "--out", str(tmp_path / "o.html")]) == 2
    assert "no column 'shaker A'" in capsys.readouterr().err
    capsys.readouterr()
    assert report.main([str(made[0]), "--out", str(tmp_path / "no" / "folder.html")]) == 2
    message = capsys.readouterr().err
    assert message.startswith(f"okid-report: {tmp_path / 'no' / 'folder.html'}: No such file")
    assert ".part" not in message
    assert not list(tmp_path.glob("*.html"))


def test_help_as_a_module() -> None:
    done = subprocess.run([sys.executable, "-m", "okid.report", "--help"], capture_output=True, text=True, timeout=1800)
    assert done.returncode == 0
    assert "example:" in done.stdout
    done = subprocess.run([sys.executable, "-m", "okid.report"], capture_output=True, text=True, timeout=1800)
    assert done.returncode == 2
