# SPDX-License-Identifier: MIT
"""A page of docs/ is a test: its files are written, its commands run in order, what it shows compared with what comes.

Fenced blocks in the order of the page, with what a comment line above a block says about it:

    <!-- file: NAME -->     the block is this file; it is written before what follows is run
    <!-- hardware -->       the commands need a device: only their syntax and their options are checked
    <!-- elsewhere: NAME -->    run by these tests or this goal of make; here their syntax and options are checked
    <!-- slow -->           run with OKID_SLOW=1 alone; else its syntax and options are checked
    <!-- exit: N -->        the last command ends with N (0 when it is not said)
    <!-- fragment -->       the block is not complete by itself: left alone
    (none, toml)            a part of a config: checked inside the least config it fits

A `sh` or `python` block is run; a `text` block behind it is its output (stdout and stderr), where … is any lines of it.
A number with a decimal point may be off by two of its last digit (1e-6 of it when more than ten digits are shown), a
deviation (±) by a fifth; the rest is as it stands.
"""

from __future__ import annotations

import json
import os
import re
import shlex
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path

from program import PROGRAM

ROOT = Path(__file__).parents[2]
NUMBER = re.compile(r"(±?)(-?\d+(?:\.\d+)?(?:e[-+]?\d+)?)")
LEAST_CONFIG = """[acquisition]
rate_hz = 1000.0
[[bus]]
name = "can0"
interface = "can0"
[[channel]]
name = "force"
role = "force"
can_id = 1
start_bit = 0
length = 16
[[channel]]
name = "a1"
role = "acceleration"
can_id = 1
start_bit = 16
length = 16
"""
COMMANDS = ("okid", "okid-report", "okid-live", "okid-convert", "okid-capture", "okid-campaign")


@dataclass(frozen=True)
class Block:
    page: str
    line: int  # of its first line of text
    kind: str
    text: str
    notes: dict[str, str] = field(default_factory=dict)

    @property
    def place(self) -> str:
        return f"{self.page}:{self.line}"


def blocks_of(page: Path) -> list[Block]:
    """All fenced blocks of a page, in order."""
    blocks: list[Block] = []
    notes: dict[str, str] = {}
    kind: str | None = None
    lines: list[str] = []
    for number, line in enumerate(page.read_text().splitlines(), 1):
        if kind is not None:
            if line.strip() == "```":
                blocks.append(Block(page.name, number - len(lines), kind, "".join(f"{x}\n" for x in lines), notes))
                kind, notes = None, {}
            else:
                lines.append(line)
        elif line.startswith("```"):
            kind, lines = line[3:].strip(), []
        elif comment := re.fullmatch(r"<!-- (\w+)(?:: (.+?))? -->", line.strip()):
            notes[comment[1]] = comment[2] or ""
        elif line.strip():
            notes = {}
    assert kind is None, f"{page.name}: a block is not closed"
    return blocks


