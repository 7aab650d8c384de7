# SPDX-License-Identifier: MIT
"""docs/comparison.md names every program that tests/bench/peers measures, in the version that it installs."""

from __future__ import annotations

import importlib.util
import re
from pathlib import Path

ROOT = Path(__file__).parents[2]
PEERS = ROOT / "tests" / "bench" / "peers"
PAGE = (ROOT / "docs" / "comparison.md").read_text(encoding="utf-8")
PROGRAMS = {  # as the table of versions names them: the distribution
    "SIPPY": "sippy_unipi",
    "nfoursid": "nfoursid",
    "strid": "strid",
    "modred": "modred",
    "systemID": "systemID",
    "mdof": "mdof",
    "ctrlsys": "ctrlsys",
    "python-control": "control",
    "llsi": "llsi",
    "pyOMA-2": "pyOMA_2",
    "sdypy-EMA": "sdypy-EMA",
    "python-can": "python-can",
    "cantools": "cantools",
    "asammdf": "asammdf",
    "NumPy": "numpy",
    "SciPy": "scipy",
}


def tables() -> list[list[list[str]]]:
    """Tables of the page: rows of cells, the ruler between head and body left out."""
    found: list[list[list[str]]] = [[]]
    for line in PAGE.splitlines():
        if line.startswith("|"):
            cells = [cell.strip() for cell in line.strip("|").split("|")]
            if set("".join(cells)) != {"-"}:
                found[-1].append(cells)
        elif found[-1]:
            found.append([])
    return [table for table in found if table]


def test_versions_are_the_pinned_ones() -> None:
    pins: dict[str, str] = {}
    for path in PEERS.glob("requirements*.txt"):
        pins |= dict(re.findall(r"^([\w.-]+)==(\S+)$", path.read_text(encoding="utf-8"), re.M))
    said = {row[0]: row[1] for table in tables() if table[0][:2] == ["program", "version"] for row in table[1:]}
    assert {name: said.get(name) for name in PROGRAMS} == {name: pins.get(pin) for name, pin in PROGRAMS.items()}


def test_every_measured_program_and_way_has_its_rows() -> None:
    spec = importlib.util.spec_from_file_location("peers_tables", PEERS / "tables.py")
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    programs = {row[0] for table in tables() if table[0][:2] == ["program", "way"] for row in table[1:]}
    assert programs == set(module.NAMES.values())
    adapters = {path.stem for path in (PEERS / "adapters").glob("*.py")} - {"shapes"}
    assert adapters == set(module.NAMES)


def test_rows_are_as_wide_as_their_heads() -> None:
    widths = [{len(row) for row in table} for table in tables()]
    assert len(widths) > 5 and all(len(one) == 1 for one in widths)


def test_every_script_has_a_row() -> None:
    rows = {row[0] for table in tables() if table[0][0] == "script" for row in table[1:]}
    there = {f"`{path.name}`" for path in (PEERS / "scripts").glob("*.py")}
    assert there <= rows
