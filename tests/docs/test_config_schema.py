# SPDX-License-Identifier: MIT
"""docs/reference/config.schema.json is that of config.md, takes what okid takes, and refuses what it refuses."""

from __future__ import annotations

import importlib.util
import json
import tomllib
from typing import Any

import pytest
from page_runner import ROOT

SCHEMA: dict[str, Any] = json.loads((ROOT / "docs" / "reference" / "config.schema.json").read_text())
CONFIGS = [path for path in sorted((ROOT / "examples" / "recipes").glob("*.toml")) if "rig" not in path.stem]


def test_it_is_made_from_the_page() -> None:
    spec = importlib.util.spec_from_file_location("config_schema", ROOT / "tools" / "config_schema.py")
    assert spec and spec.loader
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    assert module.schema() == SCHEMA, "run tools/config_schema.py"


def faults(value: Any, rule: dict[str, Any], at: str = "") -> list[str]:
    """The part of JSON Schema that is used here."""
    if "anyOf" in rule:
        return [] if any(not faults(value, one, at) for one in rule["anyOf"]) else [at]
    if "enum" in rule or "const" in rule:
        return [] if value in rule.get("enum", [rule.get("const")]) else [at]
    kinds = {"integer": int, "number": (int, float), "string": str, "boolean": bool, "array": list, "object": dict}
    named = rule["type"] if isinstance(rule["type"], list) else [rule["type"]]
    fits = any(isinstance(value, kinds[one]) and (isinstance(value, bool) == (one == "boolean")) for one in named)
    if not fits or value_out_of_range(value, rule):
        return [at]
    if isinstance(value, dict) and "properties" in rule:
        known = rule["properties"]
        unknown = [f"{at}.{key}" for key in value if key not in known]
        lacking = [f"{at}.{key}" for key in rule.get("required", ()) if key not in value]
        return (
            unknown
            + lacking
            + [x for key in value if key in known for x in faults(value[key], known[key], f"{at}.{key}")]
        )
    if isinstance(value, list) and "items" in rule:
        return [x for one in value for x in faults(one, rule["items"], f"{at}[]")]
    return []


def value_out_of_range(value: Any, rule: dict[str, Any]) -> bool:
    if isinstance(value, bool) or not isinstance(value, int | float):
        return False
    low, above, high = rule.get("minimum"), rule.get("exclusiveMinimum"), rule.get("maximum")
    return (
        (low is not None and value < low)
        or (above is not None and value <= above)
        or (high is not None and value > high)
    )


@pytest.mark.parametrize("path", CONFIGS, ids=lambda path: path.stem)
def test_examples_fit(path: Any) -> None:
    assert faults(tomllib.loads(path.read_text()), SCHEMA) == []


@pytest.mark.parametrize(
    ("change", "found"),
    [
        (("rate_hz = 250.0", "rate_hz = 0.0"), ".acquisition.rate_hz"),
        (("rate_hz = 250.0", 'rate_hz = "250"'), ".acquisition.rate_hz"),
        (('hold = "foh"', 'hold = "fo"'), ".identification.hold"),
        (('interface = "can0"', 'interfase = "can0"'), ".bus[].interfase"),
        (("dof = 1", "dof = 1.5"), ".channel[].dof"),
        (("mkr = true", "mkr = 1"), ".identification.mkr"),
    ],
)
def test_faults_are_found(change: tuple[str, str], found: str) -> None:
    text = (ROOT / "examples" / "recipes" / "lab.toml").read_text()
    assert change[0] in text
    wrong = faults(tomllib.loads(text.replace(change[0], change[1], 1)), SCHEMA)
    assert wrong == [found]
