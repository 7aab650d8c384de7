# SPDX-License-Identifier: MIT
"""MATLAB files: ours as scipy sees them, those of scipy (4, 5) and of MATLAB 7.3's layout as we see them."""

from __future__ import annotations

from pathlib import Path

import h5py
import numpy as np
import okid
import pytest
from hypothesis import given
from okid.data.records import Record
from okid.formats import read_mat, write_mat, write_result
from okid.formats.mat import read_mat_result
from program import okid as okid_program
from sample_records import assert_same, full_record, identified, records, shaken_frame, steady
from scipy.io import loadmat, savemat


def test_variables_as_matlab_sees_them(tmp_path: Path) -> None:
    record = full_record()
    write_mat(tmp_path / "a.mat", record)
    seen = loadmat(tmp_path / "a.mat", squeeze_me=True)
    np.testing.assert_array_equal(seen["samples"], record.samples)
    assert (seen["names"].tolist(), seen["fs"], seen["title"]) == (record.names, 1024.0, record.title)
    assert loadmat(tmp_path / "a.mat")["names"].shape == (4, 1)


def test_everything_comes_back(tmp_path: Path) -> None:
    write_mat(tmp_path / "a.mat", full_record())
    assert_same(read_mat(tmp_path / "a.mat"), full_record())


@steady
@given(records())
def test_any_record_comes_back(tmp_path: Path, record: Record) -> None:
    write_mat(tmp_path / "a.mat", record)
    assert_same(read_mat(tmp_path / "a.mat"), record)


@pytest.mark.parametrize("version", ["4", "5"])
@pytest.mark.parametrize("clock", [{"fs": 200}, {"dt": 0.005}, {"t": np.arange(50) * 0.005}])
def test_plain_arrays_of_another_program(tmp_path: Path, version: str, clock: dict) -> None:
    u, y = np.arange(50, dtype=np.int16), np.arange(100.0).reshape(50, 2)
    savemat(tmp_path / "a.mat", {"u": u[:, None], "y": y, **clock}, format=version)
    record = read_mat(tmp_path / "a.mat")
    assert (record.names, record.fs_hz) == (["u", "y1", "y2"], 200.0)
    np.testing.assert_array_equal(record.samples, np.column_stack([u, y]))


def test_names_units_transposed_arrays_and_choices(tmp_path: Path) -> None:
    cells = np.array(["a", "b"], dtype=object)
    savemat(tmp_path / "a.mat", {"y": np.zeros((2, 90)), "names": cells, "units": np.array(["g", "N"], dtype=object)})
    record = read_mat(tmp_path / "a.mat")
    assert (record.names, record.units, record.fs_hz, record.samples.shape) == (["a", "b"], ["g", "N"], None, (90, 2))
    assert record.remarks == ["y is 2 x 90: read as 2 channels of 90 samples"]
    savemat(tmp_path / "b.mat", {"y": np.zeros(90), "slow": np.zeros(9), "Fs": 5.0, "s": {"x": 1.0}})
    with pytest.raises(okid.InputError, match=r"b.mat: .*slow 1 x 9.* group="):
        read_mat(tmp_path / "b.mat")
    record = read_mat(tmp_path / "b.mat", group="y")
    assert (record.names, record.fs_hz) == (["y"], 5.0)
    with pytest.raises(okid.InputError, match="no variable 'z'; it has y, slow, Fs, s"):
        read_mat(tmp_path / "b.mat", group="z")
    savemat(tmp_path / "c.mat", {"a": "text"})
    with pytest.raises(okid.InputError, match="c.mat: holds no array of samples"):
        read_mat(tmp_path / "c.mat")


def matlab_73(path: Path) -> None:
    """The layout of MATLAB's -v7.3: HDF5 behind 512 bytes, arrays transposed, texts as numbers, cells as references."""
    with h5py.File(path, "w", userblock_size=512) as file:
        file["u"] = np.arange(50.0)[None, :]
        file["y"] = np.arange(100.0).reshape(50, 2).T
        file["fs"] = np.array([[200.0]])
        file["note"] = np.array([[ord(c)] for c in "hello"], dtype=np.uint16)
        file["note"].attrs["MATLAB_class"] = np.bytes_(b"char")
        for k, name in enumerate(["force", "left", "right"]):
            file[f"#refs#/{k}"] = np.array([[ord(c)] for c in name], dtype=np.uint16)
            file[f"#refs#/{k}"].attrs["MATLAB_class"] = np.bytes_(b"char")
        file["names"] = np.array([[file[f"#refs#/{k}"].ref for k in range(3)]], dtype=h5py.ref_dtype)
        file["names"].attrs["MATLAB_class"] = np.bytes_(b"cell")
    head = b"MATLAB 7.3 MAT-file".ljust(124) + b"\x00\x02IM"
    data = path.read_bytes()
    path.write_bytes(head + data[len(head) :])


def test_version_73(tmp_path: Path) -> None:
    matlab_73(tmp_path / "a.mat")
    record = read_mat(tmp_path / "a.mat")
    assert (record.names, record.fs_hz) == (["force", "left", "right"], 200.0)
    np.testing.assert_array_equal(record.samples[:, 1:], np.arange(100.0).reshape(50, 2))


def test_result_has_what_identify_model_writes(tmp_path: Path) -> None:
    result = identified()
    write_result(tmp_path / "r.mat", result)
    seen = loadmat(tmp_path / "r.mat", squeeze_me=True)
    u, y = shaken_frame()
    okid.formats.write_csv(tmp_path / "a.csv", Record(["u", "y1", "y2", "y3"], np.hstack([u, y]), 1000.0))
    done = okid_program(
        "identify",
        tmp_path / "a.csv",
        "--inputs",
        "u",
        "--outputs",
        "y1,y2,y3",
        "--method",
        "okid-era",
        "--model",
        tmp_path / "m.mat",
    )
    assert done.returncode == 0, done.stderr
    model = loadmat(tmp_path / "m.mat", squeeze_me=True)
    for name in ("A", "B", "C", "D", "K", "dt"):
        np.testing.assert_array_equal(seen[name], np.squeeze(getattr(result.model, name)))
        assert seen[name].shape == model[name].shape if name != "dt" else seen["dt"] == model["dt"]
    np.testing.assert_array_equal(seen["mkr"]["M"].item(), result.mkr.M)
    np.testing.assert_array_equal(seen["shapes"].T, [m.shape for m in result.modes])
    assert read_mat_result(tmp_path / "r.mat") == result.to_dict()
