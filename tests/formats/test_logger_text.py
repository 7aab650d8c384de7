# SPDX-License-Identifier: MIT
"""Exports of loggers, scopes and spreadsheets. The layouts are those that their makers document, not okid's own."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from okid import InputError
from okid.formats import read_logger, read_record
from okid.formats.conversion import convert

RNG = np.random.default_rng(20)
SAMPLES = np.round(RNG.normal(size=(40, 2)), 4)
STEP = 0.004  # 250 Hz


def rows(separator: str = ",", stamp: str = "{:.3f}", scale: float = 1.0, end: str = "", first: float = 0.0) -> str:
    """The samples as lines, the time in front."""
    return "".join(
        separator.join([stamp.format(first + scale * STEP * k), f"{a:.4f}", f"{b:.4f}"]) + end + "\n"
        for k, (a, b) in enumerate(SAMPLES)
    )


def clock(k: int) -> str:
    ms = 4 * k + 59_900  # passes a minute
    return f"10:{ms // 60000:02d}:{ms % 60000 / 1000:06.3f}"


LABVIEW = """LabVIEW Measurement\t
Writer_Version\t2
Separator\tTab
Decimal_Separator\t.
***End_of_Header***\t
\t
Channels\t2\t\t
Samples\t40\t40\t
Delta_X\t0.004000\t0.004000\t
***End_of_Header***\t\t\t
X_Value\tForce\tAcc\tComment
"""
TOA5 = """"TOA5","tower","CR1000","12345","CR1000.Std.32","CPU:mast.CR1","881","fast"
"TIMESTAMP","RECORD","Force","Acc"
"TS","RN","N","g"
"","","Smp","Smp"
"""
WELL = "Header\nt [s],a\n0.0,1\n0.1,2\n0.2,3\n0.3,4\n0.4,4\n"
FILES = {  # name: text, names, units
    "labview.lvm": (LABVIEW + rows("\t", "{:.6f}", end="\t"), ["Force", "Acc"], ["", ""]),
    "toa5.dat": (
        TOA5 + "".join(f'"2026-03-01 {clock(k)}",{k},{a:.4f},{b:.4f}\n' for k, (a, b) in enumerate(SAMPLES)),
        ["RECORD", "Force", "Acc"], ["", "N", "g"],
    ),
    "excel.csv": (
        "Zeit [s];Kraft [N];a1 [m/s²]\n" + rows(";").replace(".", ","), ["Kraft [N]", "a1 [m/s²]"], ["N", "m/s²"],
    ),
    "scope.csv": (
        "Model,DSO-9\nSample Rate,250 Hz\n\nTime,CH1,CH2\n(s),(V),(mV)\n" + rows(), ["CH1", "CH2"], ["V", "mV"],
    ),
    "millis.csv": ("millis,fx,ax\n" + rows(stamp="{:.0f}", scale=1e3, first=7.0), ["fx", "ax"], ["", ""]),
    "monitor.txt": ("% time force acc\n" + rows("  ", "{:.4e}"), ["force", "acc"], ["", ""]),
    "iso.csv": (
        "timestamp,f,a\n" + "".join(f"2026-03-01T{clock(k)}Z,{a:.4f},{b:.4f}\n" for k, (a, b) in enumerate(SAMPLES)),
        ["f", "a"], ["", ""],
    ),
    "clock.tsv": (
        "Clock\tf\ta\n" + "".join(f"{clock(k)}\t{a:.4f}\t{b:.4f}\n" for k, (a, b) in enumerate(SAMPLES)),
        ["f", "a"], ["", ""],
    ),
    "stated.txt": (
        "Operator: A. B.\nSampling interval: 4 ms\n" + "".join(f"{a:.4f}\t{b:.4f}\n" for a, b in SAMPLES),
        ["c1", "c2"], ["", ""],
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", FILES)
@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "cp1252", "utf-16"])
def test_files_of_loggers(name: str, encoding: str, tmp_path: Path) -> None:
    text, names, units = FILES[name]
    path = tmp_path / name
    path.write_bytes(text.replace("\n", "\r\n").encode(encoding))
    record = read_record(path)
    assert (record.names, record.units, record.fs_hz) == (names, units, 250.0), record.remarks
    assert np.array_equal(record.samples[:, -2:], SAMPLES)
    assert record.remarks[0].startswith("read as a logger's file: data from line ")


def test_rows_that_the_time_shows_missing_are_missing_samples(tmp_path: Path) -> None:
    """Stamps in whole milliseconds at 512 Hz: their steps of 1, 2 and 2 ms are no gaps; 5 rows taken out are."""
    kept = np.delete(np.arange(400), [50, 200, 201, 202, 203])
    lines = [f"{round(1000 * k / 512)},{np.sin(k):.4f}" for k in kept]
    path = tmp_path / "a.csv"
    path.write_text("time_ms,a\n" + "\n".join(lines) + "\n")
    record = read_record(path)
    assert record.fs_hz == 512.0 and len(record.samples) == 400
    assert np.flatnonzero(np.isnan(record.samples[:, 0])).tolist() == [50, 200, 201, 202, 203]
    assert "5 samples are missing by the time, first before line 52: NaN" in record.remarks


@pytest.mark.parametrize(
    ("text", "told"),
    [
        (WELL + "0.5,x\n", "line 8, column 2 (a): found 'x'"),
        (WELL + "0.5\n0.6,1\n", "line 8: 1 cells, expected 2"),
        (WELL + "0.4,3\n", "line 8: the time does not rise"),
        (WELL + "0.5,inf\n", "is infinite at sample 5"),
        ("Header\ntime,a\n0,1\n4,2\n8,3\n12,4\n16,4\n20,1\n", "counts in whole numbers and has no unit"),
        ("Header\nt [s],a\n0.01,1\n0.52,2\n1.34,3\n1.61,4\n2.22,4\n3.9,1\n", "okid does not resample"),
        ("all\nwords\n", "no table of numbers was found"),
    ],
)
def test_what_is_wrong_is_named(text: str, told: str, tmp_path: Path) -> None:
    path = tmp_path / "a.txt"
    path.write_text(text)
    with pytest.raises(InputError) as refused:
        read_logger(path)
    assert str(refused.value).startswith(f"{path}") and told in str(refused.value)


def test_a_rate_given_by_hand_needs_no_time(tmp_path: Path) -> None:
    path = tmp_path / "a.txt"
    path.write_text("Header\ntime,a\n0,1\n4,2\n8,3\n12,4\n16,4\n20,1\n")
    record = read_record(path, fs=250.0)
    assert record.fs_hz == 250.0 and record.names == ["time", "a"] and record.samples.shape == (6, 2)


@pytest.mark.parametrize(
    ("text", "fs", "words"),
    [
        ("Header\ntime [s],a\n0.00,1\n0.01,2\n0.02,3\n0.03,4\n0.04,4\n", 250.0, "column 'time [s]' says 100 Hz"),
        ("Header\ntime [s],a\n0.00,1\n0.01,2\n0.02,3\n0.03,4\n0.04,4\n", 100.2, ""),
        ("Sample rate: 512 Hz\na,b\n0,1\n4,2\n8,3\n12,4\n16,4\n20,1\n", 250.0, "a line above the data says 512 Hz"),
    ],
)
def test_another_rate_by_hand_is_said(text: str, fs: float, words: str, tmp_path: Path) -> None:
    path = tmp_path / "a.txt"
    path.write_text(text)
    record = read_record(path, fs=fs)
    said = [remark for remark in record.remarks if "every frequency scales" in remark]
    assert record.fs_hz == fs and len(said) == bool(words) and all(words in remark for remark in said)


def test_okids_own_form_stays_as_strict_as_the_program(tmp_path: Path) -> None:
    """Two rates contradict each other, a row is short, text stands among numbers: no second reading makes it right."""
    for text in ("# fs_hz: 5\n# fs_hz: 6\na,b\n1,2\n3,4\n", "a,b\n1,2\n3\n4,5\n", "a,b\n1,2\n3,x\n4,5\n5,6\n6,7\n"):
        path = tmp_path / "a.csv"
        path.write_text(text)
        with pytest.raises(InputError):
            read_record(path)


def test_command_says_what_was_taken_for_what(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path, out = tmp_path / "scope.csv", tmp_path / "out.csv"
    path.write_text(FILES["scope.csv"][0])
    assert convert([str(path), str(out)]) == 0
    said = capsys.readouterr()
    assert "40 samples x 2 channels, 250 Hz" in said.out
    assert "data from line 6, separated by comma" in said.err and "250 Hz by column 'Time'" in said.err
    again = read_record(out)
    assert again.fs_hz == 250.0 and again.units == ["V", "mV"] and "DSO-9" in again.notes["header"]
