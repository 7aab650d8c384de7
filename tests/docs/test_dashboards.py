# SPDX-License-Identifier: MIT
"""Dashboards and the layout of PlotJuggler ask for names that the program sends, and for no other."""

from __future__ import annotations

import json
import re
import xml.etree.ElementTree
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
FOLDER, PUBLISH = ROOT / "docs/dashboards", ROOT / "firmware_host/publish"


@pytest.mark.parametrize(("name", "source"), [("prometheus", "metrics.cpp"), ("influxdb", "influx_lines.cpp")])
def test_a_dashboard_asks_for_what_is_sent(name: str, source: str) -> None:
    sent = set(re.findall(r'"([a-z][a-z_]*)"', (PUBLISH / source).read_text(encoding="utf-8")))
    panels = json.loads((FOLDER / f"okid-{name}.json").read_text(encoding="utf-8"))["panels"]
    asked = [one.get("expr") or one["query"] for panel in panels for one in panel["targets"]]
    words = {word for text in asked for word in re.findall(r'\bokid[a-z_]*|_field == "([a-z_]+)"', text)} - {""}
    words |= {word for text in asked for word in re.findall(r"\bokid[a-z_]*", text)}
    assert len(asked) >= 7 and words and words <= sent, words - sent


def test_the_layout_plots_what_datagrams_hold() -> None:
    tree = xml.etree.ElementTree.parse(FOLDER / "okid-plotjuggler.xml")
    curves = [str(one.get("name")) for one in tree.iter("curve")]
    words = {found[1] for found in (re.fullmatch(r"/mode\d_([a-z_]+)", one) for one in curves) if found}
    code = (PUBLISH / "flat_modes.cpp").read_text(encoding="utf-8")
    assert len(curves) == 12 and len(words) == 3 and all(f'name + "{word}"' in code for word in words)
