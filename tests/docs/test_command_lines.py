# SPDX-License-Identifier: MIT
"""Every line of a shell block that calls okid or a Python command names a sub-command and options that there are."""

from __future__ import annotations

import pathlib
import re
import shlex

import pytest
from command_help import SUBCOMMANDS, options_of
from markdown_pages import blocks, name_of, pages

SHELL = ("", "sh", "bash", "console", "text")
WRAPPED = re.compile(
    r"^(?:\$ |# )?(?:sudo (?:-u \w+ )?|nohup |timeout \S+ |[A-Z_]+=\S+ )*(?:\S*/)?(okid(?:-\w+)?) (.*)$"
)


def command_lines(text: str) -> list[tuple[str, list[str]]]:
    """(program, words) of every call in a block; lines joined at backslashes, cut at comments, pipes and &&."""
    out = []
    for line in re.sub(r"\\\n\s*", " ", text).splitlines():
        for part in re.split(r"\s(?:&&|\|\|?|;)\s|;\s", line):
            found = WRAPPED.match(part.strip())
            if not found or found[1] not in SUBCOMMANDS:
                continue
            words = shlex.split(re.sub(r"[<>]+ *\S+", "", found[2]), comments=True)
            out.append((found[1], [word for word in words if word != "&"]))
    return out


def fault(program: str, words: list[str]) -> str:
    """What is wrong with a call, "" = nothing."""
    if not words or words[0] in ("--version", "--help"):
        return ""
    command = program
    if SUBCOMMANDS[program]:
        if words[0] not in SUBCOMMANDS[program]:
            return f"{program} has no sub-command {words[0]!r}: {', '.join(SUBCOMMANDS[program])}"
        command = f"{program} {words[0]}"
    known = {name for option in options_of(command) for name in option.names} | {"--help", "-h"}
    for word in words:
        name = word.split("=")[0]
        if re.fullmatch(r"--[a-zA-Z][\w-]*|-[a-zA-Z]", name) and name not in known:
            return f"{command} has no option {name}: {', '.join(sorted(n for n in known if n.startswith('-')))}"
    return ""


@pytest.mark.parametrize("page", pages(), ids=name_of)
def test_commands_and_options_are_there(page: pathlib.Path) -> None:
    for block in blocks(page):
        if block.language not in SHELL:
            continue
        for program, words in command_lines(block.text):
            wrong = fault(program, words)
            assert not wrong, f"{name_of(page)}, block at line {block.line}: {wrong}"


def test_a_wrong_line_is_found() -> None:
    assert "no option --nothing" in fault("okid", ["run", "a.toml", "--nothing"])
    assert "no sub-command 'fly'" in fault("okid", ["fly"])
    assert not fault("okid", ["replay", "a.log", "-c", "b.toml"])
    text = "$ okid run a.toml \\\n    --json b.json   # as okid identify --x\nA=1 build/okid check c.toml | less\n"
    assert command_lines(text) == [("okid", ["run", "a.toml", "--json", "b.json"]), ("okid", ["check", "c.toml"])]


def test_there_are_many() -> None:
    shell = [block for page in pages() for block in blocks(page) if block.language in SHELL]
    assert sum(len(command_lines(block.text)) for block in shell) > 60
