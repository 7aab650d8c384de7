# SPDX-License-Identifier: MIT
"""What a file asks for is compared with max_memory_mb before it is taken; what is compressed is counted as it grows."""

from __future__ import annotations

import io
import json
import struct
import sys
import zlib
from pathlib import Path
from typing import Any

import can
import numpy as np
import pytest
import soundfile
from measured_run import Measured, measured
from okid import InputError
from okid.campaign.sums_file import unpack
from okid.data.memory import DEFAULT_MB, VARIABLE, decompressed, load_npy, most_bytes
from okid.data.records import Record
from okid.formats import read_mat, read_mcap, read_mdf4, read_parquet, read_record, read_sound, write_log, write_mcap
from okid.live.config import PageConfig
from okid.live.session import Session

PEAK_MB = 900  # of Python with the libraries of a format


@pytest.fixture
def small(monkeypatch: pytest.MonkeyPatch) -> float:
    """A bound of 40 MB: 10 MB of samples."""
    monkeypatch.setenv(VARIABLE, "40")
    return 10e6


def convert(source: Path, target: Path) -> Measured:
    return measured("-m", "okid.formats.command", source, target, program=sys.executable, within_s=300)


def refused(done: Measured, *words: str) -> None:
    assert done.returncode == 2 and len(done.stderr.splitlines()) == 1, done
    assert all(word in done.stderr for word in words) and done.peak_mb < PEAK_MB, done


def sparse_mcap(path: Path, samples: tuple[int, ...], names: list[str]) -> None:
    from okid.formats.mcap_file import mcap_file

    with path.open("wb") as out:
        file = mcap_file(path, out, 0)
        file.describe(Record(names, np.zeros((1, len(names))), 1000.0).about())
        for number in samples:
            file.samples(number, [[0.0] * len(names)])
        file.close()


def test_mcap_with_two_samples_far_apart(tmp_path: Path) -> None:
    """1 kB took 5 GB and more."""
    sparse_mcap(tmp_path / "x.mcap", (0, 300_000_000), ["a"])
    refused(convert(tmp_path / "x.mcap", tmp_path / "x.csv"), "300000001 samples of 1 channels", "MB are read")


def test_mcap_with_100000_channels(tmp_path: Path) -> None:
    """It never ended: every name was compared with every other."""
    sparse_mcap(tmp_path / "x.mcap", (0,), [f"c{k}" for k in range(100_000)])
    assert read_mcap(tmp_path / "x.mcap").samples.shape == (1, 100_000)


@pytest.mark.parametrize("kind", ["zstd", "lz4"])
def test_mcap_bombs(tmp_path: Path, small: float, kind: str) -> None:
    """2.9 GB from 47 kB."""
    import lz4.frame
    import zstandard

    write_mcap(tmp_path / "x.mcap", Record(["a", "b"], np.ones((100, 2)), 100.0))
    assert len(read_mcap(tmp_path / "x.mcap").samples) == 100
    squeeze = zstandard.compress if kind == "zstd" else lz4.frame.compress
    bomb = squeeze(bytes(30_000_000))
    for stated in (30_000_000, 1000, 0):
        body = struct.pack("<QQQI", 0, 0, stated, 0) + struct.pack("<I", len(kind)) + kind.encode()
        body += struct.pack("<Q", len(bomb)) + bomb
        magic = b"\x89MCAP0\r\n"
        header = b"\x01" + struct.pack("<Q", 8) + bytes(8)
        (tmp_path / "b.mcap").write_bytes(magic + header + b"\x06" + struct.pack("<Q", len(body)) + body + magic)
        with pytest.raises(InputError, match="a chunk"):
            read_mcap(tmp_path / "b.mcap")


def container(data: bytes) -> bytes:
    """A BLF log with one container."""
    packed = zlib.compress(data, 9)
    size = 32 + len(packed)
    head = struct.pack("<4sL", b"LOGG", 144).ljust(144, b"\0")
    return head + struct.pack("<4sHHLL", b"LOBJ", 16, 1, size, 10) + struct.pack("<H6xL4x", 2, len(data)) + packed


def test_blf_bombs(tmp_path: Path) -> None:
    """3.0 GB from a few MB."""
    (tmp_path / "x.blf").write_bytes(container(bytes(200 << 20)))
    refused(convert(tmp_path / "x.blf", tmp_path / "x.log"), "x.blf", "is it a bomb?")
    (tmp_path / "x.blf").write_bytes(container(b"")[:144] + struct.pack("<4sHHLL", b"LOBJ", 16, 1, 3, 10) + bytes(64))
    refused(convert(tmp_path / "x.blf", tmp_path / "x.log"), "no whole object at byte 144")
    write_log(tmp_path / "good.blf", [can.Message(timestamp=k / 100, arbitration_id=1, data=b"a") for k in range(5000)])
    assert convert(tmp_path / "good.blf", tmp_path / "good.log").returncode == 0


def test_sums_of_a_campaign(small: float) -> None:
    """1.9 GB from 1.9 MB."""
    with pytest.raises(InputError, match="sums of a campaign grow beyond 10.0 MB"):
        unpack(zlib.compress(bytes(30_000_000), 9))


