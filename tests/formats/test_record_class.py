# SPDX-License-Identifier: MIT
"""The Record itself: what it refuses, how channels are found, what read_csv() makes of foreign tables."""

from __future__ import annotations

from datetime import datetime
from pathlib import Path

import numpy as np
import okid
import pytest
from okid.data.records import CsvRecord, Record, even_rate, read_csv, unit_of_name
from sample_records import full_record


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"names": ["a"]}, r"samples have shape \(2, 2\), expected \(N, 1\)"),
        ({"names": ["a", "a"]}, "'a' stands twice"),
        ({"names": ["a", " b"]}, "' b' is no channel name"),
        ({"names": ["a", "b\n"]}, "is no channel name"),
        ({"units": ["g"]}, "1 units for 2 channels"),
        ({"units": ["g", "N "]}, "unit of 'b' is 'N '"),
        ({"roles": [None, "shaker"]}, "role of 'b' is 'shaker', expected force, acceleration"),
        ({"dofs": [1, 0]}, "dof of 'b' is 0"),
        ({"samples": [[1.0, np.inf], [1.0, 2.0]]}, "channel 'b' is infinite at sample 0"),
        ({"fs_hz": -1.0}, "sample rate is -1.0"),
        ({"notes": {"": "x"}}, "notes are .*, expected text by key"),
        ({"start_time": datetime(2026, 1, 1)}, "no time zone"),  # noqa: DTZ001
    ],
)
def test_what_does_not_fit_is_named(change: dict, words: str) -> None:
    given = {"names": ["a", "b"], "samples": [[1.0, 2.0], [3.0, 4.0]]}
    with pytest.raises(okid.InputError, match=words):
        Record(**{**given, **change})


def test_channels_are_found_with_and_without_their_unit() -> None:
    record = full_record(5)
    assert CsvRecord is Record
    np.testing.assert_array_equal(record.columns(["storey3 [g]", "shaker"], "f"), record.samples[:, [3, 0]])
    part = record.select(["storey3", "shaker"], "f")
    assert (part.names, part.units, part.dofs) == (["storey3", "shaker"], ["g", "N"], [3, 1])
    assert (part.title, part.notes, part.fs_hz) == (record.title, record.notes, record.fs_hz)
    with pytest.raises(okid.InputError, match=r"f: no column 'storey3 \[N\]'; it has shaker"):
        record.select(["storey3 [N]"], "f")


@pytest.mark.parametrize(
    ("name", "unit"),
    [("a [g]", "g"), ("a (m/s^2)", "m/s^2"), ("a_g", "g"), ("a_x", ""), ("g", ""), ("_g", ""), ("a []", ""), ("a", "")],
)
def test_units_in_names_as_the_program_takes_them(name: str, unit: str) -> None:
    assert unit_of_name(name) == unit


def test_rate_of_time_stamps() -> None:
    assert even_rate(np.arange(1000) / 1024.0) == 1024.0
    assert even_rate(5.0 + np.arange(10) * 0.3) == 3.33333333
    gap = np.delete(np.arange(20.0), 7)
    assert "step of 2 s after sample 6" in str(even_rate(gap))
    assert "step of -9" in str(even_rate(np.tile(np.arange(10.0), 2)))
    assert "missing" in str(even_rate(np.array([0.0, np.nan, 2.0])))
    assert "one time stamp" in str(even_rate(np.zeros(1)))


def test_uneven_time_stamps_give_no_rate_and_say_so(tmp_path: Path) -> None:
    (tmp_path / "t.csv").write_text("time_s,a\n0,1\n0.01,2\n0.03,3\n", encoding="utf-8")
    record = read_csv(tmp_path / "t.csv")
    assert record.fs_hz is None
    assert "time_s gives no sample rate: " in record.remarks[0] and "line 3" in record.remarks[0]
    assert "found a step of 0.01 s, expected 0.015 s" in record.remarks[0]


@pytest.mark.parametrize("line", ["# units: a=N b=m/s^2", "# units: a N, b m/s^2"])
def test_units_of_the_programs_own_tables(tmp_path: Path, line: str) -> None:
    (tmp_path / "t.csv").write_text(f"# fs_hz: 10\n{line}\na,b\n1,2\n", encoding="utf-8")
    assert read_csv(tmp_path / "t.csv").units == ["N", "m/s^2"]


def test_empty_cells_are_gaps_wherever_they_stand(tmp_path: Path) -> None:
    (tmp_path / "t.csv").write_text("a,b,c\n,,\n1,,3\n,2,\n4,5,6", encoding="utf-8")
    n = np.nan
    np.testing.assert_array_equal(read_csv(tmp_path / "t.csv").samples, [[n, n, n], [1, n, 3], [n, 2, n], [4, 5, 6]])
