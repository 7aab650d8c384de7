# SPDX-License-Identifier: MIT
"""What the programs themselves say about their options: `--help` of okid and of the Python commands, read."""

from __future__ import annotations

import functools
import os
import pathlib
import re
import subprocess
import sys
from typing import NamedTuple

ROOT = pathlib.Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "tests" / "support"))

from program import PROGRAM as OKID  # noqa: E402

SUBCOMMANDS: dict[str, tuple[str, ...]] = {
    "okid": (),  # those its own --help lists, filled in below
    "okid-capture": ("can", "serial", "sync", "emulate"),
    "okid-campaign": ("run", "check", "report", "simulate"),
    "okid-report": (),
    "okid-live": (),
    "okid-convert": (),
}
MODULES = {
    "okid-report": "okid.report",
    "okid-convert": "okid.formats.command",
    "okid-capture": "okid.capture",
    "okid-live": "okid.live",
    "okid-campaign": "okid.campaign",
}


class Option(NamedTuple):
    """One option or argument: its names ("-c", "--config"; an argument has one without dashes), value and meaning."""

    names: tuple[str, ...]
    value: str
    meaning: str

    @property
    def positional(self) -> bool:
        return not self.names[0].startswith("-")


def commands() -> list[str]:
    """Every command line that has a --help of its own, "okid identify" .. "okid-live"."""
    out = []
    for program, subs in SUBCOMMANDS.items():
        out += [f"{program} {sub}" for sub in subs] or [program]
    return out


def _start(program: str) -> list[str]:
    if program == "okid":
        return [OKID]
    return [sys.executable, "-c", f"import sys; from {MODULES[program]} import main; sys.exit(main())"]


@functools.cache
def help_text(command: str) -> str:
    """`command --help` in lines as long as they like. Raises AssertionError when the command does not know it."""
    program, *rest = command.split()
    environment = os.environ | {"COLUMNS": "1000", "NO_COLOR": "1"}
    done = subprocess.run([*_start(program), *rest, "--help"], capture_output=True, text=True, env=environment)
    assert done.returncode == 0, f"{command} --help: exit {done.returncode}: {done.stderr}"
    return done.stdout


def _listed() -> tuple[str, ...]:
    """Sub-commands of okid."""
    return tuple(re.findall(r"(?m)^ {2}(\w[\w-]*) {2,}\S", help_text("okid").split("Subcommands:")[1]))


SUBCOMMANDS["okid"] = _listed()


def _entries(text: str) -> list[tuple[str, str]]:
    """Lines of two spaces and a name, with what stands beside it and in the further indented lines below."""
    out: list[tuple[str, str]] = []
    inside = False
    for line in text.splitlines():
        if re.match(r"\S", line):
            inside = line.lower().startswith(("positional", "options"))
        elif inside and re.match(r" {2}\S", line):
            head, _, meaning = re.sub(r" {2,}|(?<= REQUIRED) ", "\t", line.strip(), count=1).partition("\t")
            out.append((head, meaning))
        elif inside and line.strip() and out:
            out[-1] = (out[-1][0], f"{out[-1][1]} {line.strip()}".strip())
    return out


def _option(head: str, meaning: str) -> Option:
    if not head.startswith("-"):
        name, _, value = head.partition(" ")
        return Option((name,), value.replace(" REQUIRED", ""), meaning)
    names = tuple(re.findall(r"(?:^|,\s*)(--?\w[\w-]*)", head))
    value = head[head.index(names[-1]) + len(names[-1]) :].strip()
    limits = re.fullmatch(r"(\w+):\w+ in \[(\S+) - (\S+)\]=(\S+)", value)
    if limits:  # as CLI11 writes a range and a default
        value, meaning = limits[1], f"{meaning} ({limits[2]} to {limits[3]}, default {limits[4]})"
    members = re.fullmatch(r"\w+:\{(.*)\}", value)
    if members:
        value = members[1].replace(",", "|")
    return Option(names, value, meaning)


@functools.cache
def options_of(command: str) -> tuple[Option, ...]:
    """What `command` takes, --help left out, in the order of the help."""
    found = [_option(head, meaning) for head, meaning in _entries(help_text(command))]
    subs = SUBCOMMANDS.get(command, ())
    return tuple(o for o in found if "--help" not in o.names and o.names[0] not in ("|".join(subs), *subs))


def table_of(command: str) -> str:
    """The options as a Markdown table, the arguments first."""
    lines = ["| option | meaning |", "|---|---|"]
    for option in options_of(command):
        shown = option.value if option.positional and option.value else option.names[0]
        if not option.positional:
            shown = ", ".join(option.names) + (f" {option.value}" if option.value else "")
        cells = [f"`{shown}`".replace("|", "\\|"), option.meaning.replace("|", "\\|")]
        lines.append(f"| {' | '.join(cells)} |".replace("|  |", "| |"))
    return "\n".join(lines)


def renewed(page: str) -> str:
    """The page with the table below every `<!-- options: COMMAND -->` as the programs have it now."""

    def table(mark: re.Match[str]) -> str:
        return f"{mark[1]}\n\n{table_of(mark[2])}\n\n"

    whole = re.sub(r"(<!-- options: ([\w -]+?) -->)\n+(?:\|[^\n]*\n)*\n?", table, page)
    return whole.rstrip("\n") + "\n"


def main() -> int:
    """Renew the tables of docs/reference/cli.md."""
    page = ROOT / "docs" / "reference" / "cli.md"
    page.write_text(renewed(page.read_text()))
    return 0


if __name__ == "__main__":
    sys.exit(main())
