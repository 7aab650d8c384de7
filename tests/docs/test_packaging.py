# SPDX-License-Identifier: MIT
"""Recipes for other package managers ask for what tools/pyproject.toml asks for."""

from __future__ import annotations

import re
import tomllib
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
OTHER_NAMES = {"msgpack": "msgpack-python", "matplotlib": "matplotlib-base"}


def test_the_conda_recipe_follows_the_package() -> None:
    text = (ROOT / "packaging/conda/recipe.yaml").read_text(encoding="utf-8")
    package = tomllib.loads((ROOT / "tools/pyproject.toml").read_text(encoding="utf-8"))
    run = set(re.findall(r"- (\S+ \S+)", text.split("  run:")[1].split("tests:")[0]))
    wanted = set()
    for requirement in package["project"]["dependencies"]:
        name, limits = re.fullmatch(r"([\w-]+)(\S+)", requirement).groups()  # type: ignore[union-attr]
        wanted.add(f"{OTHER_NAMES.get(name, name)} {limits}")
    assert run == wanted
    least = package["project"]["requires-python"].removeprefix(">=")
    assert f'match(python, "<{least}")' in text and text.count("    - python\n") == 2  # for each Python, host and run
    assert f'version: "{package["project"]["version"]}"' in text
    host = text.split("  host:")[1].split("  run:")[0]
    for requirement in package["build-system"]["requires"]:
        name, limits = re.fullmatch(r"([\w-]+)(\S+)", requirement).groups()  # type: ignore[union-attr]
        assert f"- {name.removeprefix('cmeel-').replace('nlohmann-', 'nlohmann_')} {limits}" in host


def test_the_container_takes_what_a_release_makes() -> None:
    text = (ROOT / "packaging/container/Containerfile").read_text(encoding="utf-8")
    assert "manylinux" in text and "USER okid" in text
    scripts = tomllib.loads((ROOT / "tools/pyproject.toml").read_text(encoding="utf-8"))["project"]["scripts"]
    assert set(re.findall(r"okid (okid-\w+)", text)) <= set(scripts)
