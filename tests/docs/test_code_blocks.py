# SPDX-License-Identifier: MIT
"""Fenced blocks of the pages: toml is checked by the program, c is compiled, json is read.

Python blocks are run by tests/property/test_readme.py, those of tools/README.md here. A part of a config (after the
line `<!-- fragment -->`, or without [acquisition]) is checked inside the least config that it fits; a part of a program
(the same line, or no #include) below the includes.
"""

from __future__ import annotations

import json
import pathlib
import re
import subprocess

import numpy as np
import okid as package
import pytest
from command_help import ROOT
from markdown_pages import Block, blocks, name_of, pages
from program import okid

RUN_ELSEWHERE = re.compile(r"tests/docs/test_(?:howto|tutorial|recipes)\.py")
BUS = '[[bus]]\nname = "can0"\ninterface = "can0"\n'
CHANNEL = """[[channel]]
name = "{}"
role = "{}"
unit = "{}"
dof = 1
bus = "can0"
can_id = 256
start_bit = {}
length = 16
"""
LEAST = {
    "acquisition": "[acquisition]\nrate_hz = 1000.0\n",
    "bus": BUS,
    "channel": CHANNEL.format("force1", "force", "N", 0) + CHANNEL.format("acc1", "acceleration", "g", 16),
}
VIRTUAL = {
    "schema": "okid.virtual/1", "inputs": ["force1"], "outputs": ["acc1", "acc2", "acc3"], "input_std": [1.0],
    "model": {"dt": 1e-3, "A": [[0.5]], "B": [[1.0]], "C": [[1.0]] * 3, "D": [[0.0]] * 3, "K": [[0.0] * 3]},
    "noise": [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]],
}  # fmt: skip
DBC = ROOT / "drivers" / "proto" / "okid.dbc"


def selected(language: str) -> list[tuple[str, Block]]:
    """Of pages that no test follows from top to bottom."""
    own = [page for page in pages() if not RUN_ELSEWHERE.search(page.read_text())]
    return [
        (f"{name_of(page)}:{block.line}", block) for page in own for block in blocks(page) if block.language == language
    ]


def sections(text: str) -> list[tuple[str, str]]:
    """(name, text) of the sections in their order."""
    parts = re.split(r"(?m)^(?=\[)", text)
    return [(re.match(r"\[+(\w+)", part)[1], part) for part in parts if part.startswith("[")]  # type: ignore[index]


def embedded(text: str) -> str:
    """The fragment with what it lacks: a rate, buses for its channels, channels for its buses."""
    own = sections(text)
    names = {name for name, _ in own}
    body = "".join(part if part.endswith("\n") else part + "\n" for _, part in own)
    if "bus" in names and "channel" not in names:
        buses = [part for name, part in own if name == "bus"]
        for k, part in enumerate(buses):
            name = re.search(r'(?m)^name = "(\w+)"', part)
            assert name
            serial = 'type = "serial"' in part
            where = "field = 0\n" if serial else f"can_id = {k}\nstart_bit = 0\nlength = 16\n"
            role = "acceleration" if k == 0 else "aux"
            body += f'[[channel]]\nname = "c{k}"\nrole = "{role}"\nbus = "{name[1]}"\n{where}'
        if 'type = "replay"' not in text:  # that one stands alone; others have a node that they share the clock of
            body = BUS.replace("can0", "shared") + LEAST["channel"].replace('"can0"', '"shared"') + body
    if "channel" in names and "bus" not in names:
        for bus in sorted(set(re.findall(r'(?m)^bus = "(\w+)"', text))):
            line = 'type = "serial"\ndevice = "/dev/null"\nframing = "cobs"\n'
            can = f'interface = "{bus}"\ndbc = "okid.dbc"\n'
            body += f'[[bus]]\nname = "{bus}"\n{line if "field = " in text and bus != "can0" else can}'
    if names & {"bus", "channel"}:
        return LEAST["acquisition"] * ("acquisition" not in names) + body
    if "virtual" in names and "publish" not in names:
        body += '[publish]\nsocket = "okid.sock"\nsamples = true\n'
    return "".join(part for name, part in LEAST.items() if name not in names) + body


@pytest.mark.parametrize("block", [pytest.param(block, id=where) for where, block in selected("toml")])
def test_toml(block: Block, tmp_path: pathlib.Path) -> None:
    (tmp_path / "okid.dbc").write_text(DBC.read_text())
    (tmp_path / "frame.dbc").write_text(DBC.read_text())
    (tmp_path / "frame.virtual.json").write_text(json.dumps(VIRTUAL))
    if re.search(r"(?m)^(?:masses|M) = ", block.text):
        (tmp_path / "rig.toml").write_text(block.text)
        done = okid("simulate", tmp_path / "rig.toml", "--truth", "-", "--quiet")
    else:
        part = block.fragment or "[acquisition]" not in block.text
        (tmp_path / "a.toml").write_text(embedded(block.text) if part else block.text)
        done = okid("check", tmp_path / "a.toml")
    assert done.returncode == 0, done.stderr


@pytest.mark.parametrize("block", [pytest.param(block, id=where) for where, block in selected("json")])
def test_json(block: Block) -> None:
    """One object, or one a line; `…` stands for what was left out."""
    text = block.text.replace(",…", "").replace(", …", "").replace("…", "0")
    try:
        json.loads(text)
    except json.JSONDecodeError:
        assert all(isinstance(json.loads(line), dict) for line in text.splitlines())


COMPILER = ["cc", "-std=c99", "-Wall", "-Wextra", "-Werror", f"-I{ROOT}/lib/include", f"-I{ROOT}/drivers/include"]


@pytest.mark.parametrize("block", [pytest.param(block, id=where) for where, block in selected("c")])
def test_c(block: Block, tmp_path: pathlib.Path) -> None:
    """A whole program, or a fragment below the headers of the library: declarations, or statements of a function."""
    part = block.fragment or "#include" not in block.text
    steps = sorted(path.name for path in (ROOT / "lib/include/okid/steps").glob("*.h"))
    headers = "".join(f"#include <okid/{name}>\n" for name in ["okid.h", *(f"steps/{step}" for step in steps)])
    (tmp_path / "a.c").write_text(headers + block.text if part else block.text)
    more = ["-fsyntax-only", "-Wno-unused"] if part else ["-c", "-o", str(tmp_path / "a.o")]
    done = subprocess.run([*COMPILER, *more, str(tmp_path / "a.c")], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr


def test_python_of_the_package_readme(
    tmp_path: pathlib.Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """One after the other, with the file and the function that they assume."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "rig.toml").write_text((ROOT / "tests" / "replay" / "demo_rig.toml").read_text())
    done = okid("simulate", "rig.toml", "--csv", "run.csv", "--quiet")
    assert done.returncode == 0, done.stderr
    text = (tmp_path / "run.csv").read_text().replace("force1,acc1,acc2,acc3", "force,a1,a2,a3")
    (tmp_path / "run.csv").write_text(text)
    record = package.read_csv("run.csv")
    scope = {"my_acquisition": lambda: np.array_split(record.samples, 10)}
    for block in blocks(ROOT / "tools" / "README.md"):
        if block.language == "python":
            exec(compile(block.text, f"tools/README.md:{block.line}", "exec"), scope)
    assert "Hz" in capsys.readouterr().out and (tmp_path / "result.json").exists()
