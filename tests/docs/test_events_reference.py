# SPDX-License-Identifier: MIT
"""docs/reference/events.md against events of real runs: every type and key, both ways."""

from __future__ import annotations

import json
import re

import pytest
import real_events
from command_help import ROOT
from reference_tables import REFERENCE, codes, documented, keys_of, rows, sections

PAGE = REFERENCE / "events.md"
NAMED = ("bus", "channel", "notes")  # objects whose keys are the user's names
ALWAYS = {"type", "t"}
SOURCES = [
    p
    for room in ("live", "acquire", "align", "publish", "journal")
    for p in (ROOT / "firmware_host" / room).glob("*.cpp")
]
NEVER_RUN_HERE = {"lost"}  # a reader that is too slow: test_publishing.py makes one


def keys(event: real_events.Event) -> set[str]:
    inner = {key: value for key, value in event.items() if key != "result"}
    named = NAMED if event["type"] in ("stats", "start") else ()
    found = set(keys_of(inner, named)) | ({"result"} if "result" in event else set())
    return found - ALWAYS


@pytest.fixture(scope="module")
def seen(tmp_path_factory: pytest.TempPathFactory) -> dict[str, set[str]]:
    """type -> keys of all runs."""
    out: dict[str, set[str]] = {}
    for event in real_events.all_runs(tmp_path_factory.mktemp("events")):
        out.setdefault(event["type"], set()).update(keys(event))
    return out


def page() -> dict[str, dict[str, str]]:
    return {kind: documented(text) for kind, text in sections(PAGE).items()}


def test_types(seen: dict[str, set[str]]) -> None:
    assert set(seen) | NEVER_RUN_HERE == set(page())
    listed = re.findall(r"\[`(\w+)`\]\(#", PAGE.read_text())
    assert set(listed) == set(page())


def test_keys_that_runs_write_are_documented(seen: dict[str, set[str]]) -> None:
    for kind, found in seen.items():
        described = set(page()[kind])
        lacking = {key for key in found if key not in described and not any(d.startswith(f"{key}.") for d in described)}
        assert not lacking, f"{PAGE.name}, {kind}: {sorted(lacking)} are written, but not documented"


def test_keys_that_are_documented_are_written(seen: dict[str, set[str]]) -> None:
    """By the runs here; those of CAN hardware by the source."""
    source = "".join(path.read_text() for path in SOURCES)
    unseen = 0
    for kind, table in page().items():
        for key in set(table) - seen.get(kind, set()):
            last = key.rpartition(".")[2]
            assert f'"{last}"' in source or f'"{last}\\":' in source, f"{PAGE.name}, {kind}: nothing writes {key}"
            unseen += kind != "lost"
    assert unseen <= 17  # state, errors.*, sync.* of a CAN interface; clock is an object wherever it was seen


def test_examples(seen: dict[str, set[str]]) -> None:
    for kind, text in sections(PAGE).items():
        shown = re.search(r"```json\n(.*?)```", text, re.DOTALL)
        assert shown, f"{PAGE.name}: no example of {kind}"
        event = json.loads(shown[1])
        assert event["type"] == kind
        assert keys(event) <= seen.get(kind, {"count"}), kind


def test_causes_kinds_and_reasons_are_those_of_the_source() -> None:
    everything = "".join(path.read_text() for path in SOURCES + list((ROOT / "firmware_host").glob("*/*.hpp")))
    text = sections(PAGE)
    causes = {code for cells in rows(text["gap"], "cause | what was lost where") for code in codes(cells[0])}
    assert causes == {key.rpartition(".")[2] for key in documented(text["stats"]) if ".lost_by." in key}
    kinds = {code for cells in rows(text["bus"], "event | means") for code in codes(cells[0])}
    watch = (ROOT / "firmware_host" / "acquire" / "bus_watch.cpp").read_text()
    capture = (ROOT / "firmware_host" / "live" / "capture.cpp").read_text()
    told = set(re.findall(r'bus_event\(bus, "(\w+)"', capture))
    session = (ROOT / "firmware_host" / "live" / "session_update.cpp").read_text()
    told |= set(re.findall(r'\{"event", "(\w+)"\}', session))
    assert told and kinds == told | set(re.findall(r'push_back\(\s*\{"(\w+)"', watch))
    records = {code for cells in rows(text["record"], "event | means") for code in codes(cells[0])}
    recorder = (ROOT / "firmware_host" / "journal" / "recorder.cpp").read_text()
    assert records == set(re.findall(r'tell\("(\w+)"', recorder)) | {"segment", "started"} and '"segment"' in recorder
    reasons = set(codes(documented(text["hit"])["reason"])) - {"null"}
    verdict = (ROOT / "firmware_host" / "record" / "hit_verdict.cpp").read_text()
    assert len(reasons) == 8 and reasons == set(re.findall(r'refuse\(\s*"(\w+)"', verdict))
    assert all(f'"{cause}"' in everything for cause in causes)
