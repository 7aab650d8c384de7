# SPDX-License-Identifier: MIT
"""CSV: every record comes back to the last bit, and `okid identify` finds in it what identify() finds."""

from __future__ import annotations

import csv
import json
import os
from pathlib import Path

import numpy as np
import okid
import pytest
from hypothesis import given
from okid.data.records import Record, read_csv
from okid.formats import read_record, write_csv, write_record
from program import okid as okid_program
from sample_records import NAMES, assert_same, full_record, records, shaken_frame, steady


def test_everything_comes_back(tmp_path: Path) -> None:
    write_csv(tmp_path / "a.csv", full_record())
    assert_same(read_csv(tmp_path / "a.csv"), full_record())


@steady
@given(records())
def test_any_record_comes_back(tmp_path: Path, record: Record) -> None:
    write_record(tmp_path / "a.csv", record)
    assert_same(read_record(tmp_path / "a.csv"), record)


def test_other_programs_read_the_table(tmp_path: Path) -> None:
    write_csv(
        tmp_path / "a.csv", Record(["#1, left", 'a "b"', "c_g", "d"], [[1, 2, 3, np.nan]], 10.0, ["N", "", "", "V"])
    )
    rows = [line for line in (tmp_path / "a.csv").read_text(encoding="utf-8").splitlines() if not line.startswith("#")]
    assert list(csv.reader(rows)) == [["#1, left [N]", 'a "b"', "c_g []", "d [V]"], ["1.0", "2.0", "3.0", "nan"]]


@pytest.mark.parametrize("ending", ["csv", "h5", "mat", "parquet", "mf4", "uff"])
def test_okid_identify_finds_the_same_as_identify(tmp_path: Path, ending: str) -> None:
    u, y = shaken_frame()
    record = Record(list(NAMES), np.hstack([u, y]), 1000.0, ["N", *["m/s^2"] * 3], "frame fs_hz = 7")
    write_record(tmp_path / f"a.{ending}", record)
    write_csv(tmp_path / "b.csv", read_record(tmp_path / f"a.{ending}"))
    done = okid_program(
        "identify",
        tmp_path / "b.csv",
        "--inputs",
        NAMES[0],
        "--outputs",
        ",".join(NAMES[1:]),
        "--method",
        "okid-era",
        "--json",
        "-",
    )
    assert done.returncode == 0, done.stderr
    found, expected = json.loads(done.stdout), okid.identify(u, y, fs=1000.0, method="okid-era").to_dict()
    assert (found["fs_hz"], found["samples"], found["order"]) == (1000.0, len(u), expected["order"])
    for key in ("frequency_hz", "damping_ratio"):
        np.testing.assert_allclose(
            [m[key] for m in found["modes"]], [m[key] for m in expected["modes"]], rtol=1e-9, err_msg=key
        )


def test_two_headers_that_would_be_one_are_refused(tmp_path: Path) -> None:
    with pytest.raises(okid.InputError, match="same header"):
        write_csv(tmp_path / "a.csv", Record(["a", "a [N]"], [[1.0, 2.0]], 1.0, ["N", "N"]))
    assert list(tmp_path.iterdir()) == []


def test_a_foreign_comment_does_not_break_the_file(tmp_path: Path) -> None:
    (tmp_path / "a.csv").write_text(
        '# okid: {"names": [1, 2]}\n# okid: {broken\n# fs_hz: 2\na,b\n1,2\n', encoding="utf-8"
    )
    assert read_csv(tmp_path / "a.csv").names == ["a", "b"]


WIDE = [("csv", 32)] if os.environ.get("OKID_SLOW") == "1" else []  # 190 MB


@pytest.mark.parametrize(("ending", "columns"), [(e, 2) for e in ("csv", "h5", "mat", "parquet", "mf4", "uff")] + WIDE)
def test_a_million_rows_of_16_bit_codes(tmp_path: Path, ending: str, columns: int) -> None:
    codes = np.random.default_rng(1).integers(-32768, 32768, (1_000_000, columns), dtype=np.int16)
    write_record(tmp_path / f"a.{ending}", Record([f"c{k}" for k in range(columns)], codes, 1000.0))
    np.testing.assert_array_equal(read_record(tmp_path / f"a.{ending}").samples, codes)
