# SPDX-License-Identifier: MIT
"""Commands of pages that no test follows from top to bottom: each is run on files it could mean.

Commands that take seconds each (reports, files of other programs) are run with OKID_SLOW=1; what needs a bus, a line, a
browser or a year of records is named in ELSEWHERE.
"""

from __future__ import annotations

import os
import re
import shutil
from dataclasses import replace
from functools import reduce
from pathlib import Path

import numpy as np
import okid
import pytest
from command_help import ROOT
from markdown_pages import name_of, pages
from page_runner import Block, Reader, blocks_of, compare
from test_command_lines import SHELL, command_lines
from test_howto import PAGES as HOWTO

SLOW = os.environ.get("OKID_SLOW") == "1"
PAGES = [
    "reference/cli.md",
    "reference/rig.md",
    "howto/report.md",
    "howto/frequency-responses.md",
    "migration/candump.md",
    "howto/acquisition-scripts.md",
    "howto/install.md",
    "howto/adapters.md",
    "howto/set-ups.md",
]
ELSEWHERE = {  # what a line begins with: where it is run
    r"okid (?:run|record) |okid (?:simulate|replay) .* --to |okid init .* --(?:listen|device) ": "tests/vcan, tests/io",
    r"okid bench": "make bench",
    r"okid-live": "tests/live",
    r"okid-capture (?:emulate|sync|\w+ (?:--interface|--port))": "tests/capture",
    r"okid-campaign": "tests/campaign",
}
RIG = """rate_hz = 250.0
duration_s = 12.0
masses = [1.0, 0.8, 1.2]
springs = [3e4, 2e4, 2.5e4]
zeta = [0.01, 0.01]
force_dofs = [1]
sense_dofs = [1, 2, 3]
noise_percent = 1.0
"""
PLACES = {
    "/usr/share/doc/okid/examples/": "",
    "/etc/okid/okid.toml": "frame.toml",
}  # where the page has a file: where it is here
NODE = """[acquisition]
rate_hz = 250.0
[[bus]]
name = "usb"
type = "serial"
device = "/dev/ttyACM0"
framing = "ascii"
""" + "".join(
    f'[[channel]]\nname = "{name}"\nrole = "{role}"\nfield = {field}\n'
    for field, (name, role) in enumerate([("force1", "force"), ("acc1", "acceleration"), ("acc2", "acceleration")])
)
NAMED = ["deck1", "deck2", "deck3", "deck4", "a", "b", "c", "d", "e"]
GEOMETRY = "[geometry]\nnodes = [[0, 0, 0]]\ndofs = [{}]\n".format(", ".join(['[1, "x"]'] * 6))


def write(path: Path, names: list[str], columns: list[np.ndarray]) -> None:
    okid.formats.write_record(path, okid.Record(names, np.column_stack(columns), 250.0))


