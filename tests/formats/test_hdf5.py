# SPDX-License-Identifier: MIT
"""HDF5: our layout as h5py sees it, files that h5py wrote as we see them."""

from __future__ import annotations

import hashlib
from pathlib import Path

import h5py
import numpy as np
import okid
import pytest
from hypothesis import given
from okid.data.records import Record
from okid.formats import read_hdf5, write_hdf5, write_result
from okid.formats.hdf5 import read_hdf5_result
from sample_records import assert_same, full_record, identified, records, steady


def test_layout_as_documented(tmp_path: Path) -> None:
    record = full_record()
    write_hdf5(tmp_path / "a.h5", record)
    with h5py.File(tmp_path / "a.h5") as file:
        assert (file.attrs["schema"], file.attrs["fs_hz"], file.attrs["title"]) == (
            "okid.record/1",
            1024.0,
            record.title,
        )
        assert file.attrs["start_time"] == "2026-11-21T12:00:00.123456+00:00"
        data = file["samples"]
        np.testing.assert_array_equal(data[()], record.samples)
        assert list(data.attrs["names"]) == record.names
        assert list(data.attrs["units"]) == record.units
        assert list(data.attrs["roles"]) == ["force", "acceleration", "aux", ""]
        assert data.attrs["dofs"].tolist() == [1, 2, 0, 3]
        assert data.attrs["sha256"] == hashlib.sha256(record.samples.tobytes()).hexdigest()
        assert dict(file["notes"].attrs) == record.notes


def test_everything_comes_back(tmp_path: Path) -> None:
    write_hdf5(tmp_path / "a.h5", full_record())
    assert_same(read_hdf5(tmp_path / "a.h5"), full_record())


@steady
@given(records())
def test_any_record_comes_back(tmp_path: Path, record: Record) -> None:
    write_hdf5(tmp_path / "a.h5", record)
    assert_same(read_hdf5(tmp_path / "a.h5"), record)


def test_changed_samples_are_seen(tmp_path: Path) -> None:
    write_hdf5(tmp_path / "a.h5", full_record())
    with h5py.File(tmp_path / "a.h5", "r+") as file:
        file["samples"][7, 1] += 1e-9
    with pytest.raises(okid.InputError, match=r"a.h5: dataset samples is not what was written: its sha256 differs"):
        read_hdf5(tmp_path / "a.h5")


def foreign(path: Path, rows: int = 50) -> None:
    with h5py.File(path, "w") as file:
        file.attrs["sample_rate"] = 200
        file["force"] = np.arange(rows, dtype=np.int16)
        file["force"].attrs["unit"] = b"N"
        file["acc/y"] = np.arange(2.0 * rows).reshape(rows, 2)
        file["acc/y"].attrs["units"] = "g"
        file["comment"] = "a text"


def test_datasets_of_another_program(tmp_path: Path) -> None:
    foreign(tmp_path / "a.h5")
    record = read_hdf5(tmp_path / "a.h5")
    assert (record.names, record.units, record.fs_hz) == (["acc/y1", "acc/y2", "force"], ["g", "g", "N"], 200.0)
    np.testing.assert_array_equal(record.samples[:, 2], np.arange(50))
    assert read_hdf5(tmp_path / "a.h5", group="acc").names == ["y1", "y2"]
    with pytest.raises(okid.InputError, match="no group 'x'; it has acc, comment, force"):
        read_hdf5(tmp_path / "a.h5", group="x")


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda f: f.create_dataset("slow", data=np.zeros(25)), r"do not share one number of samples .*slow 25"),
        (
            lambda f: f["acc/y"].attrs.create("dt", 0.01),
            r"several sample rates \(sample_rate says 200 Hz, acc/y.dt says 100",
        ),
        (lambda f: f.create_dataset("z", data=np.zeros(50, complex)), "z is complex"),
    ],
)
def test_what_cannot_be_one_record_is_said(tmp_path: Path, change, words: str) -> None:  # type: ignore[no-untyped-def]
    foreign(tmp_path / "a.h5")
    with h5py.File(tmp_path / "a.h5", "r+") as file:
        change(file)
    with pytest.raises(okid.InputError, match=f"a.h5: .*{words}"):
        read_hdf5(tmp_path / "a.h5")


def test_time_axis_gives_the_rate_or_says_why_not(tmp_path: Path) -> None:
    with h5py.File(tmp_path / "a.h5", "w") as file:
        file["time"], file["a"] = np.arange(10) * 0.02, np.ones((10, 1))
    record = read_hdf5(tmp_path / "a.h5")
    assert (record.names, record.fs_hz) == (["a"], 50.0)
    with h5py.File(tmp_path / "a.h5", "r+") as file:
        file["time"][5:] += 0.5
    with pytest.raises(okid.InputError, match="time: a step of 0.52 s after sample 4"):
        read_hdf5(tmp_path / "a.h5")


def test_result(tmp_path: Path) -> None:
    result = identified()
    write_result(tmp_path / "r.hdf5", result)
    with h5py.File(tmp_path / "r.hdf5") as file:
        np.testing.assert_array_equal(file["model/A"][()], result.model.A)
        np.testing.assert_array_equal(file["modes/shapes"][()].T, [m.shape for m in result.modes])
        np.testing.assert_array_equal(file["modes/frequency_hz"][()], [m.frequency_hz for m in result.modes])
        np.testing.assert_array_equal(file["mkr/M"][()], result.mkr.M)
        assert [name.decode() for name in file["outputs"]] == result.outputs
    assert read_hdf5_result(tmp_path / "r.hdf5") == result.to_dict()
    with pytest.raises(okid.InputError, match="holds an identified model, expected measured samples"):
        read_hdf5(tmp_path / "r.hdf5")
