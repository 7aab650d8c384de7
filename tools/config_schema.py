# SPDX-License-Identifier: MIT
"""docs/reference/config.schema.json from the tables of docs/reference/config.md, compared with the program by a test.

JSON Schema of CONFIG.toml for editors: taplo (Even Better TOML, Helix, Neovim) reads `#:schema PATH` in the first line.
"""

from __future__ import annotations

import json
import pathlib
import re
from typing import Any

ROOT = pathlib.Path(__file__).resolve().parents[1]
PAGE = ROOT / "docs" / "reference" / "config.md"
TARGET = PAGE.with_name("config.schema.json")
COLUMNS = "| key | value | default | meaning |"
MANY = ("bus", "channel")


def type_of(value: str) -> dict[str, Any]:
    """What the column "value" says, as JSON Schema."""
    if found := re.fullmatch(r"a (whole )?number(?: (from|above) (\S+) to (\S+))?", value):
        out: dict[str, Any] = {"type": "integer" if found[1] else "number"}
        if found[2]:
            out["exclusiveMinimum" if found[2] == "above" else "minimum"] = float(found[3])
            out["maximum"] = float(found[4])
        return {key: int(x) if isinstance(x, float) and x.is_integer() else x for key, x in out.items()}
    if value.startswith("one of: "):
        return {"enum": value.removeprefix("one of: ").split(", ")}
    if value == '"auto" or a whole number':
        return {"anyOf": [{"const": "auto"}, {"type": "integer", "minimum": 1}]}
    if value.startswith("the name of a signal or"):
        return {"anyOf": [{"type": "string"}, {"type": "object"}]}
    if value.startswith("a GPIO line"):
        return {
            "type": "object",
            "properties": {"chip": {"type": "string"}, "line": {"type": "integer"}, "active_low": {"type": "boolean"}},
        }
    if value.startswith("the number of a line"):
        return {"type": ["integer", "string"]}
    simple = {"text in quotes": "string", "true or false": "boolean", "an array": "array"}
    return {"type": simple[value]}


def plain(text: str) -> str:
    """Markdown of a cell as the words that an editor shows."""
    return re.sub(r"[`*]", "", re.sub(r"\[([^\]]*)\]\([^)]*\)", r"\1", text)).replace("\\|", "|")


def section(text: str) -> dict[str, Any]:
    """The object of one section: its first table."""
    keys, required = {}, []
    table = text.split("Each is a table")[0].partition(COLUMNS)[2]
    for line in table.splitlines()[2:]:
        if not line.startswith("|"):
            break
        name, value, default, meaning = (cell.strip() for cell in re.split(r"(?<!\\)\|", line)[1:-1])
        keys[name.strip("`")] = {**type_of(value), "description": f"{plain(meaning)} (default: {plain(default)})"}
        if default == "required":
            required.append(name.strip("`"))
    return {
        "type": "object",
        "additionalProperties": False,
        "properties": keys,
        **({"required": required} if required else {}),
    }


def schema() -> dict[str, Any]:
    """All sections."""
    parts = re.split(r"(?m)^## `\[+(\w+)\]+`$", PAGE.read_text(encoding="utf-8"))
    sections = {}
    for name, text in zip(parts[1::2], parts[2::2], strict=True):
        one = section(text)
        if "preset" in one["properties"]:  # a preset gives what the section lacks
            one["required"] = ["name"]
        sections[name] = {"type": "array", "items": one} if name in MANY else one
    return {
        "$schema": "http://json-schema.org/draft-07/schema#",
        "title": "CONFIG.toml of okid",
        "type": "object",
        "additionalProperties": False,
        "required": ["acquisition", "bus", "channel"],
        "properties": sections,
    }


def text() -> str:
    return json.dumps(schema(), indent=1, ensure_ascii=False) + "\n"


if __name__ == "__main__":
    TARGET.write_text(text(), encoding="utf-8")
