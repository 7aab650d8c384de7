# SPDX-License-Identifier: MIT
"""Files in a folder where somebody else has put links: nothing is written through them, nothing half-written stays."""

from __future__ import annotations

import os
import pathlib
import stat

import pytest
from okid import InputError
from okid.data.whole_file import safe_part, whole_file
from okid.formats.mcap_file import write_live_mcap
from okid.report.svg import Pictures
from okid.report.targets import write_whole
from okid.result.figures import figure
from program import okid

CONFIG = """rate_hz = 100.0
duration_s = 1.0
masses = [1.0]
springs = [1e4]
zeta = [0.01, 0.01]
force_dofs = [1]
sense_dofs = [1]
sensing = "acceleration"
excitation = "white"
"""


@pytest.fixture
def victim(tmp_path: pathlib.Path) -> pathlib.Path:
    (tmp_path / "home").mkdir()
    (tmp_path / "home" / "precious").write_text("mine")
    (tmp_path / "home" / "precious").chmod(0o600)
    (tmp_path / "open").mkdir()
    return tmp_path / "home" / "precious"


def test_names_that_could_be_guessed(victim: pathlib.Path, tmp_path: pathlib.Path) -> None:
    """Release 0.1 wrote through .report.html.PID.part."""
    folder, pid = tmp_path / "open", os.getpid()
    for name in (f".report.html.{pid}.part", f".{pid}.part.report.html", "report.html.part"):
        (folder / name).symlink_to(victim)
    write_whole(folder / "report.html", "page")
    with whole_file(folder / "report.html") as part:
        part.write_text("page")
    assert victim.read_text() == "mine" and (folder / "report.html").read_text() == "page"


def test_figures_are_not_written_through_links(victim: pathlib.Path, tmp_path: pathlib.Path) -> None:
    folder = tmp_path / "open"
    for ending in ("svg", "csv", "png"):
        (folder / f"01-a-line.{ending}").symlink_to(victim)
    drawing = figure(2.0, 1.0)
    drawing.add_subplot().plot([1, 2], [3, 4])
    Pictures(folder).inline(drawing, "a line")
    assert victim.read_text() == "mine"
    assert {path.name: path.is_symlink() for path in folder.iterdir()} == {
        f"01-a-line.{ending}": False for ending in ("svg", "csv", "png")
    }


def test_a_link_of_the_name_itself_is_replaced(victim: pathlib.Path, tmp_path: pathlib.Path) -> None:
    target = tmp_path / "open" / "r.json"
    target.symlink_to(victim)
    with whole_file(target) as part:
        part.write_text("new")
    assert victim.read_text() == "mine" and not target.is_symlink() and target.read_text() == "new"


def test_a_live_file_neither(victim: pathlib.Path, tmp_path: pathlib.Path) -> None:
    target = tmp_path / "open" / "live.mcap"
    target.symlink_to(victim)
    with pytest.raises(InputError, match="expected 'start'"):
        write_live_mcap(target, ['{"type": "modes"}'])
    assert victim.read_text() == "mine" and not target.is_symlink()


def test_nobody_else_reaches_it_meanwhile(tmp_path: pathlib.Path) -> None:
    seen = set()
    for _ in range(3):
        with safe_part(tmp_path / "a.bin") as part:
            assert stat.S_IMODE(part.parent.stat().st_mode) == 0o700 and part.name == "a.bin"
            seen.add(part.parent)
            part.write_bytes(b"x")
    assert len(seen) == 3 and os.listdir(tmp_path) == ["a.bin"]


def test_a_library_that_leaves_a_link_is_not_followed(victim: pathlib.Path, tmp_path: pathlib.Path) -> None:
    with pytest.raises(InputError), whole_file(tmp_path / "open" / "a") as part:
        part.symlink_to(victim)
    assert victim.read_text() == "mine" and os.listdir(tmp_path / "open") == []


def test_modes(tmp_path: pathlib.Path) -> None:
    before = os.umask(0o027)
    try:
        for name, given, expected in (("fresh", None, 0o640), ("kept", 0o600, 0o600), ("wide", 0o644, 0o644)):
            if given is not None:
                (tmp_path / name).touch()
                (tmp_path / name).chmod(given)
            with whole_file(tmp_path / name) as part:
                part.write_text("x")
            assert stat.S_IMODE((tmp_path / name).stat().st_mode) == expected
    finally:
        os.umask(before)


def test_what_fails_leaves_nothing(tmp_path: pathlib.Path) -> None:
    (tmp_path / "a").write_text("old")
    with pytest.raises(RuntimeError), whole_file(tmp_path / "a") as part:
        part.write_text("half")
        raise RuntimeError
    assert (tmp_path / "a").read_text() == "old" and os.listdir(tmp_path) == ["a"]
    with pytest.raises(InputError, match="cannot be written"), whole_file(tmp_path / "none" / "a"):
        pass


@pytest.mark.skipif(os.geteuid() != 0, reason="makes a link of another user")
def test_the_program_does_not_follow_a_planted_link(victim: pathlib.Path, tmp_path: pathlib.Path) -> None:
    """In a folder for all, as /tmp; the kernel's own guard does not see a rename."""
    folder = tmp_path / "open"
    folder.chmod(0o1777)
    (folder / "rig.toml").write_text(CONFIG)
    (folder / "truth.json").symlink_to(victim)
    os.lchown(folder / "truth.json", 65534, 65534)
    done = okid("simulate", folder / "rig.toml", "--truth", folder / "truth.json")
    assert done.returncode == 2 and "is a link of another user" in done.stderr and victim.read_text() == "mine"
    os.lchown(folder / "truth.json", 0, 0)  # a link of one's own leads where it leads
    assert okid("simulate", folder / "rig.toml", "--truth", folder / "truth.json").returncode == 0
    assert victim.read_text() != "mine"
