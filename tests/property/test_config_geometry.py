# SPDX-License-Identifier: MIT
"""[geometry] is checked before a run, so that the pictures after it can be drawn."""

from __future__ import annotations

import pathlib

import pytest
from program import okid
from two_masses import rig_text, simulate_rig

GOOD = (
    "[geometry]\nnodes = [[0, 0, 0], [0.0, 0, 1.5], [0, 0, 3]]\n"
    'dofs = [[2, "x"], [3, "-x"]]\nlines = [[1, 2], [2, 3]]\nsurfaces = [[1, 2, 3]]\nfixed = [1]\n'
)


@pytest.fixture(scope="module")
def rig(tmp_path_factory: pytest.TempPathFactory) -> pathlib.Path:
    return simulate_rig(tmp_path_factory.mktemp("geometry"), rig_text(2.0))


def checked(rig: pathlib.Path, section: str) -> tuple[int, str]:
    (rig / "b.toml").write_text((rig / "a.toml").read_text() + "\n" + section)
    done = okid("check", rig / "b.toml")
    return done.returncode, done.stderr


def test_a_good_one_passes(rig: pathlib.Path) -> None:
    assert checked(rig, GOOD) == (0, "")
    assert checked(rig, GOOD.replace("lines", "# lines"))[0] == 0


@pytest.mark.parametrize(
    ("old", "new", "says"),
    [
        ("nodes = [[0, 0, 0], [0.0, 0, 1.5], [0, 0, 3]]\n", "", '"nodes": it is missing or empty'),
        ('dofs = [[2, "x"], [3, "-x"]]', "dofs = []", '"dofs": it is missing or empty'),
        ("[0.0, 0, 1.5]", "[0.0, 1.5]", '"nodes": entry 2: expected three numbers'),
        ("[0.0, 0, 1.5]", "[0.0, 0, nan]", '"nodes": entry 2: expected three numbers'),
        ("[0.0, 0, 1.5]", '["a", 0, 1]', '"nodes": entry 2: expected three numbers'),
        ('[3, "-x"]', '[4, "-x"]', '"dofs": entry 2: expected a node from 1 to 3'),
        ('[3, "-x"]', '[3, "up"]', '"dofs": entry 2: expected a node from 1 to 3 and one of x y z'),
        ('[3, "-x"]', "3", '"dofs": entry 2'),
        ("[2, 3]]", "[2, 0]]", '"lines": entry 2: expected two nodes from 1 to 3'),
        ("[[1, 2, 3]]", "[[1, 2, 4]]", '"surfaces": entry 1: expected three different nodes or more from 1 to 3'),
        ("[[1, 2, 3]]", "[[1, 2, 3], [1, 2]]", '"surfaces": entry 2: expected three different nodes'),
        ("[[1, 2, 3]]", "[[1, 2, 1]]", '"surfaces": entry 1: expected three different nodes'),
        ("fixed = [1]", "fixed = [1, [2]]", '"fixed": entry 2: expected a node from 1 to 3'),
        (', [3, "-x"]', "", 'found 1 entries, but channel "acc2" measures degree of freedom 2'),
    ],
)
def test_a_bad_one_is_refused(rig: pathlib.Path, old: str, new: str, says: str) -> None:
    assert old in GOOD
    status, errors = checked(rig, GOOD.replace(old, new, 1))
    assert status == 2 and "b.toml: line " in errors and says in errors, errors