@pytest.fixture(scope="module")
def prepared(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The files that the pages name, of one simulated frame."""
    folder = tmp_path_factory.mktemp("pages")
    (folder / "rig.toml").write_text(RIG)
    (folder / "bridge.toml").write_text(GEOMETRY)
    (folder / "node.toml").write_text(NODE)
    (folder / "runs").mkdir()
    begin = (
        "okid simulate rig.toml --quiet --log run.log --config frame.toml --csv simulated.csv\n"
        "cp run.log frame.log; cp run.log rig.log; cp frame.dbc vendor.dbc; cp frame.toml lab.toml\n"
        "okid convert run.log runs/frame-20261121T120000Z-0001.okj -c frame.toml\n"
        + "okid-convert run.log trace.blf"
        * SLOW
    )
    Reader(folder).run(Block("the files of all pages", 0, "sh", begin))
    record = okid.read_csv(folder / "simulated.csv")
    np.savetxt(folder / "run.bin", record.samples[:, :3], fmt="%.5f", delimiter=",")
    okid.formats.write_log(folder / "run.blf", okid.formats.read_log(folder / "run.log"))
    u, y = record.samples[:, :1], record.samples[:, 1:]
    both = [u, y, u, y]
    names = ["force1", "acc1", "acc2", "acc3", "force", "a1", "a2", "a3"]
    for name in ("frame.csv", "run.csv", "monday.csv", "tuesday.csv", "deck.csv", *["run.mf4"] * SLOW):
        write(folder / name, names, both)
    random = np.random.default_rng(1)
    places = y @ random.standard_normal((3, 11))
    places += 0.01 * places.std(axis=0) * random.standard_normal(places.shape)
    at = dict(zip(["force", "drive", "ref1", "ref2", *NAMED], np.hstack([u, y[:, :1], places]).T, strict=True))
    for number, own in ((1, ["deck1", "deck2", "a", "b"]), (2, ["deck3", "deck4", "c", "d", "e"])):
        names = ["force", "drive", "ref1", "ref2", *own]
        write(folder / f"S{number}.csv", names, [at[name][:, None] for name in names])
    for name, own in (("a", ["deck1", "deck2"]), ("b", ["deck3", "deck4"]), ("c", ["deck1", "deck4"])):
        write(folder / f"{name}.csv", ["ref1", "ref2", *own], [y[:, :2], y[:, 2:], y[:, 1:2] - y[:, 2:]])
    for name in ("before", "after", "span1", "span2"):
        okid.identify(u, y, fs=250.0, method="okid-era").save(folder / f"{name}.json")
    measured = okid.frf.h1(u, y, 250.0, nperseg=2048)
    for name in ("responses", "one", "two"):
        okid.write_frf(folder / f"{name}.uff", measured)
    return folder


def commands(page: str) -> list[str]:
    own = [block for block in blocks_of(ROOT / "docs" / page) if "elsewhere" not in block.notes]
    shell = [block.text for block in own if block.kind in SHELL]
    lines = [" ".join([program, *words]) for text in shell for program, words in command_lines(text)]
    return [reduce(lambda line, place: line.replace(*place), PLACES.items(), line) for line in lines]


@pytest.mark.parametrize("page", PAGES)
def test_commands_run(page: str, prepared: Path, tmp_path: Path) -> None:
    folder = tmp_path / "here"
    shutil.copytree(prepared, folder)
    run, count = Reader(folder), 0
    for line in commands(page):
        slow = line.startswith(("okid-report", "okid-convert")) and not SLOW
        if slow or any(re.match(start, line + " ") for start in ELSEWHERE):
            continue
        words = line.split()
        if words[0] == "okid-convert" or words[1] == "init":  # these overwrite nothing
            (folder / words[2]).unlink(missing_ok=True)
        lacking = " || [ $? = 4 ]" if words[1] == "doctor" else ""  # this machine may have no CAN
        run.run(Block(page, 0, "sh", line + lacking))
        count += 1
    assert count >= 1


def is_run(page: Path, block: Block) -> bool:
    """From top to bottom with its page, in this file by its commands, or where its mark says."""
    where = block.notes.get("elsewhere", "")
    if where:
        return (ROOT / where).exists() or f"\n{where.removeprefix('make ')}:" in (ROOT / "Makefile").read_text()
    followed = page.name in HOWTO or page.name == "tutorial.md" or page.parent.name == "recipes"
    if "hardware" in block.notes or "slow" in block.notes or (followed and "fragment" not in block.notes):
        return True
    return name_of(page).removeprefix("docs/") in PAGES and bool(command_lines(block.text))


def test_every_shell_block_is_run_or_says_why_not() -> None:
    shell = [(page, block) for page in pages() for block in blocks_of(page) if block.kind == "sh"]
    left = [f"{name_of(page)}:{block.line}" for page, block in shell if not is_run(page, block)]
    assert len(shell) > 100 and left == []


if SLOW:

    def test_the_campaign_of_its_page(tmp_path: Path) -> None:
        """A year of 1,460 records, half a minute: what the page shows is what comes first."""
        command, shown = blocks_of(ROOT / "docs" / "howto" / "campaigns.md")[:2]
        said = Reader(tmp_path).run(command)
        compare(replace(shown, text=shown.text + "…\n"), said[said.index("1460 records summed") :])
