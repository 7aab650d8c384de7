# SPDX-License-Identifier: MIT
"""What a report notices by itself: a record in other units, channels without a signal, modes that the order cut off."""

from __future__ import annotations

import html
import json
import re
from pathlib import Path
from typing import Any

import numpy as np
import okid
import pytest
import report_files
from okid import report
from okid.data.records import Record
from okid.record.demo import demo_record
from okid.report.scale import agreement, doubts
from report_files import FS

pytestmark = pytest.mark.usefixtures("words_only")

G = 9.80665


@pytest.fixture(scope="module")
def frame() -> tuple[Any, Any, Any]:
    """Result in N and m/s^2 with its record."""
    u, y = demo_record(2000)
    return okid.identify(u, y, fs=FS, p=20, sigma_blocks=0), u, y


def record_of(u: Any, y: Any, units: list[str]) -> Record:
    return Record(["u1", "y1", "y2", "y3"], np.hstack([u, y]), FS, units)


def summary(page: str) -> str:
    found = re.search(r'<div class="verdict.*?</div>', page, re.DOTALL)
    assert found is not None
    return html.unescape(found.group())


def test_known_units_are_made_those_of_the_model(frame: tuple[Any, Any, Any], tmp_path: Path) -> None:
    result, u, y = frame
    loaded = report.loaded_from(result.to_dict(), "r")
    other = record_of(u / 1e3, y / [G, 1e-3 * G, 1.0], ["kN", "g", "mg", "m/s^2"])
    made = report.measured_from(loaded, other, "run")
    assert made.factor == pytest.approx(np.ones(3), abs=0.02)
    assert len(made.converted) == 3
    assert "'u1' of the record is in kN, the model in N: 1 kN is taken as 1000 N" in made.converted
    assert "'y1' of the record is in g, the model in m/s^2: 1 g is taken as 9.80665 m/s^2" in made.converted
    assert made.fit.simulation_percent == pytest.approx(result.fit.simulation_percent, abs=1e-6)
    assert made.record is not None
    assert made.record.units == ["N", "m/s^2", "m/s^2", "m/s^2"]
    report.write_report(result, tmp_path / "o.html", record=other)
    page = (tmp_path / "o.html").read_text(encoding="utf-8")
    assert "record is" not in summary(page)
    assert page.count("<code>unit_converted</code>") == 3
    assert "<h2>Fit, computed by this report</h2>" in page


def test_a_model_in_g_takes_its_record_in_g(frame: tuple[Any, Any, Any]) -> None:
    _, u, y = frame
    loaded = report.loaded_from(okid.identify(u, y / G, fs=FS, p=20, sigma_blocks=0).to_dict(), "r")
    made = report.measured_from(loaded, record_of(u, y / G, ["N", "g", "g", "g"]), "run")
    assert made.converted == []
    assert made.factor == pytest.approx(np.ones(3), abs=0.02)


def test_a_constant_factor_is_said(frame: tuple[Any, Any, Any], tmp_path: Path) -> None:
    result, u, y = frame
    report.write_report(result, tmp_path / "o.html", record=record_of(u, y / [G, 1.0, 0.5], ["N", "", "", "m/s^2"]))
    told = summary((tmp_path / "o.html").read_text(encoding="utf-8"))
    found = re.search(r"y1: record is (9\.\d+) times smaller than the model says: other units, or another rec", told)
    assert found is not None
    assert float(found.group(1)) == pytest.approx(G, rel=0.02)
    assert re.search(r"y3: record is (2|2\.0\d|1\.9\d) times larger than the model says", told)
    assert "y2: record" not in told


def test_no_factor_where_the_shape_is_another(frame: tuple[Any, Any, Any]) -> None:
    result, u, y = frame
    noise = 40.0 * np.random.default_rng(5).standard_normal(y.shape)
    model = result.model
    found = agreement(model, record_of(u, noise, ["N", "g", "g", "g"]), 1, "mean", slice(0, len(u)))
    assert np.all(np.isnan(found.factor))
    assert found.said == []
    assert doubts(found.factor, result.outputs) == []
    within = agreement(model, record_of(u, y * [1.15, 0.85, 1.0], [""] * 4), 1, "mean", slice(0, len(u)))
    assert doubts(within.factor, result.outputs) == []
    ambient = agreement(model, record_of(u, y, [""] * 4), 0, "mean", slice(0, len(u)))
    assert np.all(np.isnan(ambient.factor))


@pytest.mark.parametrize(
    ("kind", "words"),
    [
        ("missing", 'column "roof" holds no number'),
        ("constant", 'output "roof" is constant (1.5)'),
        ("force", 'input "push" is constant (2)'),
        ("short", "too few samples: 5"),
    ],
)
def test_channels_without_a_signal_have_their_names(
    tmp_path: Path, kind: str, words: str, capsys: pytest.CaptureFixture[str]
) -> None:
    u, y = demo_record(1500)
    names = ["push", "floor", "middle", "roof"]
    okid.identify(u, y, fs=FS, p=15, sigma_blocks=0, input_names=names[:1], output_names=names[1:]).save(
        tmp_path / "r.json"
    )
    rows = np.hstack([u, y])
    if kind in ("missing", "constant"):
        rows[:, 3] = np.nan if kind == "missing" else 1.5
    if kind == "force":
        rows[:, 0] = 2.0
    path = report_files.write_csv(tmp_path / "bad.csv", names, rows[:5] if kind == "short" else rows, FS)
    assert report.main([str(tmp_path / "r.json"), "--record", str(path), "--out", str(tmp_path / "o.html")]) == 2
    message = capsys.readouterr().err
    assert message.startswith(f"okid-report: {path}: ")
    assert words in message
    assert message.count("\n") == 1
    assert not (tmp_path / "o.html").exists()


