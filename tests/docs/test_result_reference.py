# SPDX-License-Identifier: MIT
"""docs/reference/result.md against results of the program and the Python package, and the remarks in the source."""

from __future__ import annotations

import json
import pathlib
import re
from typing import Any

import beam
import numpy as np
import okid as package
import pytest
import systems
from command_help import ROOT
from program import okid
from reference_tables import REFERENCE, codes, documented, keys_of, rows, sections
from two_masses import rig_text, simulate_rig

PAGE = REFERENCE / "result.md"
NAMED = ("fit.simulation_percent", "fit.prediction_percent", "refinement.noise_std", "skew.us", "skew.std_us")


@pytest.fixture(scope="module")
def rig(tmp_path_factory: pytest.TempPathFactory) -> pathlib.Path:
    return simulate_rig(tmp_path_factory.mktemp("result"), rig_text(30.0))


def identified(rig: pathlib.Path, *options: str) -> dict[str, Any]:
    done = okid("identify", rig / "a.csv", "--outputs", "acc1,acc2", "--p", "12", "--json", "-", *options)
    assert done.returncode == 0, done.stderr
    out: dict[str, Any] = json.loads(done.stdout)
    return out


def everything(rig: pathlib.Path) -> list[dict[str, Any]]:
    """Results with all there can be in one: batch, ambient, live, from Python."""
    full = ("--inputs", "force1", "--input-dofs", "1", "--output-dofs", "1,2", "--refine", "--stabilization")
    done = okid("replay", rig / "a.log", "-c", rig / "a.toml", "--json", rig / "live.json", "--events", rig / "e.jsonl")
    assert done.returncode == 0, done.stderr
    record = package.read_csv(rig / "a.csv")
    u, y = record.columns(["force1"], "a.csv"), record.columns(["acc1", "acc2"], "a.csv")
    python = package.identify(u, y, fs=250.0, p=12, input_dofs=[1], output_dofs=[1, 2], refine=True)
    # a remark, for its keys: p is too long for a record so short
    remarked = identified(rig, "--inputs", "force1", "--range", "0:300")
    structure = systems.w2()  # more samples than auto keeps of 8 channels
    long = package.identify(*systems.record(structure, 66_000, 2.0, 1), fs=structure.fs, sigma="none")
    agreed = okid("identify", rig / "a.csv", "--inputs", "force1", "--outputs", "acc1,acc2", "--json", "-")
    assert agreed.returncode == 0, agreed.stderr
    picked = package.identify(u, y, fs=250.0, method="auto", picks=[17.3, 40.0], stabilization=True, sigma="none")
    hits = [beam.record(beam.Hit(place, 100.0, 0.0015), np.random.default_rng(place)) for place in (1, 2)]
    hits[0] = np.vstack([hits[0], hits[0]])  # two hits in one record
    sides = [hit[:, :1] for hit in hits], [hit[:, 1:] for hit in hits]
    struck = package.identify(*sides, fs=beam.FS, hit_dofs=[1, 2], output_dofs=[1, 5])
    parts = [package.identify(u, y[:, order], fs=250.0, p=12, output_names=names)
             for order, names in (([0, 1], ["a", "b"]), ([1, 0], ["b", "c"]))]  # fmt: skip
    return [
        json.loads(agreed.stdout),
        picked.to_dict(),
        package.merge(parts).to_dict(),
        struck.to_dict(),
        package.identify_frf(package.frf.h1(u, y, 250.0, nperseg=1024)).to_dict(),
        identified(rig, *full),
        identified(rig, "--method", "n4sid-cva"),
        identified(rig, "--sensing", "acceleration,velocity"),
        remarked,
        python.to_dict(),
        long.to_dict(),
        json.loads((rig / "live.json").read_text()),
    ]


def test_keys_both_ways(rig: pathlib.Path) -> None:
    described = set(documented(PAGE.read_text()))
    seen: set[str] = set()
    for result in everything(rig):
        seen |= set(keys_of(result, NAMED))
    whole = {"fit.simulation_percent", "fit.prediction_percent", "warnings"}  # null or an empty list
    assert seen - described <= whole, sorted(seen - described)
    assert described - seen == set()


def source_codes() -> set[str]:
    """Codes of remarks: those of the library, of its M, K, R, of the host program and of the Python package."""
    library = "".join(path.read_text() for path in (ROOT / "lib" / "src").rglob("*.cpp"))
    out = set(re.findall(r'case OKID_NOTE_\w+: return "(\w+)"', library + _c_sources()))
    out |= {f"mkr_{name}" for name in re.findall(r'case OKID_MKR_\w+: return "(\w+)"', library)}
    for path in (ROOT / "firmware_host").rglob("*.cpp"):
        lists = "warnings|said|out|unit_remarks|failed_"
        said = rf'(?:(?:{lists})\.emplace_back\(\s*"(\w+)",|return \{{"(\w+)",\s*fmt::format)'
        out |= {one or other for one, other in re.findall(said, path.read_text())}
    for path in (ROOT / "tools" / "okid").rglob("*.py"):
        out |= set(re.findall(r'Remark\(\s*f?"(\w+)"', path.read_text()))
    return out


def _c_sources() -> str:
    return "".join(path.read_text() for path in (ROOT / "lib" / "src").rglob("*.c"))


def test_warning_codes_both_ways() -> None:
    found = source_codes()
    assert {"arx_stabilised", "mkr_polarity", "resampled", "skew_large"} <= found and len(found) >= 44
    table = {
        codes(cells[0])[0]: cells for cells in rows(sections(PAGE)["warnings"], "code | what it means | what to do")
    }
    assert set(table) == found
    assert all(cells[1] and cells[2] for cells in table.values())
