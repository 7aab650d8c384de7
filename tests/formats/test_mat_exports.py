# SPDX-License-Identifier: MIT
"""Exports of Testlab and Dewesoft as .mat, written here in their layouts by scipy (5) and h5py (7.3)."""

from __future__ import annotations

import itertools
from collections.abc import Callable
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import okid
import pytest
from okid.formats import read_mat
from okid.formats.command import main as convert
from scipy.io import savemat

Structs = dict[str, Any]
Writer = Callable[[Path, Structs], None]
N = 400
ACCELERATIONS = np.cumsum(np.random.default_rng(5).standard_normal((N, 3)), axis=0)
FORCE = np.random.default_rng(6).standard_normal(N)


def cells(*values: object) -> np.ndarray[Any, Any]:
    made = np.empty((1, len(values)), dtype=object)
    made[0, :] = values
    return made


def write_5(path: Path, variables: Structs) -> None:
    savemat(path, variables, long_field_names=True, do_compression=True)


def write_73(path: Path, variables: Structs) -> None:
    """As MATLAB's -v7.3 has it: structs are groups, arrays transposed, texts numbers, cells references into #refs#."""
    number = itertools.count()

    def put(file: h5py.File, place: Any, key: str, value: Any) -> None:
        if isinstance(value, dict):
            group = place.create_group(key)
            group.attrs["MATLAB_class"] = np.bytes_(b"struct")
            for name, inner in value.items():
                put(file, group, name, inner)
        elif isinstance(value, str):
            place[key] = np.array([[ord(c)] for c in value], dtype=np.uint16)
            place[key].attrs["MATLAB_class"] = np.bytes_(b"char")
        elif np.asarray(value).dtype.kind == "O":
            names = [f"r{next(number)}" for _ in range(value.size)]
            for name, one in zip(names, value.reshape(-1), strict=True):
                put(file, file.require_group("#refs#"), name, one)
            references = np.array([file[f"#refs#/{name}"].ref for name in names], dtype=h5py.ref_dtype)
            place[key] = references.reshape(value.shape[::-1])
            place[key].attrs["MATLAB_class"] = np.bytes_(b"cell")
        else:
            place[key] = np.atleast_2d(value).T
            place[key].attrs["MATLAB_class"] = np.bytes_(b"double")

    with h5py.File(path, "w", userblock_size=512) as file:
        for key, value in variables.items():
            put(file, file, key, value)
    data = path.read_bytes()
    path.write_bytes((b"MATLAB 7.3 MAT-file".ljust(124) + b"\x00\x02IM") + data[128:])


both = pytest.mark.parametrize("write", [write_5, write_73], ids=["5", "7.3"])


def signal(values: Any, names: Any, unit: str, step: float = 1.0 / 2048, axis: str = "s") -> Structs:
    """A variable of Testlab: the axis by start and increment, values (N, channels) in the unit of the label."""
    table = np.asarray(values).reshape(len(values), -1)
    return {
        "x_values": {
            "start_value": 0.0, "increment": step, "number_of_values": float(len(table)),
            "quantity": {"label": axis, "unit_transformation": {"factor": 1.0, "offset": 0.0}},
        },
        "y_values": {
            "values": table,
            "quantity": {"label": unit, "unit_transformation": {"factor": 9.80665, "offset": 0.0}},
        },
        "function_record": {"format": "real", "name": names, "type": "time"},
    }  # fmt: skip


@both
def test_testlab_has_a_struct_for_each_quantity(tmp_path: Path, write: Writer) -> None:
    names = cells("P1:+X", "P1:+Y", "Grün +Z")
    write(tmp_path / "a.mat", {"Signal_0": signal(ACCELERATIONS, names, "g"), "Signal_1": signal(FORCE, "Shaker", "N")})
    record = read_mat(tmp_path / "a.mat")
    assert (record.names, record.units) == (["P1:+X", "P1:+Y", "Grün +Z", "Shaker"], ["g", "g", "g", "N"])
    assert record.fs_hz == 2048.0
    np.testing.assert_array_equal(record.samples, np.column_stack([ACCELERATIONS, FORCE]))
    assert record.remarks == ["read as an export of Testlab"]


@both
def test_testlab_names_of_channels_where_the_record_has_one_name(tmp_path: Path, write: Writer) -> None:
    one = signal(ACCELERATIONS, "Throughput", "m/s^2", 3.90625e-5)
    one["function_record"]["primary_channel"] = {"label": cells("Point1", "Point2", "Point3")}
    write(tmp_path / "a.mat", {"Signal": one})
    record = read_mat(tmp_path / "a.mat")
    assert (record.names, record.fs_hz) == (["Point1", "Point2", "Point3"], 25600.0)


