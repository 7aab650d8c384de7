# SPDX-License-Identifier: MIT
"""The verdict of a report: rate by the time stamps, warnings of every code, events of another run, what is unseen."""

from __future__ import annotations

import html
import json
import re
from pathlib import Path
from typing import Any

import numpy as np
import okid
import pytest
from okid import report
from okid.record.demo import demo_record
from okid.report.events import read_events
from okid.report.result_warnings import HARMLESS
from okid.report.stamps import TOLERANCE
from report_files import FS

pytestmark = pytest.mark.usefixtures("words_only")

ROOT = Path(__file__).parents[2]


@pytest.fixture(scope="module")
def raw() -> dict[str, Any]:
    """A result that nothing speaks against."""
    u, y = demo_record(4000)
    made = okid.identify(u, y, fs=FS, p=40, rows=40, order=6, sigma_blocks=0).to_dict()
    assert made["warnings"] == []
    return made


def written(path: Path, names: list[str], stamped_hz: float | None, seconds: float = 5.0, **start: Any) -> Path:
    """Events of a run of these channels with two `stats`, of which the last counts."""
    counts = {name: {"expected": 5000, "received": 5000} for name in names}
    lines: list[dict[str, Any]] = [
        {"type": "start", "t": 0.0, "rate_hz": FS, "channels": [{"name": name} for name in names], **start},
        {"type": "stats", "t": 0.1, "channel": counts, "rate_hz_by_stamps": 10.0},
        {"type": "stats", "t": seconds, "channel": counts, "rate_hz_by_stamps": stamped_hz},
    ]
    path.write_text("".join(json.dumps(line) + "\n" for line in lines), encoding="utf-8")
    return path


def shown(raw: dict[str, Any], **more: Any) -> str:
    """The verdict as HTML."""
    found = re.search(r'<div class="verdict.*?</div>', report.build(report.loaded_from(raw, "r"), **more), re.DOTALL)
    assert found is not None
    return html.unescape(found.group())


CHANNELS = ["u1", "y1", "y2", "y3"]


@pytest.mark.parametrize(
    ("stamped_hz", "seconds", "doubtful"),
    [
        (498.0, 5.0, True), (979.0, 5.0, True), (981.0, 5.0, False), (1019.0, 5.0, False), (1021.0, 5.0, True),
        (1035.0, 0.1, False), (1045.0, 0.1, True),  # of 100 samples one more or less is nothing
    ],
)  # fmt: skip
def test_the_rate_by_the_time_stamps(
    raw: dict[str, Any], tmp_path: Path, stamped_hz: float, seconds: float, doubtful: bool
) -> None:
    told = shown(raw, events=written(tmp_path / "e.jsonl", CHANNELS, stamped_hz, seconds))
    sentence = f"by the time stamps {stamped_hz:.4g} samples came a second, fs is 1000: every frequency scales with it"
    assert (sentence in told) == doubtful
    assert ('class="verdict doubt"' in told) == doubtful
    assert ("rate by the time stamps" in told) == (not doubtful)  # among what was looked at
    assert "rate by the time stamps (" not in told


def test_the_tolerance_is_that_of_the_program() -> None:
    text = (ROOT / "firmware_host" / "live" / "session.cpp").read_text(encoding="utf-8")
    found = re.search(r"constexpr double tolerance = ([\d.]+);", text)
    assert found is not None
    assert float(found[1]) == TOLERANCE


def test_what_was_not_looked_at_is_said(raw: dict[str, Any], tmp_path: Path) -> None:
    bare = shown(raw)
    assert "No quality warning in what was checked: warnings of the identification, consistency" in bare
    assert "rate by the time stamps (no events given)" in bare
    assert "Not checked: completeness, units, modes that the order cut off, whiteness of the residual (no rec" in bare
    assert "that several methods agree on the modes (one was named)" in bare
    raw = raw | {"judged_by": "agreement"}
    silent = shown(raw, events=written(tmp_path / "e.jsonl", CHANNELS, None))
    assert "rate by the time stamps (not in the events)" in silent
    u, y = demo_record(4000)
    record = okid.Record(CHANNELS, np.hstack([u, y]), FS)
    whole = shown(raw, events=written(tmp_path / "e.jsonl", CHANNELS, FS), record=record)
    assert "Not checked" not in whole
    page = report.build(report.loaded_from(raw, "r"), events=written(tmp_path / "e.jsonl", CHANNELS, 1000.25))
    assert "<th>Rate by the stamps</th><td>1000.25 Hz</td>" in page
    assert whole.endswith("whiteness of the residual, rate by the time stamps.</p></div>")