def test_modes_that_the_order_cut_off() -> None:
    y = demo_record(6000)[1]
    record = Record(["y1", "y2", "y3"], y, FS)
    told = {}
    for order in (4, 6):
        result = okid.identify(None, y, fs=FS, order=order, sigma_blocks=0)
        told[order] = summary(report.build(report.loaded_from(result.to_dict(), "r"), record))
    assert re.search(
        r"the diagram holds a mode at 10\.9\d Hz that the model of order 4 does not have: try --order 6", told[4]
    )
    assert "the diagram holds" not in told[6]


DAMAGED: list[tuple[str, Any, str]] = [
    ("fs_hz", -1, "fs_hz is -1, expected a number above 0"),
    ("fs_hz", "1000", "fs_hz is '1000', expected a number above 0"),
    ("samples", 1.5, "samples is 1.5, expected a whole number"),
    ("order", None, "order is None, expected a whole number"),
    ("outputs", [], "outputs is [], expected at least one"),
    ("inputs", "u1", "inputs is 'u1', expected a list of names"),
    ("modes", "none", "modes is 'none', expected a list of objects"),
    ("modes", ["x"], "modes is ['x'], expected a list of objects"),
    ("modes.0.shape_re", [1.0], "modes[0].shape_re has 1 numbers, expected 3"),
    ("modes.0.frequency_hz", -2.0, "modes[0].frequency_hz is -2.0, expected Hz above 0"),
    ("modes.0.damping_ratio", "x", "modes[0].damping_ratio is 'x', expected a number"),
    ("modes.0.mpc", "x", "modes[0].mpc is 'x', expected a number"),
    ("singular_values", {"a": 1}, "singular_values is {'a': 1}, expected a list of numbers"),
    ("model", "A", "model is 'A', expected an object"),
    ("model.dt", 0, "model.dt is 0, expected a number above 0"),
    ("model.A", [[1.0, None]], "model.A is [[1.0, None]], expected a list of rows of finite numbers"),
    ("model.A", [[10**400]], "model.A is [[1000"),
    ("model.K", 3, "model.K is 3, expected"),
    ("markov", "x", "markov is 'x', expected an object"),
    ("markov", {"Y": [[1.0]]}, "markov.Y is [[1.0]], expected matrices of 3 rows of 1 numbers"),
    ("markov", {"Y": "x"}, "markov.Y is 'x'"),
    ("fit", [1], "fit is [1], expected an object"),
    ("fit.simulation_percent", {"y1": "x"}, "fit.simulation_percent is {'y1': 'x'}, expected an object of numbers"),
    ("mkr.checks.ww_residual", "x", "mkr.checks.ww_residual is 'x', expected a number"),
    ("mkr.M", [[1.0], "x"], "mkr.M is [[1.0], 'x'], expected a list of rows"),
    ("pdc.alpha", None, "pdc.alpha is None, expected a number"),
    ("warnings", "x", "warnings is 'x', expected a list"),
    ("detrend", 3, "detrend is 3, expected text"),
]


@pytest.fixture(scope="module")
def whole() -> dict[str, Any]:
    """An okid.result/1 with everything in it."""
    u, y = demo_record(1500)
    return okid.identify(u, y, fs=FS, p=15, sigma_blocks=0, input_dofs=[1], output_dofs=[1, 2, 3]).to_dict()


@pytest.mark.parametrize(("key", "value", "words"), DAMAGED)
def test_damaged_values_are_named(whole: dict[str, Any], key: str, value: Any, words: str) -> None:
    broken = json.loads(json.dumps(whole))
    place, *path = broken, *key.split(".")
    for step in path[:-1]:
        place = place[int(step)] if step.isdigit() else place[step]
    place[path[-1]] = value
    with pytest.raises(okid.InputError) as told:
        report.loaded_from(broken, "r.json")
    assert str(told.value).startswith(f"r.json: {words}")
    assert "\n" not in str(told.value)
    assert len(report.loaded_from(whole, "r.json").shapes) == len(whole["modes"])


def test_matrices_that_are_not_determined_are_said_so(whole: dict[str, Any]) -> None:
    """As `okid identify` writes them with the warning mkr_undetermined: every number is null."""
    raw = json.loads(json.dumps(whole))
    for name in ("M", "K", "R", "R_normal_modes"):
        raw["mkr"][name] = raw["mkr"][f"{name}_std"] = [[None] * 3] * 3
    raw["pdc"]["R"] = [[None] * 3] * 3
    assert report.build(report.loaded_from(raw, "r.json")).count("Not determined") == 5
