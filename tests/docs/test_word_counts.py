# SPDX-License-Identifier: MIT
"""The pages do not grow past the bounds of tools/words.toml; how tools/words.py counts."""

from __future__ import annotations

import importlib.util
from types import ModuleType

import pytest
from command_help import ROOT


@pytest.fixture(scope="module")
def words() -> ModuleType:
    spec = importlib.util.spec_from_file_location("words", ROOT / "tools" / "words.py")
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_no_page_passes_its_bound(words: ModuleType, capsys: pytest.CaptureFixture[str]) -> None:
    code = words.main(["--check"])
    assert code == 0, capsys.readouterr().err


def test_every_bound_is_for_a_page_that_exists(words: ModuleType) -> None:
    bounds = words.tomllib.loads((ROOT / "tools" / "words.toml").read_text())
    assert set(bounds) <= set(words.counts(words.pages())) and bounds["total"]["words"] > 0


def test_what_counts(words: ModuleType) -> None:
    text = "# A heading\n\nTwo `code pieces` here. [A link](to/a/page.md) of 3 words.\n\n"
    text += "```\nno word in a block\n```\n<!-- none here -->\n\n| cell | 17 |\n|---|---|\n"
    found = words.count(text)
    assert (found.words, found.prose, found.digits, found.longest) == (12, 10, 1, 5)
    assert words.count("word " * 31 + ".").over == 1 and words.count("word " * 30 + ".").over == 0