def test_events_of_another_run(raw: dict[str, Any], tmp_path: Path) -> None:
    told = shown(raw, events=written(tmp_path / "e.jsonl", ["u1", "y1", "a", "b"], 498.0, rate_hz=500.0))
    assert "e.jsonl is of a run at 500 Hz, the result of 1000 Hz: another run?" in told
    assert "e.jsonl has no channel y2, y3, which the result has: another run?" in told
    assert "samples came a second" not in told
    assert "rate by the time stamps (the events are of another rate)" in told


def test_remarks_of_every_code_are_shown_and_named(raw: dict[str, Any]) -> None:
    given: list[Any] = [
        {"code": "saturated", "text": "12 codes <stood> at full scale"},
        {"code": "of_a_newer_okid", "text": "something that this report has never heard of"},
        {"code": "decimated", "text": "one sample of 4 is kept"},
        "only text", {"code": "bare"}, {"text": "no code"}, None,
    ]  # fmt: skip
    page = report.build(report.loaded_from({**raw, "warnings": given}, "r"))
    items = [html.unescape(one) for one in re.findall(r"<li.*?</li>", page)]
    assert items == [
        "<li><code>saturated</code> 12 codes <stood> at full scale</li>",
        "<li><code>of_a_newer_okid</code> something that this report has never heard of</li>",
        '<li class="mild"><code>decimated</code> one sample of 4 is kept</li>',
        "<li><code>warning</code> only text</li>",
        '<li><code>bare</code> {"code": "bare"}</li>',
        "<li><code>warning</code> no code</li>",
        "<li><code>warning</code> null</li>",
    ]
    told = shown({**raw, "warnings": given})
    assert "Look at: the warnings below (saturated, of_a_newer_okid, warning, bare)." in told
    mild = shown({**raw, "warnings": given[2:3]})
    assert 'class="verdict"' in mild
    assert "No quality warning" in mild


def test_every_doubt_leaves_room_for_the_remarks(raw: dict[str, Any], tmp_path: Path) -> None:
    """However many doubts there are, those on the rate and on the warnings are named."""
    weak = [{**mode, "emac": 0.1} for mode in raw["modes"]]
    poor = {**raw, "modes": weak, "warnings": [{"code": "saturated", "text": "x"}]}
    poor["fit"] = {"simulation_percent": dict.fromkeys(raw["outputs"], 5.0), "prediction_percent": None}
    path = written(tmp_path / "e.jsonl", CHANNELS, 498.0)
    with path.open("a", encoding="utf-8") as file:
        for line in (
            {"type": "change", "t": 1.0},
            {"type": "alarm", "t": 1.0, "mode": 1, "frequency_hz": 1.0, "baseline_hz": 2.0},
            {"type": "bus", "t": 1.5, "bus": "can9", "event": "unheard", "text": "nothing"},
            {"type": "bus", "t": 2.0, "bus": "can0", "event": "unheard", "text": "no frame of 0x101 <acc1>"},
            {"type": "bus", "t": 3.0, "bus": "can0", "event": "unheard", "text": "again"},
            {"type": "bus", "t": 4.0, "bus": "can1", "event": "link_up", "text": "there again"},
        ):
            file.write(json.dumps(line) + "\n")
    told = shown(poor, events=path)
    assert told.index("by the time stamps 498 samples") < told.index("the simulation explains only")
    assert (
        "bus can0: unheard (in Frequencies over time); 1 alarm; and more below; the warning below (saturated)." in told
    )
    assert "can1" not in told
    page = report.build(report.loaded_from(poor, "r"), events=path)
    assert "<td>2</td><td>bus can0</td><td>unheard: no frame of 0x101 &lt;acc1&gt;</td>" in page


def test_harmless_are_the_codes_that_the_reference_asks_nothing_for() -> None:
    page = (ROOT / "docs" / "reference" / "result.md").read_text(encoding="utf-8")
    rows = re.findall(r"(?m)^\| `(\w+)` \| [^|]+ \| ([^|]+) \|$", page[page.index("## warnings") :])
    assert len(rows) > 30
    assert {code for code, remedy in rows if remedy.startswith("nothing")} == HARMLESS


@pytest.mark.parametrize(
    ("event", "words"),
    [
        ({"channel": {"y1": {"expected": "x", "received": 1}}}, "not a complete 'stats' event: ValueError"),
        ({"channel": {"y1": {"received": 1}}}, "not a complete 'stats' event: KeyError: 'expected'"),
        ({"channel": {}, "bus": {"can0": 3}}, "not a complete 'stats' event: AttributeError"),
        ({"channel": [], "bus": {}}, "not a complete 'stats' event: AttributeError"),
    ],
)
def test_counts_that_are_none_are_named(tmp_path: Path, event: dict[str, Any], words: str) -> None:
    path = tmp_path / "e.jsonl"
    path.write_text(json.dumps({"type": "stats", "t": 1.0, **event}) + "\n", encoding="utf-8")
    with pytest.raises(okid.InputError) as told:
        read_events(path)
    assert str(told.value).startswith(f"{path}:1: {words}")