def test_other_compressed_files(tmp_path: Path, small: float) -> None:
    import pyarrow as arrow
    from pyarrow import parquet
    from scipy.io import savemat

    zeros = np.zeros(4_000_000)
    savemat(tmp_path / "x.mat", {"a": zeros}, do_compression=True)
    soundfile.write(tmp_path / "x.flac", zeros, 1000, subtype="PCM_16")
    parquet.write_table(arrow.table({"a": zeros}), tmp_path / "x.parquet")
    for reader, name in ((read_mat, "x.mat"), (read_sound, "x.flac"), (read_parquet, "x.parquet")):
        assert (tmp_path / name).stat().st_size < 500_000
        with pytest.raises(InputError, match="MB") as told:
            reader(tmp_path / name)
        assert "\n" not in str(told.value)


def test_mdf4_bombs(tmp_path: Path, small: float) -> None:
    from okid.formats import write_mdf4

    write_mdf4(tmp_path / "x.mf4", Record(["a"], np.zeros((4_000_000, 1)), 1000.0))
    with pytest.raises(InputError, match="MB are read"):
        read_mdf4(tmp_path / "x.mf4")
    data = bytearray((tmp_path / "x.mf4").read_bytes())
    at = data.find(b"##DZ")
    struct.pack_into("<Q", data, at + 24 + 8, 100)  # states 100 bytes
    (tmp_path / "y.mf4").write_bytes(data)
    with pytest.raises(InputError, match="states 100 bytes"):
        read_mdf4(tmp_path / "y.mf4")


def sparse_npy(path: Path, rows: int) -> None:
    with path.open("wb") as out:
        np.lib.format.write_array_header_1_0(out, {"descr": "<f8", "fortran_order": False, "shape": (rows, 1)})
        out.truncate(out.tell() + 8 * rows)


def test_sparse_arrays(tmp_path: Path) -> None:
    """3.2 GB that take no room on the disk were read whole."""
    sparse_npy(tmp_path / "x.npy", 400_000_000)
    done = measured("identify", tmp_path / "x.npy", "--outputs", "c1", "--fs", 100, within_s=120)
    refused(done, "x.npy: 400000000 samples of 1 channels take 3200 MB, at most 2048 MB are read")
    with pytest.raises(InputError, match="at most 2048 MB"), (tmp_path / "x.npy").open("rb") as file:
        load_npy(file, (tmp_path / "x.npy").stat().st_size)
    head = io.BytesIO()
    np.lib.format.write_array_header_1_0(head, {"descr": "<f8", "fortran_order": False, "shape": (2**40, 2)})
    size = head.tell()
    head.seek(0)
    with pytest.raises(InputError, match="holds 0 bytes of numbers"):
        load_npy(head, size)


def test_csv_of_a_record(tmp_path: Path, small: float) -> None:
    (tmp_path / "x.csv").write_text("# fs_hz: 100\na,b\n" + "1,2\n" * 700_000)
    done = measured("identify", tmp_path / "x.csv", "--outputs", "a,b", within_s=120)
    refused(done, "x.csv", "channels take", "at most 10 MB are read", VARIABLE)


def test_the_bound_itself(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv(VARIABLE, raising=False)
    assert most_bytes() == DEFAULT_MB * 1e6 / 4
    for wrong in ("x", "0", "-1", "inf", "nan", "2e6"):
        monkeypatch.setenv(VARIABLE, wrong)
        with pytest.raises(InputError, match=f"{VARIABLE} is '{wrong}', expected"):
            most_bytes()
    assert decompressed(zlib.compress(b"x" * 3_000_000), 3_000_000) == b"x" * 3_000_000
    with pytest.raises(zlib.error):
        decompressed(zlib.compress(b"x" * 3_000_000)[:-3], 4_000_000)


def page(folder: Path) -> Session:
    return Session(PageConfig(path=folder / "c.toml", socket=folder / "s", samples=True, title=""))


def start(forces: int, responses: int, rate: float = 1000.0) -> bytes:
    roles = ["force"] * forces + ["acceleration"] * responses
    channels: list[dict[str, Any]] = [{"name": f"c{k}", "role": role, "unit": ""} for k, role in enumerate(roles)]
    return json.dumps({"type": "start", "t": 0, "rate_hz": rate, "channels": channels}).encode()


@pytest.mark.parametrize(("forces", "responses"), [(600, 600), (128, 128), (1, 8), (100_000, 0)])
def test_the_start_event_of_a_page(tmp_path: Path, forces: int, responses: int) -> None:
    """600 forces and 600 responses asked for 1.6 TiB and ended the thread that reads; 128 and 128 took 17 GB."""
    session = page(tmp_path)
    session.line(start(forces, responses))
    if forces > 4096:
        assert session.faults == 1 and session.measured is None
    else:
        assert session.faults == 0 and session.measured is not None
        sums = session.measured.averages
        assert sum(a.nbytes for a in vars(sums).values() if isinstance(a, np.ndarray)) < 400e6
        values = np.zeros((forces + responses, 4096)).tolist()
        session.line(json.dumps({"type": "samples", "t": 1, "first": 0, "values": values}).encode())
        assert (sums.response(0, 0) is None) == (forces > 100)
    session.line(start(1, 2))
    assert session.measured is not None and session.measured.n_y == 2


def test_readers_by_name_keep_it(tmp_path: Path, small: float) -> None:
    sparse_mcap(tmp_path / "x.mcap", (0, 2_000_000), ["a"])
    with pytest.raises(InputError, match="2000001 samples"):
        read_record(tmp_path / "x.mcap")
