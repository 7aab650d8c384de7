# SPDX-License-Identifier: MIT
"""MDF 4: ours as asammdf sees it, files that asammdf wrote as we see them."""

from __future__ import annotations

from datetime import UTC, datetime
from pathlib import Path

import numpy as np
import okid
import pytest
from asammdf import MDF, Signal
from hypothesis import given
from okid.data.records import Record
from okid.formats import read_mdf4, write_mdf4
from sample_records import assert_same, full_record, records, steady


def save(path: Path, *groups: list[Signal], start: datetime | None = None) -> None:
    with MDF(version="4.10") as file:
        file.header.start_time = start or datetime(1970, 1, 1, tzinfo=UTC)
        for signals in groups:
            file.append(signals)
        file.save(path, overwrite=True)


def signal(name: str, values: object, step: float = 0.004, **options: object) -> Signal:
    samples = np.asarray(values)
    return Signal(samples, np.arange(len(samples)) * step, name=name, **options)


def test_as_asammdf_sees_it(tmp_path: Path) -> None:
    record = full_record()
    write_mdf4(tmp_path / "a.mf4", record)
    with MDF(tmp_path / "a.mf4") as file:
        assert file.header.start_time == record.start_time
        for name, unit, column in zip(record.names, record.units, record.samples.T, strict=True):
            seen = file.get(name)
            np.testing.assert_array_equal(seen.samples, column)
            np.testing.assert_allclose(seen.timestamps, np.arange(len(column)) / 1024.0, rtol=1e-15)
            assert seen.unit == unit


@steady
@given(records())
def test_any_record_comes_back(tmp_path: Path, record: Record) -> None:
    write_mdf4(tmp_path / "a.mf4", record)
    assert_same(read_mdf4(tmp_path / "a.mf4"), record)


def test_everything_comes_back(tmp_path: Path) -> None:
    write_mdf4(tmp_path / "a.mf4", full_record())
    assert_same(read_mdf4(tmp_path / "a.mf4"), full_record())


def test_a_record_without_rate_is_refused(tmp_path: Path) -> None:
    with pytest.raises(okid.InputError, match="a.mf4: MDF needs a sample rate"):
        write_mdf4(tmp_path / "a.mf4", Record(["a"], [[1.0]]))
    assert list(tmp_path.iterdir()) == []


def test_groups_of_one_raster_are_one_record(tmp_path: Path) -> None:
    codes = np.arange(-5, 5, dtype=np.int16)
    start = datetime(2026, 11, 21, 12, tzinfo=UTC)
    texts = signal("state", np.array([b"on"] * 10), encoding="utf-8")
    save(tmp_path / "a.mf4", [signal("a", codes, unit="N")], [signal("b", codes * 0.5, unit="g"), texts], start=start)
    record = read_mdf4(tmp_path / "a.mf4")
    assert (record.names, record.units, record.fs_hz) == (["a", "b"], ["N", "g"], 250.0)
    assert record.start_time == start
    assert record.remarks == ["state is left out: it holds no numbers"]
    np.testing.assert_array_equal(record.samples[:, 0], codes)


def test_scaled_integers_and_invalid_samples(tmp_path: Path) -> None:
    linear = {"a": 0.25, "b": -1.0}
    invalid = np.array([False, True, False, False])
    values = np.array([0, 4, 8, 100], dtype=np.int16)
    save(tmp_path / "a.mf4", [signal("a", values, conversion=linear, invalidation_bits=invalid)])
    np.testing.assert_array_equal(read_mdf4(tmp_path / "a.mf4").samples[:, 0], [-1.0, np.nan, 1.0, 24.0])


def test_different_rasters_are_listed_and_chosen(tmp_path: Path) -> None:
    save(
        tmp_path / "a.mf4", [signal("a", np.ones(100))], [signal("b", np.ones(50), 0.008)], [signal("c", np.ones(100))]
    )
    words = r"a.mf4: channels of 2 rasters, .*1: a, c \(100 samples, 250 Hz\); 2: b \(50 samples, 125 Hz\)"
    with pytest.raises(okid.InputError, match=words):
        read_mdf4(tmp_path / "a.mf4")
    assert read_mdf4(tmp_path / "a.mf4", group=1).names == ["a", "c"]
    assert read_mdf4(tmp_path / "a.mf4", group="2").fs_hz == 125.0
    with pytest.raises(okid.InputError, match="group is 3, expected one of 1: a"):
        read_mdf4(tmp_path / "a.mf4", group=3)


def test_uneven_time_stamps_are_not_resampled(tmp_path: Path) -> None:
    stamps = np.delete(np.arange(20) * 0.01, 5)
    save(tmp_path / "a.mf4", [Signal(np.ones(19), stamps, name="a")])
    with pytest.raises(
        okid.InputError, match="a: a step of 0.02 s after sample 4, .* not evenly spaced; okid does not"
    ):
        read_mdf4(tmp_path / "a.mf4")


def test_a_file_without_samples(tmp_path: Path) -> None:
    save(tmp_path / "a.mf4", [Signal(np.array([]), np.array([]), name="a")])
    with pytest.raises(okid.InputError, match="a.mf4: holds no channel with samples"):
        read_mdf4(tmp_path / "a.mf4")
