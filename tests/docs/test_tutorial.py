# SPDX-License-Identifier: MIT
"""docs/tutorial.md, done as it says, in an empty folder."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
from page_runner import ROOT, Block, Reader, alike, blocks_of, check_commands, compare

PAGE = ROOT / "docs" / "tutorial.md"


def test_the_tutorial_from_top_to_bottom(tmp_path: Path) -> None:
    assert Reader(tmp_path).follow(PAGE) >= 19


def test_what_a_page_shows_is_compared() -> None:
    def shown(text: str) -> Block:
        return Block("page.md", 1, "text", text)

    compare(shown("a 1.234\n…\nend 5\n"), "a 1.235\nb\nc\nend 5\n")
    for text in ("a 1.234\nend 5\n", "a 1.238\n…\n", "a 1.234\n…\nend 6\n", "…\nend 5\nmore\n", "a 1.234\n"):
        with pytest.raises(AssertionError):
            compare(shown(text), "a 1.235\nb\nc\nend 5\n")
    assert alike("13.3436 ±0.00017 Hz", "13.3437 ±0.00018 Hz")
    assert not alike("13.3436 ±0.00017 Hz", "13.3436 ±0.0003 Hz")
    assert not alike("8000 received", "8001 received")
    assert alike("  -40002    60014 …", "  -40002    60014   -19983")


def test_a_command_for_hardware_with_a_wrong_option_is_seen() -> None:
    check_commands(Block("page.md", 1, "sh", "sudo okid run a.toml --duration 5 && okid-capture can --channel can0\n"))
    for wrong in ("okid run a.toml --durations 5\n", "okid-capture can --canal can0\n", "for x in\n"):
        with pytest.raises(AssertionError):
            check_commands(Block("page.md", 1, "sh", wrong))


def test_no_step_writes_over_the_files_of_another() -> None:
    """What round one left can still be looked at after round two."""
    written: list[str] = []
    for block in blocks_of(PAGE):
        if block.kind == "sh" and not block.notes.keys() & {"hardware", "elsewhere"}:
            text = re.sub(r"(okid-report .*?)--events +\S+", r"\1", block.text)  # it reads them
            written += re.findall(r"(?:--(?:json|events|truth|log|out)|(?<![0-9])>) +([\w.-]+)", text)
            written += re.findall(r"okid simulate .*?--config +([\w.-]+)", text)
            written += re.findall(r"okid convert +\S+ +([\w.-]+)", text)
        written += [block.notes["file"]] if "file" in block.notes else []
    assert {"result.json", "own-result.json", "events.jsonl", "own-events.jsonl", "own.toml", "run.csv"} <= set(written)
    assert sorted(written) == sorted(set(written))
