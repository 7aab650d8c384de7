# SPDX-License-Identifier: MIT
"""Links in the output folder of a campaign: nothing is removed, renamed or written where they lead."""

from __future__ import annotations

import os
from pathlib import Path

import pytest
from okid import InputError
from okid.campaign.state_folder import StateFolder
from okid.campaign.sums_file import GroupSums

KEY = "0123456789abcdef"


@pytest.fixture
def victim(tmp_path: Path) -> Path:
    folder = tmp_path / "home"
    folder.mkdir()
    for name in ("a.part", "b.sums", "refinement"):
        (folder / name).write_text("mine")
    (tmp_path / "out").mkdir()
    return folder


def untouched(folder: Path) -> bool:
    return {path.name: path.read_text() for path in folder.iterdir()} == {
        "a.part": "mine", "b.sums": "mine", "refinement": "mine"
    }  # fmt: skip


def test_a_link_to_another_folder_is_refused(victim: Path, tmp_path: Path) -> None:
    """*.part and *.sums there were deleted."""
    out = tmp_path / "out"
    (out / "state").mkdir()
    (out / "state" / KEY).symlink_to(victim)
    with pytest.raises(InputError, match=f"state/{KEY}: is a link to another place"):
        StateFolder(out, KEY)
    (out / "state" / KEY).unlink()
    (out / "state").rmdir()
    (out / "state").symlink_to(victim)
    with pytest.raises(InputError, match="out/state: is a link to another place"):
        StateFolder(out, KEY)
    assert untouched(victim)


def test_a_folder_that_becomes_a_link_meanwhile(victim: Path, tmp_path: Path) -> None:
    """Between the beginning of a run and its end."""
    out = tmp_path / "out"
    state = StateFolder(out, KEY)
    kept = state.write(GroupSums("g", 0, [{"name": "r"}]))
    (out / "state" / KEY).rename(tmp_path / "moved")
    (out / "state" / KEY).symlink_to(victim)
    assert list(state.load()) == ["g"]
    state.keep_plan(b"plan")
    assert state.plan() == b"plan"
    state.write(GroupSums("h", 0, [{"name": "s"}]), [kept, state.folder / "b.sums"])
    state.remove(state.folder / "a.part")
    assert untouched(victim)
    assert sorted(path.name[0] for path in (tmp_path / "moved").iterdir()) == ["h", "r"]


def test_links_among_the_files(victim: Path, tmp_path: Path) -> None:
    folder = tmp_path / "out" / "state" / KEY
    folder.mkdir(parents=True)
    for name, to in (("x.sums", "b.sums"), ("y.part", "a.part"), ("refinement", "refinement")):
        (folder / name).symlink_to(victim / to)
    os.mkfifo(folder / "z.sums")
    state = StateFolder(tmp_path / "out", KEY)
    assert state.load() == {}  # the link and the pipe are no sums; they go, what is behind them stays
    with pytest.raises(InputError, match="refinement: cannot be read"):
        state.plan()
    state.keep_plan(b"plan")
    assert state.plan() == b"plan" and not (folder / "refinement").is_symlink()
    assert untouched(victim) and os.listdir(folder) == ["refinement"]


def test_what_fails_leaves_nothing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    state = StateFolder(tmp_path, KEY)

    def full(_: int) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "fsync", full)
    with pytest.raises(InputError, match="No space left on device"):
        state.write(GroupSums("g", 0, [{"name": "r"}]))
    assert os.listdir(state.folder) == []
