# SPDX-License-Identifier: MIT
"""What somebody sees of README.md first: how to get it, the two commands, where to ask."""

from __future__ import annotations

from command_help import ROOT
from markdown_pages import blocks

README = ROOT / "README.md"


def test_the_first_block_is_the_two_commands() -> None:
    first = blocks(README)[0]
    assert [line.partition("#")[0].split() for line in first.text.splitlines()] == [["make", "demo"], ["make", "test"]]
    assert first.line <= 15


def test_how_to_get_it_and_where_to_ask() -> None:
    screen = README.read_text(encoding="utf-8").splitlines()[:26]
    assert any("`git clone <" in line and "> okid && cd okid`" in line for line in screen)
    assert any("issue tracker" in line for line in screen)