def test_testlab_channels_as_an_array_of_structs(tmp_path: Path) -> None:
    channels = np.array([("Point1",), ("Point2",), ("Point3",)], dtype=[("label", object)])
    one = signal(ACCELERATIONS, "Throughput", "g")
    one["function_record"]["primary_channel"] = channels
    write_5(tmp_path / "a.mat", {"Signal": one})
    assert read_mat(tmp_path / "a.mat").names == ["Point1", "Point2", "Point3"]


@both
def test_testlab_names_that_stand_twice_or_lack(tmp_path: Path, write: Writer) -> None:
    write(tmp_path / "a.mat", {"C1": signal(FORCE, "Point1", "g"), "C2": signal(FORCE, "Point1", "g")})
    assert read_mat(tmp_path / "a.mat").names == ["C1 Point1", "C2 Point1"]
    write(tmp_path / "b.mat", {"C1": signal(ACCELERATIONS, "", "g"), "C2": signal(FORCE, "", "N")})
    assert read_mat(tmp_path / "b.mat").names == ["C1_1", "C1_2", "C1_3", "C2"]


@both
def test_testlab_rasters_are_chosen(tmp_path: Path, write: Writer) -> None:
    slow = signal(FORCE[:100], "Tacho", "rpm", 1.0 / 512)
    write(tmp_path / "a.mat", {"Signal_0": signal(ACCELERATIONS, cells("a", "b", "c"), "g"), "Signal_1": slow})
    with pytest.raises(okid.InputError, match=r"a.mat: channels of 2 rasters.*1: a, b, c \(400 .*2048 Hz\); 2: Tacho"):
        read_mat(tmp_path / "a.mat")
    assert read_mat(tmp_path / "a.mat", group=2).names == ["Tacho"]
    assert read_mat(tmp_path / "a.mat", group="Signal_0").names == ["a", "b", "c"]
    with pytest.raises(okid.InputError, match="no variable 'Signal_7'; it has Signal_0, Signal_1"):
        read_mat(tmp_path / "a.mat", group="Signal_7")


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"axis": "Hz"}, "Signal is a function over 'Hz', expected time histories over s"),
        ({"values": ACCELERATIONS + 1j}, "no real samples x channels"),
        ({"step": 0.0}, "no x_values.increment above 0"),
    ],
)
def test_testlab_what_is_no_time_history(tmp_path: Path, change: dict[str, Any], words: str) -> None:
    write_5(tmp_path / "a.mat", {"Signal": signal(**{"values": ACCELERATIONS, "names": "n", "unit": "g", **change})})
    with pytest.raises(okid.InputError, match=words):
        read_mat(tmp_path / "a.mat")


def dewesoft(**more: Any) -> Structs:
    """Columns Data1_NAME at Sample_rate, the way its export names them."""
    columns = {f"Data1_AI_{k + 1}": ACCELERATIONS[:, k : k + 1] for k in range(3)}
    return {"Sample_rate": 5000.0, "Start_time": "02.05.2024 10:11:12", **columns, **more}


def stamps(count: int, rate: float, start: float = 0.0, per_day: bool = False) -> np.ndarray[Any, Any]:
    seconds = np.arange(count)[:, None] / rate
    return start + (seconds / 86400.0 if per_day else seconds)


@both
def test_dewesoft_without_time_stamps(tmp_path: Path, write: Writer) -> None:
    write(tmp_path / "a.mat", dewesoft())
    record = read_mat(tmp_path / "a.mat")
    assert (record.names, record.fs_hz, record.units) == (["AI_1", "AI_2", "AI_3"], 5000.0, ["", "", ""])
    np.testing.assert_array_equal(record.samples, ACCELERATIONS)
    assert record.remarks == ["read as an export of Dewesoft"]


