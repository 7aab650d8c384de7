# SPDX-License-Identifier: MIT
"""Tables of the reference pages, and the keys of JSON objects written as those tables write them: `bus.NAME.received`,
`modes[].frequency_hz`."""

from __future__ import annotations

import pathlib
import re
from collections.abc import Iterator
from typing import Any

from command_help import ROOT

REFERENCE = ROOT / "docs" / "reference"


def sections(page: pathlib.Path) -> dict[str, str]:
    """Text below each heading of the second level, by its words without code marks."""
    parts = re.split(r"(?m)^## (.+)$", page.read_text())
    return {head.replace("`", ""): text for head, text in zip(parts[1::2], parts[2::2], strict=True)}


def rows(text: str, columns: str) -> Iterator[list[str]]:
    """Cells of the rows of every table whose head is `columns`, as "key | meaning"."""
    head = re.escape(f"| {columns} |")
    for table in re.findall(rf"(?m)^{head}\n\|[-:| ]+\|\n((?:\|.*\n?)*)", text):
        for line in table.splitlines():
            yield [cell.strip().replace("\\|", "|") for cell in re.split(r"(?<!\\)\|", line)[1:-1]]


def codes(cell: str) -> list[str]:
    """What stands in backquotes."""
    return re.findall(r"`([^`]+)`", cell)


def documented(text: str, columns: str = "key | meaning") -> dict[str, str]:
    """key -> meaning of all tables with these columns; a cell may name several keys."""
    return {key: cells[-1] for cells in rows(text, columns) for key in codes(cells[0])}


def keys_of(value: Any, named: tuple[str, ...] = (), at: str = "") -> Iterator[str]:
    """Keys of everything below `value`. The keys of an object at a path of `named` are names given by the user."""
    if isinstance(value, dict):
        for key, inner in value.items():
            name = "KEY" if at == "notes" else "NAME"
            yield from keys_of(inner, named, f"{at}.{name if at in named else key}".lstrip("."))
    elif isinstance(value, list) and value and isinstance(value[0], dict):
        for inner in value:
            yield from keys_of(inner, named, f"{at}[]")
    else:
        yield at
