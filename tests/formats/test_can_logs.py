# SPDX-License-Identifier: MIT
"""Logs of CAN frames: written by us and read by python-can, written by python-can and read by us."""

from __future__ import annotations

from pathlib import Path

import can
import okid
import pytest
from can_frames import assert_equal_frames, empty_fd, plain_frames, special_frames
from okid.formats import convert_log, read_log, read_mdf4, write_log

ENDINGS = ["log", "asc", "blf", "trc", "db", "mf4", "csv"]


def by_python_can(path: Path, frames: list[can.Message]) -> Path:
    with can.Logger(str(path)) as writer:
        for frame in frames:
            writer.on_message_received(frame)
    return path


def seen_by_python_can(path: Path) -> list[can.Message]:
    options = {"relative_timestamp": False} if path.suffix == ".asc" else {}
    with can.LogReader(path, **options) as reader:
        return list(reader)


@pytest.mark.parametrize("ending", ENDINGS)
def test_python_can_reads_what_we_write(tmp_path: Path, ending: str) -> None:
    write_log(tmp_path / f"a.{ending}", plain_frames())
    assert_equal_frames(seen_by_python_can(tmp_path / f"a.{ending}"), plain_frames(), buses=False)


@pytest.mark.parametrize("ending", ENDINGS)
def test_we_read_what_python_can_writes(tmp_path: Path, ending: str) -> None:
    path = by_python_can(tmp_path / f"a.{ending}", plain_frames())
    assert_equal_frames(list(read_log(path)), plain_frames(), buses=ending not in ("db", "csv"))


@pytest.mark.parametrize("ending", ["log", "blf", "mf4"])
def test_every_kind_of_frame_comes_back(tmp_path: Path, ending: str) -> None:
    frames = [*plain_frames(20), *special_frames(), empty_fd()]
    write_log(tmp_path / f"a.{ending}", frames)
    assert_equal_frames(list(read_log(tmp_path / f"a.{ending}")), frames)
    if ending != "log":  # python-can's reader of candump logs does not know candump's error frames
        assert_equal_frames(seen_by_python_can(tmp_path / f"a.{ending}"), frames, buses=False)


@pytest.mark.parametrize(
    ("ending", "frame", "words"),
    [
        ("asc", empty_fd(), "frame 6 at 1700000003.000000 s is a CAN FD frame without data"),
        ("csv", special_frames()[2], "frame 6 .* is a CAN FD frame"),
        ("db", special_frames()[3], "is a CAN FD frame"),
        ("trc", special_frames()[3], "is a CAN FD frame"),
        ("trc", special_frames()[0], "is a remote frame"),
        ("trc", special_frames()[5], "is an error frame, which .trc does not hold .* choose .log, .blf or .mf4"),
    ],
)
def test_frames_a_format_would_drop_are_refused(tmp_path: Path, ending: str, frame: can.Message, words: str) -> None:
    with pytest.raises(okid.InputError, match=words):
        write_log(tmp_path / f"a.{ending}", [*plain_frames(5), frame])
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("ending", ENDINGS[1:])
def test_there_and_back_is_the_same_log(tmp_path: Path, ending: str) -> None:
    frames = plain_frames() + ([] if ending in ("trc", "db", "csv") else special_frames()[:5])
    write_log(tmp_path / "a.log", frames)
    summary = convert_log(tmp_path / "a.log", tmp_path / f"b.{ending}")
    convert_log(tmp_path / f"b.{ending}", tmp_path / "c.log")
    assert (summary.frames, summary.errors) == (len(frames), 0)
    before, after = ((tmp_path / name).read_text() for name in ("a.log", "c.log"))
    assert summary.buses == {"can0": sum(" can0 " in line for line in before.splitlines()), "can1": 30}
    if ending in ("db", "csv"):
        assert summary.remarks == ["the interface names are not kept"]
        before = before.replace(" can1 ", " can0 ")
    else:
        assert summary.remarks == []
    assert after == before


def test_what_changes_is_said(tmp_path: Path) -> None:
    frames = [*plain_frames(3), special_frames()[5]]
    frames[0].channel = "vcan1"
    write_log(tmp_path / "a.log", frames)
    remarks = convert_log(tmp_path / "a.log", tmp_path / "b.asc").remarks
    assert remarks == [
        "of the interface names only the numbers are kept: vcan1 reads back as can1",
        "identifier and data of 1 error frames are not kept",
    ]


def test_lines_python_can_skips_are_counted(tmp_path: Path) -> None:
    by_python_can(tmp_path / "a.trc", plain_frames(9))
    text = (tmp_path / "a.trc").read_text()
    (tmp_path / "a.trc").write_text(text + "garbage\n")
    remarks: list[str] = []
    assert len(list(read_log(tmp_path / "a.trc", remarks))) == 9
    assert len(remarks) == 1
    assert "1 line was not understood and left out" in remarks[0]


def test_all_frames_reach_a_large_database(tmp_path: Path) -> None:
    write_log(tmp_path / "a.log", plain_frames(3000))
    assert convert_log(tmp_path / "a.log", tmp_path / "a.db").frames == 3000
    assert len(seen_by_python_can(tmp_path / "a.db")) == 3000


@pytest.mark.parametrize(
    ("line", "words"),
    [
        ("(1.0) can0 100#0", "a.log:2: found '.1.0. can0 100#0', expected .seconds. interface ID#data"),
        ("(1.0) can0 1000#00", "a.log:2: found"),
        ("1.0 can0 100#00", "a.log:2: found"),
        ("(1.0) can0 100#000000000000000000", "a.log:2: found"),
    ],
)
def test_bad_lines_are_named(tmp_path: Path, line: str, words: str) -> None:
    (tmp_path / "a.log").write_text(f"(0.5) can0 100#00\n{line}\n")
    with pytest.raises(okid.InputError, match=words):
        list(read_log(tmp_path / "a.log"))


def test_a_bus_log_is_no_record(tmp_path: Path) -> None:
    write_log(tmp_path / "a.mf4", plain_frames(5))
    with pytest.raises(okid.InputError, match="a.mf4: holds CAN frames, not samples: .*okid-convert IN.mf4 OUT.log"):
        read_mdf4(tmp_path / "a.mf4")


def test_wrong_table_and_wrong_extension(tmp_path: Path) -> None:
    (tmp_path / "a.csv").write_text("a,b\n1,2\n")
    with pytest.raises(okid.InputError, match="a.csv: is no table of frames of python-can"):
        list(read_log(tmp_path / "a.csv"))
    with pytest.raises(okid.InputError, match="a.xyz: the extension is '.xyz', expected one of .log, .asc"):
        list(read_log(tmp_path / "a.xyz"))
