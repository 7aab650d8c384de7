# SPDX-License-Identifier: MIT
"""What goes into a report beside the result: events, geometry, other formats, strange names; and refusals."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

import numpy as np
import okid
import pytest
import report_files
from okid import report
from okid.record.demo import demo_record
from okid.report.events import read_events
from okid.report.geometry import read_geometry
from okid.report.provenance import without_passwords
from report_files import FS

NODES = "[geometry]\nnodes = [[0, 0, 0], [0, 0, 1], [1, 0, 1]]\n"


@pytest.fixture(scope="module")
def small(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Any, Any]:
    """A result file with its record."""
    u, y = demo_record(2000)
    path = tmp_path_factory.mktemp("small") / "r.json"
    okid.identify(u, y, fs=FS, p=20, sigma_blocks=0).save(path)
    return path, u, y


def test_events_as_a_run_writes_them(tmp_path: Path) -> None:
    events = read_events(report_files.write_events(tmp_path / "e.jsonl", ["a", "b"], [10.0, 20.0]))
    assert events.updates == 60
    assert {track: len(points) for track, points in events.tracks.items()} == {1: 60, 2: 60}
    assert events.alarms[0][:2] == (42.0, None)
    assert events.changes == [41.5]
    assert events.gaps == {("a", "sequence"): 4}
    assert events.notes["operator"] == "<i>me</i>"
    assert not events.tracks[1][2].settled
    assert events.tracks[1][5].settled


def test_a_killed_run_and_modes_without_a_track(tmp_path: Path) -> None:
    mode = {"frequency_hz": 5.0, "damping_ratio": 0.1}
    lines = [
        {"type": "alarm", "t": 1.0, "mode": 1, "frequency_hz": 4.0, "baseline_hz": 5.0},
        {"type": "alarm_over", "t": 3.0},
        {"type": "modes", "t": 1.0, "modes": [mode, {**mode, "track": None}], "settled": True},
        {"type": "lost", "count": 7},
    ]
    path = tmp_path / "e.jsonl"
    path.write_text("\n".join(json.dumps(line) for line in lines) + '\n{"type":"sta', encoding="utf-8")
    events = read_events(path)
    assert [track for track in events.tracks] == [1]  # a mode of an old file counts by its place, a new one has none
    assert events.alarms[0][1] == 3.0
    assert events.lost_lines == 7


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ('{"type":"start"}\n{"type":\n{}\n', "e.jsonl:2:"),
        ("[1]\n", "e.jsonl:1: expected an event"),
        ('{"type":"modes","modes":[{"track":1}]}\n', "e.jsonl:1: not a complete 'modes' event"),
        ('{"type":"stats","t":"x"}\n', "e.jsonl:1: not a complete 'stats' event"),
        ("", "no event of okid"),
        (b"\xff\xfe", "not UTF-8"),
        (None, "No such file"),
    ],
)
def test_events_that_are_none(tmp_path: Path, text: str | bytes | None, words: str) -> None:
    path = tmp_path / "e.jsonl"
    if text is not None:
        path.write_bytes(text if isinstance(text, bytes) else text.encode())
    with pytest.raises(okid.InputError) as told:
        read_events(path)
    assert words in str(told.value)
    assert "\n" not in str(told.value)


def test_geometry_follows_the_numbers_of_the_channels(tmp_path: Path) -> None:
    path = tmp_path / "c.toml"
    path.write_text(NODES + 'dofs = [[2, "x"], [3, "-z"]]\nlines = [[1, 2]]\n', encoding="utf-8")
    by_order = read_geometry(path, {"outputs": ["a", "b"]})
    assert by_order is not None
    assert by_order.places == [(2, "x"), (3, "-z")]
    live = {"b": {"dof": 1}, "a": {"dof": -2}, "c": {"dof": None}}
    by_run = read_geometry(path, {"outputs": ["a", "b", "c"]}, live)
    assert by_run is not None
    assert by_run.places == [(3, "z"), (2, "x"), None]
    path.write_text(path.read_text() + '[[channel]]\nname = "a"\ndof = 1\n', encoding="utf-8")
    by_config = read_geometry(path, {"outputs": ["a"]}, live)
    assert by_config is not None
    assert by_config.places == [(2, "x")]
    assert by_config.moved(np.array([0.5j])).tolist() == [[0, 0, 0], [0.5j, 0, 0], [0, 0, 0]]
    path.write_text("[acquisition]\n", encoding="utf-8")
    assert read_geometry(path, {"outputs": ["a"]}) is None


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("geometry = 3\n", "expected a section [geometry]"),
        ("[geometry]\nnodes = []\n", "nodes is []"),
        ("[geometry]\nnodes = [[0, 0]]\n", "nodes, entry 1: found [0, 0], expected [x, y, z]"),
        (NODES + "dofs = [[4, 'x']]\n", "dofs, entry 1: found [4, 'x'], expected a node from 1 to 3"),
        (NODES + "dofs = [[1, 'w']]\n", "expected a node from 1 to 3 and one of x y z"),
        (NODES + "dofs = [[1, 'x'], [2, 'x']]\nlines = [[1, 9]]\n", "lines, entry 1: found [1, 9], expected two nodes"),
        (NODES + "dofs = [[1, 'x']]\n", "1 places and the result 2 outputs"),
        (NODES + "dofs = [[1, 'x']]\n[[channel]]\nname = 'b'\ndof = 5\n", "'b' is at dof 5"),
        ("[geometry\n", "not TOML"),
    ],
)
def test_geometry_that_is_wrong(tmp_path: Path, text: str, words: str) -> None:
    (tmp_path / "c.toml").write_text(text, encoding="utf-8")
    with pytest.raises(okid.InputError) as told:
        read_geometry(tmp_path / "c.toml", {"outputs": ["a", "b"]})
    assert words in str(told.value)
    assert "c.toml" in str(told.value)


def test_refusals_are_one_line(
    small: tuple[Path, Any, Any], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "empty.toml").write_text("", encoding="utf-8")
    for option, name, words in (
        ("--events", "missing.jsonl", "No such file"),
        ("--geometry", "empty.toml", "no section [geometry]"),
        ("--config", "missing.toml", "No such file"),
        ("--record", "missing.parquet", "missing.parquet"),
        ("--record", "r.docx", "r.docx"),
    ):
        (tmp_path / "r.docx").write_bytes(b"x")
        given = [str(small[0]), option, str(tmp_path / name), "--out", str(tmp_path / "o.html")]
        assert report.main(given) == 2
        message = capsys.readouterr().err
        assert words in message
        assert message.count("\n") == 1
        assert not (tmp_path / "o.html").exists()


def test_results_with_odd_names_and_numbers(small: tuple[Path, Any, Any], tmp_path: Path) -> None:
    data = json.loads(small[0].read_text(encoding="utf-8"))
    data["outputs"] = ["a\u0001\n\u2028", "b\ufffd", "\u4e2d\u6587 \u202e$\\frac$" + "x" * 300]
    data["warnings"] = [{"code": "<b>", "text": "</section>\u0000"}, "no object"]
    (tmp_path / "odd.json").write_text(json.dumps(data), encoding="utf-8")
    assert report.main([str(tmp_path / "odd.json"), "--out", str(tmp_path / "odd.html")]) == 0
    html = (tmp_path / "odd.html").read_bytes().decode("utf-8")
    assert "<code>&lt;b&gt;</code> &lt;/section&gt;\ufffd" in html
    assert not [c for c in html if ord(c) < 32 and c not in "\n\t"]
    for key, value in (("A", [[None]]), ("A", "x"), ("C", [])):
        broken = {**data, "model": {**data["model"], key: value}}
        with pytest.raises(okid.InputError):
            report.loaded_from(broken, "r.json")
    for broken in ({**data, "outputs": [1, 2, 3]}, {**data, "modes": [{}]}, {**data, "singular_values": []}):
        with pytest.raises(okid.InputError):
            report.loaded_from(broken, "r.json")


def test_a_live_result_is_compared_with_the_end_of_the_run(small: tuple[Path, Any, Any], tmp_path: Path) -> None:
    path, u, y = small
    raw = json.loads(path.read_text(encoding="utf-8"))
    raw["fit"] = {"simulation_percent": None, "prediction_percent": None}
    other = np.random.default_rng(2)
    before = np.hstack([u, y])[:500] * other.standard_normal((500, 4))  # another structure
    whole = np.vstack([before, np.hstack([u, y])])
    whole[3, 0] = np.nan
    record = report_files.write_csv(tmp_path / "run.csv", ["u1", "y1", "y2", "y3"], whole, FS)
    measured = report.measure(report.loaded_from(raw, "r.json"), record)
    assert measured.part == "the last 2000 of 2500 samples, which the result rests on"
    assert measured.missing is not None
    assert measured.missing.tolist() == [1, 0, 0, 0]
    assert measured.samples == 2500
    assert measured.fit is not None
    assert min(v for v in measured.fit.simulation_percent.values() if v is not None) > 95.0
    assert measured.excerpt is not None
    assert measured.excerpt.time_s[0] >= 0.5


def test_records_of_other_formats(small: tuple[Path, Any, Any], tmp_path: Path) -> None:
    from okid import formats

    path, u, y = small
    record = okid.Record(["u1", "y1", "y2", "y3"], np.hstack([u, y]), FS, ["N", "m/s^2", "m/s^2", "m/s^2"])
    formats.write_record(tmp_path / "r.mat", record)
    assert report.main([str(path), "--record", str(tmp_path / "r.mat"), "--out", str(tmp_path / "r.html")]) == 0
    html = (tmp_path / "r.html").read_text(encoding="utf-8")
    assert "y1 / u1  [(m/s²)/N]" in html
    assert "Time histories" in html


@pytest.mark.usefixtures("words_only")
def test_the_report_of_a_result_in_memory(tmp_path: Path) -> None:
    u, y = demo_record(1500)
    result = okid.identify(u, y, fs=FS, p=15, sigma_blocks=0)
    size = report.write_report(result, tmp_path / "r.html", title="T")
    assert (tmp_path / "r.html").stat().st_size == size
    with pytest.raises(OSError, match=r"no.r\.html"):
        report.write_report(result, tmp_path / "no" / "r.html")
    assert [path.name for path in tmp_path.iterdir()] == ["r.html"]


def test_passwords_stay_out() -> None:
    text = 'mqtt = "mqtt://user:p%2Fw@host/okid"\nudp = "127.0.0.1:9870"\nmail = "a@b"'
    assert without_passwords(text) == 'mqtt = "mqtt://…@host/okid"\nudp = "127.0.0.1:9870"\nmail = "a@b"'


def test_the_stabilization_diagram_explains_itself(small: tuple[Path, Any, Any], tmp_path: Path) -> None:
    """Every mark and line of the picture is named in its legend and in the words below it; so is the order used."""
    path, u, y = small
    record = okid.Record(["u1", "y1", "y2", "y3"], np.hstack([u, y]), FS)
    loaded = report.load_result(path)
    order, modes = loaded.raw["order"], len(loaded.raw["modes"])
    page = report.build(loaded, record)
    section = page[page.index('<section id="stabilization">') :]
    section = section[: section.index("</section>")]
    legend = re.findall(r"<text[^>]*>([^<]+)</text>", section)
    for text in (
        "pole: frequency, damping, shape stable", "frequency and shape stable", "only the frequency stable",
        "none of them stable", "column found (band, ring)", "mode of this model", f"order of this model: {order}",
        "measured, dB",
    ):  # fmt: skip
        assert legend.count(text) == 1, text
    words = " ".join(re.findall(r'<p class="note">(.*?)</p>', section))
    for text in (
        "How to read it: the record was identified again with orders from 2 to",
        f"Blue dashed line: order {order}, that of the model of this report; green vertical lines: the {modes} "
        "confident modes of this report",
        "within 1 % in frequency, 5 % in damping and with the same shape (MAC ≥ 0.98)",
        "Green dot:", "Blue triangle:", "Orange diamond:", "Red cross:", "Grey point:", "ring: the pole nearest",
        f"Blue bands: {len(report.measured_from(loaded, record, 'r').rows.modes)} columns found by the program",
        "Behind: largest singular value of the measured responses",
    ):  # fmt: skip
        assert text in words, text
    assert f"Blue: the {order} that this model keeps" in page


def section_of(page: str, name: str) -> str:
    text = page[page.index(f'<section id="{name}"') :]
    return text[: text.index("</section>")]


def test_a_rejected_mode_is_drawn_as_rejected(small: tuple[Path, Any, Any]) -> None:
    path, u, y = small
    raw = json.loads(path.read_text(encoding="utf-8"))
    raw["modes"][1].update(confident=False, why=["tone"])
    record = okid.Record(["u1", "y1", "y2", "y3"], np.hstack([u, y]), FS)
    section = section_of(report.build(report.loaded_from(raw, "r"), record), "stabilization")
    legend = re.findall(r"<text[^>]*>([^<]+)</text>", section)
    assert legend.count("mode of this model") == legend.count("doubtful: rejected") == 1
    assert "the 2 confident modes of this report" in section
    assert "Grey dotted: the 1 doubtful mode, with the reason in Modes." in section


@pytest.mark.usefixtures("words_only")
def test_automac_of_few_sensors_says_so(small: tuple[Path, Any, Any]) -> None:
    path, _, _ = small
    raw = json.loads(path.read_text(encoding="utf-8"))
    few = "seen at 2 places only: at most 2 shapes can be told apart"
    assert few not in report.build(report.loaded_from(raw, "r"))
    for mode in raw["modes"]:
        mode.update(shape_re=mode["shape_re"][:2], shape_im=mode["shape_im"][:2])
    raw["shape_dofs"] = [1, 2]
    assert few in section_of(report.build(report.loaded_from(raw, "r")), "automac")


@pytest.mark.usefixtures("words_only")
def test_pictures_that_leave_modes_out_say_so(small: tuple[Path, Any, Any]) -> None:
    path, _, _ = small
    raw = json.loads(path.read_text(encoding="utf-8"))
    raw["modes"] = [{**raw["modes"][0], "frequency_hz": 1.0 + k, "confident": True, "why": []} for k in range(70)]
    page = report.build(report.loaded_from(raw, "r"))
    assert "The 16 of 70 confident modes with the highest EMAC are shown." in section_of(page, "shapes")
    assert "Pictures: 16 of 70 confident modes, those with the highest EMAC." in section_of(page, "complexity")
    assert "Shown: 60 of 70 confident modes, those with the highest EMAC." in section_of(page, "automac")
