# SPDX-License-Identifier: MIT
"""docs/reference/check-and-bench.md against `okid check --json`, and against what the source of `okid bench` writes."""

from __future__ import annotations

import json
import pathlib
import re

from command_help import ROOT
from program import okid
from reference_tables import REFERENCE, documented, keys_of, sections

PAGE = sections(REFERENCE / "check-and-bench.md")
CONFIG = """[acquisition]
rate_hz = 500.0
title = "t"
[[bus]]
name = "line"
type = "serial"
device = "/dev/null"
framing = "ascii"
[[channel]]
name = "f"
role = "force"
unit = "N"
field = 0
[[channel]]
name = "a"
role = "acceleration"
unit = "g"
field = 1
[record]
directory = "runs"
"""


def checked(folder: pathlib.Path, more: str) -> set[str]:
    (folder / "a.toml").write_text(CONFIG + more)
    shown = json.loads(okid("check", folder / "a.toml", "--json", status=0).stdout)
    assert shown["schema"] == "okid.check/1"
    for channel in shown["channels"]:
        channel["sequence"] = None
    return set(keys_of(shown, ("notes",)))


def test_check(tmp_path: pathlib.Path) -> None:
    level = '[trigger]\nsource = "level"\nchannel = "f"\nlevel = 2.0\n'
    seen = checked(tmp_path, level) | checked(tmp_path, "[hammer]\nlevel = 20.0\n")
    described = set(documented(PAGE["okid check --json"]))
    assert seen - described <= {"hammer", "record"}, "keys that the page lacks"
    assert described == seen & described, sorted(described - seen)


def test_bench() -> None:
    described = {key.rpartition(".")[2] for key in documented(PAGE["okid bench --json"]) if key.startswith("rows[]")}
    source = "".join((ROOT / "firmware_host" / "commands" / f"bench{x}.cpp").read_text() for x in ("", "_identify"))
    rows = re.findall(r'\{\{"name", .*?\}\}?\)?;', source, re.DOTALL)
    assert len(rows) == 2
    assert described == set(re.findall(r'\{"(\w+)", ', "".join(rows)))
