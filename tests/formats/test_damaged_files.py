# SPDX-License-Identifier: MIT
"""Cut off, changed, empty, foreign: every file gives a record or one line that names it, and nothing is printed."""

from __future__ import annotations

import random
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import can
import okid
import pytest
import soundfile
from can_frames import plain_frames
from nptdms import ChannelObject, TdmsWriter
from okid.formats import read_hdf5, read_log, read_mat, read_mdf4, read_parquet, read_record, write_log, write_record
from okid.formats.by_name import EXTENSIONS, WRITTEN_EXTENSIONS
from okid.formats.can_log import LOG_EXTENSIONS
from okid.formats.logger_text import LOGGER_EXTENSIONS
from sample_records import full_record

FRAMES = [f"log{ending}" for ending in LOG_EXTENSIONS]
RECORDS = [f"record{ending}" for ending in EXTENSIONS]
WRITTEN = [f"record{ending}" for ending in WRITTEN_EXTENSIONS]


def reader(name: str) -> Callable[[Path], object]:
    return (lambda path: list(read_log(path))) if name in FRAMES else read_record


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("whole")
    for name in WRITTEN:
        write_record(folder / name, full_record(120))
    samples = full_record(120).samples[:, 1]
    for ending in ("wav", "flac"):
        soundfile.write(folder / f"record.{ending}", samples / 100.0, 1024, subtype="PCM_24")
    with TdmsWriter(folder / "record.tdms") as file:
        file.write_segment([ChannelObject("g", "a", samples, properties={"wf_increment": 1e-3})])
    table = "\n".join(f"{k / 1024:.6f}\t{value:.4f}" for k, value in enumerate(samples))
    for ending in LOGGER_EXTENSIONS:
        (folder / f"record{ending}").write_text(f"Operator\tA. B.\ntime [s]\tacc\n{table}\n")
    for name in FRAMES:
        write_log(folder / name, plain_frames(80))
    return folder


def damaged(data: bytes, dice: random.Random, kind: int) -> bytes:
    """Cut off, some bytes changed, or a piece missing."""
    if kind == 0:
        return data[: dice.randrange(1, len(data))]
    changed = bytearray(data)
    if kind == 1:
        for _ in range(dice.choice([1, 3, 20])):
            changed[dice.randrange(len(data))] = dice.randrange(256)
    else:
        first = dice.randrange(len(data))
        del changed[first : first + dice.randrange(1, 300)]
    return bytes(changed)


@pytest.mark.parametrize("name", RECORDS + FRAMES)
def test_damage_is_one_line(
    whole: Path, tmp_path: Path, name: str, capfd: pytest.CaptureFixture[str], caplog: pytest.LogCaptureFixture
) -> None:
    data, dice, refused = (whole / name).read_bytes(), random.Random(name), 0
    for k in range(30):
        path = tmp_path / name
        path.write_bytes(damaged(data, dice, k % 3))
        try:
            reader(name)(path)
        except okid.InputError as told:
            refused += 1
            assert str(told).startswith(str(path))
            assert "\n" not in str(told)
            assert len(str(told)) < 500 + len(str(path))
    assert refused > 0
    assert capfd.readouterr() == ("", "")
    assert caplog.records == []


@pytest.mark.parametrize("name", RECORDS + FRAMES)
def test_empty_absent_foreign_folder(tmp_path: Path, name: str) -> None:
    path = tmp_path / name
    with pytest.raises(okid.InputError, match="No such file or directory"):
        reader(name)(path)
    for content in (b"", b"PK\x03\x04 something else altogether\n" * 20, bytes(4096)):
        path.write_bytes(content)
        with pytest.raises(okid.InputError) as told:
            reader(name)(path)
        assert str(told.value).startswith(str(path))
        assert "\n" not in str(told.value)
    path.unlink()
    path.mkdir()
    with pytest.raises(okid.InputError, match=name):
        reader(name)(path)


@pytest.mark.parametrize(
    ("module", "package", "read"),
    [
        ("h5py", "h5py", read_hdf5),
        ("asammdf", "asammdf", read_mdf4),
        ("pyarrow.parquet", "pyarrow", read_parquet),
        ("h5py", "h5py", read_mat),
    ],
)
def test_a_missing_library_is_named_with_the_remedy(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, module: str, package: str, read: Callable[[Path], object]
) -> None:
    monkeypatch.setitem(sys.modules, module, None)
    path = tmp_path / "a.mat"
    path.write_bytes(b"\x89HDF\r\n\x1a\n" + bytes(600))
    words = rf"needs {package}, which is not installed: pip install '\./tools\[formats\]' in a checkout"
    with pytest.raises(okid.InputError, match=words):
        read(path)


@pytest.mark.parametrize("name", WRITTEN + FRAMES)
def test_what_cannot_be_written_leaves_nothing_behind(tmp_path: Path, name: str) -> None:
    def write(path: Path) -> None:
        _ = write_log(path, plain_frames(5)) if name in FRAMES else write_record(path, full_record(9))

    with pytest.raises(okid.InputError, match=f"nowhere/{name}: cannot be written: No such file or directory"):
        write(tmp_path / "nowhere" / name)
    (tmp_path / name / "kept").mkdir(parents=True)
    with pytest.raises(okid.InputError, match=f"{name}: cannot be written"):
        write(tmp_path / name)
    assert sorted(tmp_path.rglob("*")) == [tmp_path / name, tmp_path / name / "kept"]


def test_a_file_stays_what_it_was_when_writing_fails(tmp_path: Path) -> None:
    def frames() -> Iterator[can.Message]:
        yield from plain_frames(5)
        raise KeyboardInterrupt

    for name in FRAMES:
        write_log(tmp_path / name, plain_frames(9))
        before = (tmp_path / name).read_bytes()
        with pytest.raises(KeyboardInterrupt):
            write_log(tmp_path / name, frames())
        assert (tmp_path / name).read_bytes() == before
    assert sorted(path.name for path in tmp_path.iterdir()) == sorted(FRAMES)
