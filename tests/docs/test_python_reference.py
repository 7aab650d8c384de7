# SPDX-License-Identifier: MIT
"""docs/reference/python-api.md names all that the package offers, and nothing else."""

from __future__ import annotations

import importlib
import inspect
import re
from typing import Any

import okid
from reference_tables import REFERENCE, codes, rows, sections

PAGE = REFERENCE / "python-api.md"


def named() -> set[str]:
    """Names at the head of the first table, and those that its text says belong to a row."""
    out = set()
    for cells in rows(sections(PAGE)["What there is"], "name | what"):
        out |= {re.split(r"[(.]", code)[0] for code in codes(cells[0])}
    return out


def test_the_table_is_the_interface() -> None:
    text = sections(PAGE)["What there is"]
    lazy = {"formats", "notebook", "plots", "report", "capture", "live", "campaign"}  # loaded when they are used
    assert named() <= set(okid.__all__) | lazy
    lacking = {name for name in set(okid.__all__) | lazy if f"`{name}" not in text}
    assert not lacking, f"{PAGE.name} does not name {sorted(lacking)}"


def found(path: str) -> Any:
    """The object of a `:::` line."""
    module, _, name = path.rpartition(".")
    if name and path != "okid":
        try:
            return getattr(importlib.import_module(module), name)
        except ModuleNotFoundError:
            return getattr(found(module), name)
    return importlib.import_module(path)


def test_full_text_is_of_the_interface_and_documented() -> None:
    lines = re.findall(r"(?m)^::: (\S+)$", PAGE.read_text())
    assert {line.rpartition(".")[2] for line in lines} >= set(okid.__all__)
    for line in lines:
        thing = found(line)
        assert inspect.getdoc(thing), f"{line} has no docstring"
        for name, member in vars(thing).items() if inspect.isclass(thing) else []:
            if not name.startswith("_") and (inspect.isfunction(member) or isinstance(member, property)):
                assert member.__doc__, f"{line}.{name} has no docstring"
