# SPDX-License-Identifier: MIT
"""The runs that the pictures show: inputs out of examples/recipes, commands as the pages have them."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
from functools import cache
from pathlib import Path
from typing import Any

ROOT = Path(__file__).parents[2]
IMAGES = ROOT / "docs" / "images"
RECIPES = ROOT / "examples" / "recipes"
FOLDER = ROOT / "build" / "docs" / "pictures"
OKID = os.environ.get("OKID_PROGRAM") or str(ROOT / "build" / "okid")


def prepare() -> None:
    """The folder of the runs, with the examples in it."""
    FOLDER.mkdir(parents=True, exist_ok=True)
    IMAGES.mkdir(exist_ok=True)
    for path in RECIPES.iterdir():
        shutil.copy(path, FOLDER)


def okid(*words: str) -> str:
    """stdout of an okid command in the folder of the runs."""
    done = subprocess.run([OKID, *words], cwd=FOLDER, capture_output=True, text=True)
    assert done.returncode == 0, (words, done.stderr)
    return done.stdout


def report(result: str, *options: str) -> Path:
    """The HTML report of a result."""
    page = FOLDER / (Path(result).stem + ".html")
    subprocess.run([sys.executable, "-m", "okid.report", result, *options, "--out", page.name], cwd=FOLDER, check=True)
    return page


@cache
def hammer() -> dict[str, Any]:
    """The record of the hammer recipe, identified."""
    okid("simulate", "hammer_rig.toml", "--csv", "hits.csv", "--quiet")
    names = ("--inputs", "force1", "--outputs", "acc1,acc2,acc3", "--input-dofs", "1", "--output-dofs", "1,2,3")
    okid("identify", "hits.csv", *names, "--stabilization", "--json", "order.json")
    okid("identify", "hits.csv", *names, "--json", "hammer.json")
    return read("hammer.json")


@cache
def frame() -> dict[str, Any]:
    """The frame of the matrices recipe, identified, with its config and log."""
    okid("simulate", "frame_rig.toml", "--csv", "frame.csv", "--truth", "truth.json", "--quiet")
    okid("convert", "frame.csv", "frame.log", "-c", "lab.toml")
    names = ("--inputs", "force1", "--outputs", "acc1,acc2,acc3", "--input-dofs", "1", "--output-dofs", "1,2,3")
    okid("identify", "frame.csv", *names, "--hold", "foh", "--json", "matrices.json")
    return read("matrices.json")


@cache
def demo() -> dict[str, Any]:
    """What `make demo` identifies, with the same numbers."""
    rig = str(ROOT / "tests" / "replay" / "demo_rig.toml")
    okid("simulate", rig, "--log", "demo.log", "--config", "demo.toml", "--quiet")
    okid("replay", "demo.log", "-c", "demo.toml", "--json", "demo.json")
    okid("convert", "demo.log", "demo.csv", "-c", "demo.toml")
    return read("demo.json")


@cache
def bridge() -> dict[str, Any]:
    """Three days of the bridge recipe."""
    okid("simulate", "bridge_rig.toml", "--log", "bridge.log", "--dbc", "bridge.dbc", "--quiet")
    okid("replay", "bridge.log", "-c", "bridge.toml", "--events", "bridge.jsonl", "--json", "bridge.json")
    return read("bridge.json")


@cache
def campaign() -> Path:
    """The report of the year that the page about campaigns simulates."""
    for words in (("simulate", "year"), ("run", "year/SPEC.toml", "--quiet")):
        subprocess.run([sys.executable, "-m", "okid.campaign", *words], cwd=FOLDER, check=True)
    return FOLDER / "year" / "out" / "report.html"


def site() -> Path:
    """The documentation as web pages, its notebooks executed."""
    folder = FOLDER / "site"
    mkdocs = Path(sys.executable).with_name("mkdocs")
    subprocess.run([mkdocs, "build", "--quiet", "--site-dir", folder], cwd=ROOT, check=True)
    return folder


def read(name: str) -> dict[str, Any]:
    out: dict[str, Any] = json.loads((FOLDER / name).read_text())
    return out
