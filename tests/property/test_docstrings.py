# SPDX-License-Identifier: MIT
"""The examples in the docstrings of the package give what they say."""

from __future__ import annotations

import doctest
import importlib
import pathlib

import okid
import pytest

PACKAGE = pathlib.Path(okid.__file__).parent
WITH_EXAMPLES = sorted(
    ".".join(("okid", *path.relative_to(PACKAGE).with_suffix("").parts))
    for path in PACKAGE.rglob("*.py")
    if "\n    >>> " in path.read_text(encoding="utf-8")
)


def test_what_one_begins_with_has_an_example() -> None:
    for one in (okid.identify, okid.Session, okid.Accumulator, okid.Structure, okid.stabilization, okid.ModalTable):
        assert ">>> " in (one.__doc__ or ""), one


@pytest.mark.parametrize("name", WITH_EXAMPLES)
def test_examples(name: str) -> None:
    tested = doctest.testmod(importlib.import_module(name))
    assert tested.attempted > 0 and tested.failed == 0
