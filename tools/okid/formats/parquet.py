# SPDX-License-Identifier: MIT
"""Parquet: one column a channel, rate and units in the metadata of the schema."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from okid._errors import InputError
from okid.data.input_file import parse_json
from okid.data.memory import require_memory, require_samples
from okid.data.records import Record
from okid.formats.channel_arrays import record_of_arrays, stated_rate
from okid.formats.foreign_library import library, reading, writing


def write_parquet(path: str | Path, record: Record) -> None:
    """Write a record as Parquet: float64 columns; metadata `fs_hz` and `okid` (JSON), `unit` at each column.

    InputError when pyarrow is missing or the file cannot be written.
    """
    arrow, parquet = library("pyarrow", "Parquet"), library("pyarrow.parquet", "Parquet")
    about = record.about()
    fields = [
        arrow.field(name, arrow.float64(), metadata={"unit": unit} if unit else None)
        for name, unit in zip(about["names"], about["units"], strict=True)
    ]
    metadata = {"okid": json.dumps(about)}
    if about["fs_hz"] is not None:
        metadata["fs_hz"] = repr(about["fs_hz"])
    columns = [arrow.array(np.ascontiguousarray(column)) for column in record.samples.T]
    table = arrow.Table.from_arrays(columns, schema=arrow.schema(fields, metadata=metadata))
    with writing(path) as part:
        parquet.write_table(table, part)


def _numbers(arrow: Any, column: Any) -> NDArray[Any] | None:
    """A column as an array, null as NaN, time stamps as s from the first one; None when it holds no numbers."""
    kind = column.type
    if arrow.types.is_timestamp(kind):
        stamps = column.cast(arrow.timestamp("ns")).to_numpy()
        return np.asarray((stamps - stamps[0]) / np.timedelta64(1, "s"), dtype=np.float64)
    if arrow.types.is_floating(kind) or arrow.types.is_integer(kind) or arrow.types.is_boolean(kind):
        return np.asarray(column.cast(arrow.float64()).to_numpy(), dtype=np.float64)
    return None


def read_parquet(path: str | Path) -> Record:
    """Read a Parquet file: what write_parquet() wrote, or any file whose columns are numbers; null is NaN.

    The rate of a foreign file comes from `fs_hz`, `sample_rate` .. in its metadata, else from an even column t, time,
    time_s (s) or of time stamps with such a name. Columns of text are left out with a remark. InputError when pyarrow
    is missing or the file is damaged.
    """
    arrow, parquet = library("pyarrow", "Parquet"), library("pyarrow.parquet", "Parquet")
    with reading(path, "a Parquet file"):
        about = parquet.read_metadata(path)
        require_samples(about.num_rows, about.num_columns)
        groups = [about.row_group(k) for k in range(about.num_row_groups)]
        require_memory(sum(group.total_byte_size for group in groups), "its columns")
        table = parquet.read_table(path)
        metadata = {
            k.decode("utf-8", "replace"): v.decode("utf-8", "replace") for k, v in (table.schema.metadata or {}).items()
        }
        arrays = {name: _numbers(arrow, column) for name, column in zip(table.column_names, table.columns, strict=True)}
        if table.num_rows == 0 or not arrays:
            raise InputError(f"holds {table.num_rows} rows of {len(arrays)} columns, expected samples")
        if "okid" in metadata:
            found = [array for array in arrays.values() if array is not None]
            return Record.described(np.column_stack(found), parse_json(metadata["okid"]))
        units = {f.name: (f.metadata or {}).get(b"unit", b"").decode("utf-8", "replace") for f in table.schema}
        rates = {key: rate for key, value in metadata.items() if (rate := _rate(key, value)) is not None}
        usable = {name: array for name, array in arrays.items() if array is not None and not name.startswith("__")}
        record = record_of_arrays(usable, rates, units=units)
        left = [name for name, array in arrays.items() if array is None]
        record.remarks += [f"{name} is left out: it holds no numbers" for name in left]
        return record


def _rate(key: str, value: str) -> float | None:
    try:
        return stated_rate(key, float(value))
    except ValueError:
        return None