@both
@pytest.mark.parametrize(("start", "per_day"), [(0.0, False), (12.5, False), (739_380.42, True)])
@pytest.mark.parametrize("stated", [True, False])
def test_dewesoft_with_time_stamps(tmp_path: Path, write: Writer, start: float, per_day: bool, stated: bool) -> None:
    """Seconds, or days since the year 0, which tell 10 us apart: a twentieth of a step here."""
    clocks = {f"Data1_time_AI_{k}": stamps(N, 5000.0, start, per_day) for k in (1, 2, 3)}
    given = dewesoft(**clocks)
    if not stated:
        del given["Sample_rate"]
        if per_day:  # then 5 kHz is too fast for such stamps, 500 Hz is not
            given |= {f"Data1_time_AI_{k}": stamps(N, 500.0, start, True) for k in (1, 2, 3)}
    write(tmp_path / "a.mat", given)
    record = read_mat(tmp_path / "a.mat")
    assert record.names == ["AI_1", "AI_2", "AI_3"]
    assert record.fs_hz == pytest.approx(500.0 if per_day and not stated else 5000.0, rel=0 if stated else 1e-5)
    np.testing.assert_array_equal(record.samples, ACCELERATIONS)


@both
def test_dewesoft_divided_and_asynchronous_channels(tmp_path: Path, write: Writer) -> None:
    """A channel of a tenth of the rate, and one of a bus message whose time stamps are the message's."""
    more = {
        "Data1_Temperature": FORCE[:40, None], "Data1_time_Temperature": stamps(40, 500.0),
        "Data1_Wheel_Speed": FORCE[:50, None], "Data1_time_Wheel": stamps(50, 123.0, 0.003),
        **{f"Data1_time_AI_{k}": stamps(N, 5000.0) for k in (1, 2, 3)},
    }  # fmt: skip
    write(tmp_path / "a.mat", dewesoft(**more))
    with pytest.raises(okid.InputError, match=r"3 rasters.*1: AI_1, AI_2, AI_3 .*5000 Hz.*2: Temp.*500 Hz.*123 Hz"):
        read_mat(tmp_path / "a.mat")
    assert read_mat(tmp_path / "a.mat", group="2").names == ["Temperature"]
    chosen = read_mat(tmp_path / "a.mat", group="Data1_AI_3, Data1_AI_1")
    assert (chosen.names, chosen.fs_hz) == (["AI_1", "AI_3"], 5000.0)


def test_dewesoft_events_are_rasters_of_their_own(tmp_path: Path) -> None:
    write_5(tmp_path / "a.mat", dewesoft(Data2_AI_1=FORCE[:, None]))
    with pytest.raises(okid.InputError, match=r"1: Data1_AI_1, Data1_AI_2, Data1_AI_3 .*; 2: Data2_AI_1 "):
        read_mat(tmp_path / "a.mat")


def test_dewesoft_gap_between_stamps_is_refused(tmp_path: Path) -> None:
    torn = stamps(N, 5000.0)
    torn[200:] += 0.01
    write_5(tmp_path / "a.mat", dewesoft(**{f"Data1_time_AI_{k}": torn for k in (1, 2, 3)}))
    with pytest.raises(okid.InputError, match=r"AI_1: a step of 0\.0102 s after sample 199.*okid does not resample"):
        read_mat(tmp_path / "a.mat")


def test_a_time_of_nothing_is_left_out_with_a_remark(tmp_path: Path) -> None:
    write_5(tmp_path / "a.mat", dewesoft(Data1_time_GPS=stamps(33, 10.0)))
    assert read_mat(tmp_path / "a.mat").remarks[1] == "Data1_time_GPS is left out: the time of no channel of 33 samples"


def test_other_structs_stay_what_they_were(tmp_path: Path) -> None:
    """Variables named Data1_ of nobody, and structs beside arrays: the general rules."""
    write_5(tmp_path / "a.mat", {"Data1_x": FORCE, "s": {"x_values": 1.0}, "deep": {"a": {"b": {"c": 1.0}}}})
    record = read_mat(tmp_path / "a.mat")
    assert (record.names, record.fs_hz, record.remarks) == (["Data1_x"], None, [])


def test_structs_without_end(tmp_path: Path) -> None:
    path = tmp_path / "a.mat"
    write_73(path, {"a": {"b": FORCE}})
    with h5py.File(path, "r+") as file:
        file["a/again"] = file["a"]
    with pytest.raises(okid.InputError, match="a.mat: structs and cells are nested more than 8 deep"):
        read_mat(path)


def test_command_keeps_units_and_rate(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    write_73(tmp_path / "a.mat", {"Signal_0": signal(ACCELERATIONS, cells("a", "b", "c"), "g")})
    assert convert([str(tmp_path / "a.mat"), str(tmp_path / "a.csv")]) == 0
    assert "note: read as an export of Testlab" in capsys.readouterr().err
    again = okid.formats.read_record(tmp_path / "a.csv")
    assert (again.fs_hz, again.units) == (2048.0, ["g"] * 3)
    np.testing.assert_array_equal(again.samples, ACCELERATIONS)
