# SPDX-License-Identifier: MIT
"""Parquet: ours as pyarrow and pandas see it, theirs as we see it."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import okid
import pandas as pd
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from hypothesis import given
from okid.data.records import Record
from okid.formats import read_parquet, write_parquet
from sample_records import assert_same, full_record, records, steady


def test_as_pyarrow_and_pandas_see_it(tmp_path: Path) -> None:
    record = full_record()
    write_parquet(tmp_path / "a.parquet", record)
    schema = pq.read_schema(tmp_path / "a.parquet")
    assert (schema.names, schema.metadata[b"fs_hz"]) == (record.names, b"1024.0")
    assert schema.field("storey3").metadata[b"unit"] == b"g"
    np.testing.assert_array_equal(pd.read_parquet(tmp_path / "a.parquet").to_numpy(), record.samples)


@steady
@given(records())
def test_any_record_comes_back(tmp_path: Path, record: Record) -> None:
    write_parquet(tmp_path / "a.parquet", record)
    assert_same(read_parquet(tmp_path / "a.parquet"), record)


def test_everything_comes_back(tmp_path: Path) -> None:
    write_parquet(tmp_path / "a.parquet", full_record())
    assert_same(read_parquet(tmp_path / "a.parquet"), full_record())


def test_table_of_pandas_with_time_stamps(tmp_path: Path) -> None:
    frame = pd.DataFrame({"a": [1.0, np.nan, 3.0], "b": np.array([1, 2, 3], np.int16), "who": ["x", "y", "z"]})
    frame["time"] = pd.date_range("2026-11-21", periods=3, freq="4ms")
    frame.to_parquet(tmp_path / "a.parquet", index=False)
    record = read_parquet(tmp_path / "a.parquet")
    assert (record.names, record.fs_hz, record.remarks) == (["a", "b"], 250.0, ["who is left out: it holds no numbers"])
    np.testing.assert_array_equal(record.samples, [[1, 1], [np.nan, 2], [3, 3]])


def test_nulls_metadata_and_uneven_time(tmp_path: Path) -> None:
    table = pa.table({"a": pa.array([1, None, 3], pa.int16())}).replace_schema_metadata({"sample_rate": "50"})
    pq.write_table(table, tmp_path / "a.parquet")
    record = read_parquet(tmp_path / "a.parquet")
    assert record.fs_hz == 50.0
    np.testing.assert_array_equal(record.samples, [[1], [np.nan], [3]])
    pq.write_table(pa.table({"a": [1.0, 2, 3], "t": [0.0, 1, 3]}), tmp_path / "b.parquet")
    with pytest.raises(okid.InputError, match="b.parquet: t: a step of 1 s after sample 0, 1.5 s on average"):
        read_parquet(tmp_path / "b.parquet")
    pq.write_table(pa.table({"a": pa.array([], pa.float64())}), tmp_path / "c.parquet")
    with pytest.raises(okid.InputError, match="c.parquet: holds 0 rows"):
        read_parquet(tmp_path / "c.parquet")
