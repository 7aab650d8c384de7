# SPDX-License-Identifier: MIT
"""Every wrong key of a SPEC.toml is told by file, line, key, what was found and what was expected."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
from okid import InputError
from okid.campaign.record_list import list_records
from okid.campaign.spec import load_spec
from okid.campaign.spec_keys import KEYS

GOOD = """[campaign]
title = "bridge"
[records]
files = ["*.npy"]
name = '(?P<structure>[a-z]+)_(?P<time>[0-9T]+)'
[channels]
inputs = ["f"]
outputs = ["a", "b"]
fs_hz = 100.0
[identification]
p = 10
[group]
by = ["structure", "day"]
[temperature]
channel = "t"
[trend]
training_share = 0.5
[cluster]
workers = 2
[output]
folder = "out"
"""
WRONG = [
    ("[campaign]", "[campain]", '1: unknown section "campain"; did you mean "campaign"?'),
    ("title =", "titel =", '2: [campaign], key "titel": unknown key; did you mean "title"?'),
    ('title = "bridge"', "title = 3", '2: [campaign], key "title": found 3, expected text'),
    ('title = "bridge"', 'title = ""', "found '', expected text"),
    (
        'files = ["*.npy"]',
        "files = []",
        '4: [records], key "files": key "files" is missing or empty, expected patterns',
    ),
    ('files = ["*.npy"]', 'files = "*.npy"', "found '*.npy', expected a list of texts"),
    ('files = ["*.npy"]\n', "", '3: [records]: key "files" is missing or empty'),
    ("(?P<time>[0-9T]+)", "(", "key \"name\": found '(?P<structure>[a-z]+)_(', which is no regular expression"),
    ("'(?P<structure>[a-z]+)_(?P<time>[0-9T]+)'", "'[a-z]+'", "found no named group"),
    ("files =", 'time = "index"\nfiles =', '4: [records], key "time": found "index", but there is no key "index"'),
    ("files =", 'time = "clock"\nfiles =', "found 'clock', expected 'name' or 'index' or 'modified'"),
    ("files =", 'index = "none.csv"\nfiles =', "found 'none.csv', expected a file"),
    ("files =", 'config = "none.toml"\nfiles =', "found 'none.toml', expected a file"),
    ("outputs =", "output =", 'key "output": unknown key; did you mean "outputs"?'),
    ('outputs = ["a", "b"]\n', "", '[channels]: key "outputs" is missing or empty, expected names'),
    ('outputs = ["a", "b"]', 'outputs = ["a", "f"]', "a channel stands twice in ['f', 'a', 'f']"),
    ('outputs = ["a", "b"]', 'outputs = ["a", 2]', "found ['a', 2], expected a list of names"),
    ("fs_hz = 100.0\n", "", '6: [channels]: key "fs_hz" is missing, expected the sample rate of the records in Hz'),
    ("fs_hz = 100.0", "fs_hz = 0", '9: [channels], key "fs_hz": found 0, expected a number above 0 to 1e+09'),
    ("fs_hz = 100.0", "fs_hz = true", "found True, expected a number above 0"),
    ("fs_hz", "codes = 16\nfs_hz", 'key "codes": found 16, but key "scale" is missing: value = scale code + offset'),
    ("fs_hz", "codes = 12\nfs_hz", "found 12, expected 0 or 16 or 24 or 32"),
    ("fs_hz", "scale = [1.0, 2.0]\nfs_hz", 'key "scale": found 2 numbers, expected 1 or 3: inputs, then outputs'),
    ("fs_hz", "scale = [0]\nfs_hz", 'key "scale": found 0, expected a factor that is not 0'),
    ("fs_hz", 'columns = ["f", "a", "c", "t"]\nfs_hz', "key \"columns\": 'b' is not among them"),
    ("p = 10", "p = 0", "found 0, expected a whole number from 1 to 4096"),
    ("p = 10", "p = 2.5", "found 2.5, expected a whole number from 1 to 4096"),
    ("p = 10", 'order = "best"', "found 'best', expected 'auto' or a whole number from 1 to 4096"),
    ("p = 10", 'method = "okid"', "found 'okid', expected 'auto' or 'okid-era' or 'okid-era-dc'"),
    (
        "p = 10",
        'p = 10\nmethod = "auto"',
        'key "p": method "auto" does not have it: name one method, such as "okid-era"',
    ),
    ("p = 10", "p = 10\nband = [1, 9]", 'key "band": method "okid-era" does not have it: only "auto" does'),
    ("p = 10", "band = [9, 1]", 'key "band": found [9, 1], expected [lowest, highest] in Hz'),
    ("p = 10", "sigma_blocks = 3", "found 3, expected 0 or a whole number from 8 to 100"),
    ('by = ["structure", "day"]', 'by = ["struct"]', '"struct" is no key of a record; did you mean "structure"?'),
    ('by = ["structure", "day"]', 'by = ["day", "day"]', "a key stands twice"),
    ('by = ["structure", "day"]', 'by = ["record", "day"]', '"record" stands alone'),
    ('by = ["structure", "day"]', 'by = ["temperature_band"]', '"temperature_band" needs [temperature] column'),
    ('by = ["structure", "day"]', 'by = ["record"]\n[identification.x]', 'key "x": unknown key'),
    ('channel = "t"', 'channel = "t"\ncolumn = "c"', '"channel" and "column" exclude each other'),
    ('channel = "t"', 'column = "c"', "a column of the index, but [records] has no index"),
    ("training_share = 0.5", 'training_until = "soon"', "found 'soon', expected a date like 2026-04-01"),
    ("training_share = 0.5", 'training_until = "2026-01-01"\ntraining_share = 0.5', "exclude each other"),
    ("training_share = 0.5", "false_alarm_per_year = 0.9", "found 0.9, expected a number from 0.0001 to 0.5"),
    ("training_share = 0.5", 'series = ["bridge"]', "'bridge' is not among the keys of [group]; known: structure, day"),
    ("workers = 2", "workers = 0", "found 0, expected a whole number from 1 to 4096"),
    ('folder = "out"', 'keep = "all"', "found 'all', expected 'auto' or 'parts' or 'sums'"),
    ("[output]", "[[output]]", "20: [output]: found [{'folder': 'out'}], expected a table"),
    ("[output]", "[outpt]", '20: unknown section "outpt"; did you mean "output"?'),
    ("[campaign]", "[campaign", "not a TOML file"),
]


@pytest.mark.parametrize(("old", "new", "words"), WRONG)
def test_wrong_key_is_told(tmp_path: Path, old: str, new: str, words: str) -> None:
    path = tmp_path / "SPEC.toml"
    text = GOOD.replace(old, new, 1)
    assert text != GOOD
    path.write_text(text)
    with pytest.raises(InputError) as told:
        load_spec(path)
    message = str(told.value)
    assert message.startswith(str(path)) and "\n" not in message
    assert words in message, message


def test_good_spec_and_its_defaults(tmp_path: Path) -> None:
    path = tmp_path / "SPEC.toml"
    path.write_text(GOOD)
    spec = load_spec(path, workers=7)
    assert spec.channels.names == ("f", "a", "b") and spec.channels.columns == ("f", "a", "b", "t")
    assert spec.records.time == "name" and spec.workers == 7 and spec.folder == tmp_path / "out"
    assert spec.identification.pieces == 1 and spec.trend.false_alarm_per_year == 0.05
    with pytest.raises(InputError, match=r"SPEC.toml:4: \[records\], key \"files\": '\*\.npy' finds no file"):
        list_records(spec)
    (tmp_path / "x.npy.txt").write_text("")
    path.write_text(GOOD.replace('"*.npy"', '"*.txt"'))
    with pytest.raises(InputError, match=r"'\*\.txt' finds x\.npy\.txt, expected one of \.npy"):
        list_records(load_spec(path))


def test_records_that_are_groups_are_cut_into_pieces(tmp_path: Path) -> None:
    path = tmp_path / "SPEC.toml"
    path.write_text(GOOD.replace('by = ["structure", "day"]', 'by = ["record"]'))
    assert load_spec(path).identification.pieces == 20
    path.write_text(GOOD.replace('by = ["structure", "day"]', 'by = ["record"]').replace("p = 10", "pieces = 4"))
    with pytest.raises(InputError, match="found 4, expected 8 or more"):
        load_spec(path)


def test_missing_file(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="none.toml: No such file"):
        load_spec(tmp_path / "none.toml")


PAGE = Path(__file__).resolve().parents[2] / "docs" / "howto" / "campaigns.md"


def test_the_spec_of_the_page(tmp_path: Path) -> None:
    """It is read, and finds the record whose name it describes."""
    (text,) = re.findall(r"<!-- spec: is read by .*? -->\n```text\n(.*?)```", PAGE.read_text("utf-8"), re.DOTALL)
    path = tmp_path / "SPEC.toml"
    path.write_text(text)
    (tmp_path / "records").mkdir()
    (tmp_path / "records" / "2025-09-08T1200.npy").write_bytes(b"")
    spec = load_spec(path)
    assert spec.channels.columns == ("force", "a1", "a2", "temperature") and spec.identification.method == "auto"
    (found,), skipped = list_records(spec)
    assert found.time_s == 1757332800 and not skipped  # 2025-09-08 12:00 UTC


def test_every_key_has_a_home() -> None:
    """What the checker takes, the page of the documentation names."""
    text = PAGE.read_text("utf-8")
    missing = [f"[{section}] {key}" for section, keys in KEYS.items() for key in keys if f"`{key}`" not in text]
    assert not missing
