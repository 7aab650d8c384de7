# SPDX-License-Identifier: MIT
"""The rules of docs/reference/csv.md, each tried at the program."""

from __future__ import annotations

import pathlib

import pytest
from page_runner import ROOT, blocks_of
from program import okid

PAGE = ROOT / "docs" / "reference" / "csv.md"


def read(folder: pathlib.Path, text: str | bytes, *more: str) -> tuple[int, str]:
    """Exit code and message; with so few samples a file that can be read ends with 3."""
    (folder / "a.csv").write_bytes(text if isinstance(text, bytes) else text.encode())
    done = okid("identify", folder / "a.csv", "--inputs", "u", "--outputs", "y", *more)
    return done.returncode, done.stderr


ROWS = "".join(f"{k % 7},{k % 5}\n" for k in range(20))
GOOD = {
    "byte order mark, CRLF": ("\ufeff# fs_hz: 100\r\nu,y\r\n" + ROWS.replace("\n", "\r\n")),
    "semicolons, decimal comma": "# fs_hz = 100\nu;y\n" + ROWS.replace(",", ",5;").replace("\n", ",5\n"),
    "tab, quotes": '# sample_rate_hz: 100 Hz\n"u"\t"y"\n' + ROWS.replace(",", "\t"),
    "units, gaps, plus": "# fs_hz: 100\nu [N],y (g)\n+1,\nNaN,2\n" + ROWS,
    "a column of text that is not read": "# fs_hz: 100\nu,y,note\n" + ROWS.replace("\n", ",dry\n"),
    "time_s": "time_s,u,y\n" + "".join(f"{k / 100},{k % 7},{k % 5}\n" for k in range(20)),
    "blanks before the comment and the names": "\n  # fs_hz: 100\n\nu,y\n" + ROWS,
}
BAD = {
    "inf": ("# fs_hz: 100\nu,y\n1,inf\n", "finite"),
    "text": ("# fs_hz: 100\nu,y\n1,a\n", "expected a number"),
    "ragged": ("# fs_hz: 100\nu,y\n1\n", "cell"),
    "empty line": ("# fs_hz: 100\nu,y\n1,2\n\n1,2\n", "empty line"),
    "twice": ("# fs_hz: 100\nu,y,y\n1,2,3\n", "twice"),
    "unknown": ("# fs_hz: 100\nu,z\n1,2\n", 'no column "y"'),
    "no rate": ("u,y\n1,2\n", "--fs"),
    "two rates": ("# fs_hz: 100\n# fs_hz: 200\nu,y\n1,2\n", "earlier"),
    "comma in the rate": ("# fs_hz: 512,5\nu,y\n1,2\n", "decimal point"),
    "uneven": ("time_s,u,y\n0,1,2\n0.01,1,2\n0.03,1,2\n", "step"),
    "no number": ("# fs_hz: 100\nu,y\n1,\n2,nan\n", "y"),
}


@pytest.mark.parametrize("rule", GOOD)
def test_accepted(rule: str, tmp_path: pathlib.Path) -> None:
    code, said = read(tmp_path, GOOD[rule])
    assert code in (0, 3), said


@pytest.mark.parametrize("rule", BAD)
def test_refused(rule: str, tmp_path: pathlib.Path) -> None:
    text, words = BAD[rule]
    code, said = read(tmp_path, text)
    assert code == 2 and words in said, said


def test_the_example_of_the_page(tmp_path: pathlib.Path) -> None:
    text = next(block.text for block in blocks_of(PAGE) if block.kind == "csv")
    (tmp_path / "a.csv").write_text(text)
    done = okid("identify", tmp_path / "a.csv", "--inputs", "force", "--outputs", "acc1,acc2_g")
    assert done.returncode == 3, done.stderr