class Reader:
    """Somebody who does what a page says, in an empty folder."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        program = Path(PROGRAM)
        path = [str(program.parent), str(Path(sys.executable).parent), os.environ["PATH"]]
        self.environment = {**os.environ, "PATH": os.pathsep.join(path), "OKID": str(ROOT), "NO_COLOR": "1"}
        self.environment["OKID_PROGRAM"] = str(program)
        self.environment["OKID_LIBRARY"] = str(program.parent / "libokid.so")
        self.environment["PYTHONPATH"] = str(ROOT / "tools")

    def run(self, block: Block) -> str:
        """Its output; an exit code that the page does not say fails."""
        program = ["bash", "-e", "-c"] if block.kind == "sh" else [sys.executable, "-c"]
        done = subprocess.run(
            [*program, block.text],
            cwd=self.folder,
            env=self.environment,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            timeout=1800,
        )
        assert done.returncode == int(block.notes.get("exit", 0)), f"{block.place}: {done.returncode}\n{done.stdout}"
        return done.stdout

    def follow(self, page: Path) -> int:
        """Do the whole page. How many blocks were run."""
        shown: str | None = None
        count = 0
        for block in blocks_of(page):
            if "fragment" in block.notes:
                continue
            if "file" in block.notes:
                path = self.folder / block.notes["file"]
                path.parent.mkdir(parents=True, exist_ok=True)
                path.write_text(block.text)
            elif block.notes.keys() & {"hardware", "elsewhere"} or (
                "slow" in block.notes and os.environ.get("OKID_SLOW") != "1"
            ):
                check_commands(block)
                shown = None
            elif block.kind == "toml":
                (self.folder / "part.toml").write_text(LEAST_CONFIG + block.text)
                self.run(Block(block.page, block.line, "sh", "okid check part.toml"))
            elif block.kind == "json":
                json.loads(block.text)
            elif block.kind in ("sh", "python"):
                shown = self.run(block)
                count += 1
            elif block.kind == "text" and shown is not None:
                compare(block, shown)
                shown = None
        return count


@cache
def help_of(*words: str) -> str:
    first = PROGRAM if words[0] == "okid" else str(Path(sys.executable).parent / words[0])
    done = subprocess.run([first, *words[1:], "--help"], capture_output=True, text=True, timeout=1800)
    assert done.returncode == 0, (words, done.stderr)
    return done.stdout


def commands_of(text: str) -> Iterator[list[str]]:
    """The words of every okid command in a shell text; `sudo` in front does not matter."""
    for line in re.sub(r"\\\n", " ", text).splitlines():
        for part in re.split(r"\||&&|;|&(?!\d)", line):
            words = shlex.split(part, comments=True)
            while words and (words[0] == "sudo" or re.fullmatch(r"\w+=.*", words[0])):
                words = words[1:]
            if words and words[0] in COMMANDS:
                yield words


def check_commands(block: Block) -> None:
    """The shell can parse it, and every option of an okid command exists."""
    parsed = subprocess.run(["bash", "-n", "-c", block.text], capture_output=True, text=True)
    assert parsed.returncode == 0, f"{block.place}: {parsed.stderr}"
    for words in commands_of(block.text):
        sub = words[1:2] if words[0] in ("okid", "okid-capture", "okid-campaign") else []
        options = help_of(words[0], *sub)
        for word in words[1:]:
            if word.startswith("-") and word != "-":
                name = re.escape(word.split("=")[0])
                assert re.search(
                    rf"(?<![\w-]){name}(?![\w-])", options
                ), f"{block.place}: {words[0]} {sub} has no {word}"


def compare(block: Block, output: str) -> None:
    """Every line of the page stands in the output, in order; only … skips lines."""
    wanted = block.text.rstrip("\n").split("\n")
    came = output.rstrip("\n").split("\n")
    at, skip = 0, False
    for offset, line in enumerate(wanted):
        if line.strip() == "…":
            skip = True
            continue
        found = next((k for k in range(at, len(came)) if alike(line, came[k])), None)
        if found is None or (found != at and not skip):
            there = came[at] if at < len(came) else "the end of the output"
            raise AssertionError(f"{block.page}:{block.line + offset}: shown\n  {line}\nfound\n  {there}\nin\n{output}")
        at, skip = found + 1, False
    assert skip or at == len(came), f"{block.place}: not shown, nor left out by …:\n" + "\n".join(came[at:])


def alike(shown: str, came: str) -> bool:
    """One line; a … at its end stands for the rest."""
    shown, came = shown.rstrip(), came.rstrip()
    if shown.endswith("…"):
        text = re.sub(r"\d+", "#", shown[:-1].rstrip())
        return re.sub(r"\d+", "#", came).startswith(text) and all(
            close(a, b) for a, b in zip(NUMBER.findall(shown), NUMBER.findall(came), strict=False)
        )
    ours, theirs = NUMBER.findall(shown), NUMBER.findall(came)
    same_text = " ".join(NUMBER.sub("#", shown).split()) == " ".join(NUMBER.sub("#", came).split())
    matrix = same_text and all(ours) and not re.search(r"[A-Za-z]", shown)
    return (
        same_text and len(ours) == len(theirs) and all(close(a, b, matrix) for a, b in zip(ours, theirs, strict=True))
    )


def close(shown: tuple[str, str], came: tuple[str, str], matrix: bool = False) -> bool:
    """Two numbers, each with the ± before it or nothing. `matrix`: in a row of numbers whole ones may be off by one."""
    if shown == came:
        return True
    if shown[0] != came[0]:
        return False
    a, b = float(shown[1]), float(came[1])
    if shown[0]:
        return abs(a - b) <= 0.2 * abs(a)
    if "." not in shown[1]:
        return matrix and abs(a - b) <= 1 and "." not in came[1]
    mantissa, _, exponent = shown[1].partition("e")
    digit = 10.0 ** (int(exponent or 0) - len(mantissa.split(".")[1]))
    return abs(a - b) <= max(2.01 * digit, 1e-6 * abs(a) if len(mantissa.strip("-0.")) > 10 else 0)
