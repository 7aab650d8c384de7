# SPDX-License-Identifier: MIT
"""`okid identify` on files of other programs: the same answer as from the CSV that okid-convert makes of them."""

from __future__ import annotations

import json
import os
import re
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest
import scipy.io
from okid.data.records import Record
from okid.formats import write_csv, write_record
from okid.formats.command import main
from program import PROGRAM, okid
from sample_records import NAMES, shaken_frame

CHOSEN = ("--inputs", NAMES[0], "--outputs", ",".join(NAMES[1:]))


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Temporary files of the program, in a folder that can be looked into."""
    (tmp_path / "temporary").mkdir()
    monkeypatch.setenv("TMPDIR", str(tmp_path / "temporary"))
    return tmp_path


def frame() -> Record:
    u, y = shaken_frame()
    return Record(list(NAMES), np.hstack([u, y]), 1000.0, ["N", "m/s^2", "m/s^2", "m/s^2"])


def time_history(node: int, quantity: int, name: str, data: np.ndarray) -> str:
    """Data set 58 as its definition has it: function type 1, double precision, even spacing of 1 ms, ASCII."""
    rows = [data[at : at + 4] for at in range(0, len(data), 4)]
    lines = [
        "    -1", "    58", name, "NONE", "22-NOV-26 12:00:00", "NONE", "NONE",
        f"    1         0    0         0 {name:<10}{node:>10}   1 NONE               0   0",
        f"         4{len(data):>10}         1  0.00000E+00  1.00000E-03  0.00000E+00",
        f"        17    0    0    0 {'Time':<20} {'s':<20}",
        f"{quantity:>10}    0    0    0 {name:<20} {'NONE':<20}",
        *[f"{0:>10}    0    0    0 {'NONE':<20} {'NONE':<20}"] * 2,
        *("".join(f"{value:20.12e}" for value in row) for row in rows), "    -1",
    ]  # fmt: skip
    return "\n".join(lines) + "\n"


def modes_of(path: Path, *more: str) -> object:
    result = json.loads(okid("identify", path, *more, "--json", "-", status=0).stdout)
    return result["modes"]


@pytest.mark.parametrize("ending", ["mat", "h5", "mf4", "parquet", "uff"])
def test_the_same_modes(folder: Path, ending: str) -> None:
    path = folder / f"frame.{ending}"
    write_csv(folder / "frame.csv", frame())
    write_record(path, frame())
    assert modes_of(path, *CHOSEN) == modes_of(folder / "frame.csv", *CHOSEN)
    assert list((folder / "temporary").iterdir()) == []


def rows_of_a_logger(*, unit: float = 1.0, mark: str = ",", missing: tuple[int, ...] = ()) -> list[str]:
    """Time stamps and the samples, to the last bit; `unit` in s."""
    data = np.hstack(shaken_frame())
    rows = ([f"{k / 1000.0 / unit:.6g}", *map(repr, row)] for k, row in enumerate(data.tolist()))
    return [mark.join(cells) for k, cells in enumerate(rows) if k not in missing]


LOGGERS = {
    "a title": ["Recorder 7,serial 1234", "", "Time," + ",".join(NAMES), *rows_of_a_logger()],
    "units below": ["Time," + ",".join(NAMES), "(s),(N),(m/s2),(m/s2),(m/s2)", *rows_of_a_logger()],
    "milliseconds": ["Time [ms]," + ",".join(NAMES), *rows_of_a_logger(unit=1e-3)],
    "comma": ["Zeit [s];" + ";".join(NAMES), *(row.replace(".", ",") for row in rows_of_a_logger(mark=";"))],
}


@pytest.mark.parametrize("kind", LOGGERS)
def test_a_csv_that_another_program_wrote(folder: Path, kind: str) -> None:
    path = folder / "logger.csv"
    path.write_text("\n".join(LOGGERS[kind]) + "\n", encoding="utf-16" if kind == "a title" else "utf-8")
    write_csv(folder / "frame.csv", frame())
    assert modes_of(path, *CHOSEN) == modes_of(folder / "frame.csv", *CHOSEN)
    said = okid("identify", path, *CHOSEN, "--json", "-", status=0).stderr
    assert "okid-convert: note: " in said and "1000 Hz" in said and "samples.csv" not in said, said
    listed = okid("identify", path, status=2).stderr
    assert all(name in listed for name in NAMES), listed


def test_rows_that_the_time_shows_missing(folder: Path) -> None:
    (folder / "run.csv").write_text(
        "\n".join(["t," + ",".join(NAMES), *rows_of_a_logger(missing=(700, 701, 702))]) + "\n"
    )
    (folder / "frame.csv").write_text("\n".join(["t," + ",".join(NAMES), *rows_of_a_logger()]) + "\n")
    done = okid("identify", folder / "run.csv", *CHOSEN, "--json", "-", status=0)
    assert "3 samples are missing by the time" in done.stderr
    whole, parted = modes_of(folder / "frame.csv", *CHOSEN), json.loads(done.stdout)["modes"]
    assert [one["confident"] for one in parted] == [one["confident"] for one in whole]
    assert [one["frequency_hz"] for one in parted] == pytest.approx([one["frequency_hz"] for one in whole], rel=1e-3)


def test_what_okid_convert_cannot_read_either(folder: Path) -> None:
    rows = rows_of_a_logger()
    rows[50] += ",1"
    (folder / "ragged.csv").write_text("\n".join(["time_s," + ",".join(NAMES), *rows]) + "\n")
    (folder / "no_rate.csv").write_text("u,y\n" + "1.5,2.5\n-3.5,4.5\n" * 50)
    (folder / "no_head.csv").write_text("1.5,2.5\n-3.5,4.5\n" * 50)
    (folder / "logger.csv").write_text(
        "\n".join(["Operator: A", "Date: today", "time_s," + ",".join(NAMES), *rows_of_a_logger()]) + "\n"
    )
    for name, options, part in (
        ("ragged.csv", CHOSEN, "line 52: found 6 cells, expected 5"),
        ("no_rate.csv", ("--inputs", "u", "--outputs", "y"), "no sample rate; expected --fs HZ"),
        ("no_rate.csv", ("--inputs", "u", "--outputs", "x"), 'no column "x"'),
        ("logger.csv", ("--inputs", "u", "--outputs", "y"), f"no column \"u\"; the columns are: {', '.join(NAMES)}"),
        ("no_head.csv", ("--fs", "9", "--inputs", "c1", "--outputs", "d"), "the columns are: c1, c2"),
    ):
        said = okid("identify", folder / name, *options, status=2).stderr
        assert said.startswith(f"okid: {folder / name}") and part in said and said.count("\n") == 1, said
    assert list((folder / "temporary").iterdir()) == []


def test_files_that_no_writer_of_ours_made(folder: Path) -> None:
    u, y = shaken_frame()
    scipy.io.savemat(folder / "lab.mat", {"Fs": 1000.0, "hammer": u[:, 0], "acc": y})
    columns = zip((13, 12, 12, 12), ("hammer", "acc1", "acc2", "acc3"), np.hstack([u, y]).T, strict=True)
    sets = [time_history(node, quantity, name, data) for node, (quantity, name, data) in enumerate(columns, 1)]
    (folder / "lab.uff").write_text("".join(sets))
    for name in ("lab.mat", "lab.uff"):
        said = okid("identify", folder / name, status=2).stderr
        proposed = re.search(r"; by their names perhaps --inputs (\S+) --outputs (\S+)$", said.strip())
        assert proposed, said
        modes = modes_of(folder / name, "--inputs", proposed[1], "--outputs", proposed[2])
        assert isinstance(modes, list) and len([one for one in modes if one["confident"]]) == 3, name


def test_columns_are_proposed_as_they_are_typed(folder: Path) -> None:
    record = frame()
    record.names = ["Hammer, left [N]", "Acc 1 [m/s^2]", "b's", "a3"]
    write_csv(folder / "logger.csv", record)
    said = okid("identify", folder / "logger.csv", status=2).stderr.strip()
    inputs, outputs = '"Hammer, left [N]"', r"Acc 1 [m/s^2],b'\''s [m/s^2],a3 [m/s^2]"
    assert said.endswith(f"; by their names perhaps --inputs '{inputs}' --outputs '{outputs}'"), said
    command = f"{PROGRAM} identify {folder}/logger.csv {said.split('perhaps ')[1]} --json - --quiet"
    done = subprocess.run(["sh", "-c", command], capture_output=True, text=True, timeout=1800)
    assert done.returncode == 0 and json.loads(done.stdout)["inputs"] == ["Hammer, left [N]"], done.stderr
    np.save(folder / "plain.npy", record.samples)
    assert okid("identify", folder / "plain.npy", status=2).stderr.strip().endswith("plain.npy has: c1, c2, c3, c4")


def test_what_cannot_be_read_is_said_of_the_file(folder: Path) -> None:
    (folder / "torn.mat").write_bytes(b"MATLAB 5.0 MAT-file" + bytes(200))
    said = okid("identify", folder / "torn.mat", *CHOSEN, status=2).stderr
    assert said.startswith(f"okid: {folder}/torn.mat: ") and len(said.splitlines()) == 1, said
    record = frame()
    record.fs_hz = None
    write_record(folder / "no_rate.mat", record)
    said = okid("identify", folder / "no_rate.mat", *CHOSEN, status=2).stderr
    assert said.startswith(f"okid: {folder}/no_rate.mat: no sample rate") and "samples.csv" not in said, said
    assert okid("identify", folder / "no_rate.mat", *CHOSEN, "--fs", "1000", status=0)
    said = okid("identify", folder / "missing.mat", *CHOSEN, status=2).stderr
    assert said == f"okid: {folder}/missing.mat: No such file or directory\n"
    assert list((folder / "temporary").iterdir()) == []


def test_a_name_is_no_option(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    write_record(folder / "--force.mat", frame())
    monkeypatch.chdir(folder)
    done = subprocess.run(
        [PROGRAM, "identify", *CHOSEN, "--json", "-", "--", "--force.mat"], capture_output=True, text=True, timeout=1800
    )
    assert done.returncode == 0, done.stderr


def test_without_the_python_package(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    write_record(folder / "frame.mat", frame())
    (folder / "bare").mkdir()
    shutil.copy(PROGRAM, folder / "bare" / "okid")
    (folder / "okid-convert").write_text("#!/bin/sh\ntouch ran\n")  # the folder one works in is not PATH
    (folder / "okid-convert").chmod(0o755)
    monkeypatch.chdir(folder)
    done = subprocess.run(
        [folder / "bare" / "okid", "identify", "frame.mat", *CHOSEN],
        capture_output=True, text=True, timeout=1800,
        env={**os.environ, "PATH": ".:" + os.defpath.removeprefix(":")},
    )  # fmt: skip
    assert done.returncode == 2 and not (folder / "ran").exists()
    assert done.stderr == (
        "okid: frame.mat: okid-convert, which reads this format, is neither beside okid nor in PATH: pip install okid\n"
    )


def test_many_files_into_a_folder(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for name in ("a", "b"):
        write_record(folder / f"{name}.mat", frame())
    many = [str(folder / "a.mat"), str(folder / "b.mat")]
    assert main([*many, f"{folder}/tables/"]) == 0
    assert sorted(path.name for path in (folder / "tables").iterdir()) == ["a.csv", "b.csv"]
    assert main([*many, f"{folder}/tables/", "--to", "h5"]) == 0
    assert (folder / "tables" / "b.h5").exists()
    capsys.readouterr()
    for arguments, reason in (
        ([*many, f"{folder}/tables/"], f"{folder}/tables/a.csv: is there already: give --force to replace it"),
        ([*many, f"{folder}/one.csv"], f"{folder}/one.csv: found 2 files for one OUT, expected a folder, as tables/"),
        (
            [many[0], many[0], f"{folder}/two/"],
            f"{folder}/two/a.csv: {many[0]} and {many[0]} would both be written there",
        ),
        ([many[0], f"{folder}/one.csv", "--to", "h5"], "--to h5 is for a folder OUT"),
    ):
        assert main(arguments) == 2
        assert reason in capsys.readouterr().err
    assert not (folder / "two").exists()
