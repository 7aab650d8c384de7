# SPDX-License-Identifier: MIT
"""docs/reference/cli.md and the programs say the same: every option, both ways."""

from __future__ import annotations

import re

import pytest
from command_help import ROOT, SUBCOMMANDS, commands, help_text, options_of, renewed, table_of
from reference_tables import REFERENCE

PAGE = REFERENCE / "cli.md"
RENEW = "renew it: .venv/bin/python tests/docs/command_help.py"


@pytest.mark.parametrize("command", commands())
def test_options_are_those_of_the_help(command: str) -> None:
    mark, page = f"<!-- options: {command} -->\n\n", PAGE.read_text()
    assert mark in page, f"{PAGE.name} has no table of {command}; add the line {mark.strip()} and {RENEW}"
    found = page.split(mark)[1].split("\n\n")[0]
    assert found.strip() == table_of(command), f"{PAGE.name}: the table of {command} is stale; {RENEW}"


def test_no_table_of_a_command_that_is_gone() -> None:
    assert set(re.findall(r"<!-- options: (.+?) -->", PAGE.read_text())) == set(commands())


def test_sub_commands_are_those_of_the_help() -> None:
    assert {"identify", "run", "replay", "record", "simulate", "convert", "check", "doctor", "bench"} <= set(
        SUBCOMMANDS["okid"]
    )
    for program in ("okid-capture", "okid-campaign"):
        assert "|".join(SUBCOMMANDS[program]) in help_text(program)
    for sub in SUBCOMMANDS["okid"]:
        assert f"[`okid {sub}`](#okid-{sub})" in PAGE.read_text(), f"{PAGE.name}: the first table lacks okid {sub}"


def test_the_reading_of_help_finds_what_a_person_finds() -> None:
    """The comparison above would be empty if options_of() were blind."""
    names = {name for option in options_of("okid identify") for name in option.names}
    assert {"records", "--inputs", "--sigma-blocks", "--model"} <= names and len(names) >= 22
    for command in commands():
        told = set(re.findall(r"(?m)^ {2}(?:-\w(?: [\w.]+)?, ?)?(--[\w-]+)", help_text(command))) - {"--help"}
        assert told == {name for option in options_of(command) for name in option.names if name.startswith("--")}


def test_every_command_has_an_example() -> None:
    page = PAGE.read_text()
    for command in commands():
        assert f"\n{command} " in page or f"\n{command}\n" in page, f"{PAGE.name}: no example of {command}"


def test_exit_codes_are_those_of_the_source() -> None:
    enum = re.search(r"(?s)enum exit_code \{(.*?)\}", (ROOT / "firmware_host" / "error.hpp").read_text())
    assert enum
    known = set(re.findall(r"= (\d+)", enum[1]))
    assert set(re.findall(r"(?m)^\| (\d+) \|", PAGE.read_text())) == known


def test_renewing_a_page_that_is_right_changes_nothing() -> None:
    page = PAGE.read_text()
    assert renewed(page) == page
    assert renewed(page.replace("| `--inputs NAMES` |", "| `--input NAME` |")) == page
