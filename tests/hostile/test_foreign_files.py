# SPDX-License-Identifier: MIT
"""Files of other programs that lead to other files, run for ever or are no log: refused in one line."""

from __future__ import annotations

import sqlite3
import struct
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
from measured_run import Measured, measured
from okid import InputError, read_frf
from okid.data.records import Record
from okid.formats import read_hdf5, read_log, read_mat, read_mdf4, write_record
from okid.formats.mdf4_blocks import check_mdf4

SECRET = b"root:x:0:0:somebody's own file:/root:/bin/sh\n" * 8


@pytest.fixture
def secret(tmp_path: Path) -> Path:
    path = tmp_path / "secret"
    path.write_bytes(SECRET)
    return path


def convert(source: Path, target: Path) -> Measured:
    return measured("-m", "okid.formats.command", source, target, program=sys.executable, within_s=120)


def refused(source: Path, target: Path, *words: str) -> None:
    done = convert(source, target)
    assert done.returncode == 2 and not target.exists(), done
    assert len(done.stderr.splitlines()) == 1 and all(word in done.stderr for word in words), done.stderr


def external(file: Any, path: str) -> None:
    file.create_dataset("a", (128,), "u1", external=[(path, 0, 128)])


def linked(file: Any, path: str) -> None:
    file["a"] = h5py.ExternalLink(path, "/x")


def deep(file: Any, path: str) -> None:
    linked(file.create_group("one/two/three"), path)
    file["b"] = np.arange(10.0)


def virtual(file: Any, path: str) -> None:
    layout = h5py.VirtualLayout((10,), "f8")
    layout[:] = h5py.VirtualSource(path, "x", (10,))
    file.create_virtual_dataset("a", layout)


def through_a_soft_link(file: Any, path: str) -> None:
    external(file, path)
    file["samples"] = h5py.SoftLink("/a")


WAYS = [(external, "another file"), (linked, "a link into another file"), (deep, "/one/two/three/a is a link"),
        (virtual, "a virtual dataset"), (through_a_soft_link, "another file")]  # fmt: skip


@pytest.mark.parametrize(("make", "words"), WAYS)
def test_hdf5_reads_no_other_file(secret: Path, tmp_path: Path, make: Callable[[Any, str], None], words: str) -> None:
    """okid-convert x.h5 showed /etc/passwd as samples."""
    for name in ("x.h5", "x.mat"):
        with h5py.File(tmp_path / name, "w", userblock_size=512 if name == "x.mat" else 0) as file:
            make(file, str(secret))
    refused(tmp_path / "x.h5", tmp_path / "x.csv", "x.h5", words)
    for reader, name in ((read_hdf5, "x.h5"), (read_mat, "x.mat")):
        with pytest.raises(InputError, match="refused"):
            reader(tmp_path / name)
    with h5py.File(tmp_path / "f.h5", "w") as file:
        file["frequency_hz"] = np.arange(4.0)
        make(file, "/dev/zero")
    with pytest.raises(InputError, match="refused"):
        read_frf(tmp_path / "f.h5")


def test_hdf5_that_asks_for_memory(tmp_path: Path) -> None:
    for shape, options in (((2**33,), {}), ((4, 2**30), {"chunks": (1, 2**29)}), ((2**30,), {"compression": "gzip"})):
        with h5py.File(tmp_path / "x.h5", "w") as file:
            file.create_dataset("a", shape, "f8", **options)
        refused(tmp_path / "x.h5", tmp_path / "x.csv", "x.h5", "MB are read")
    with h5py.File(tmp_path / "ring.h5", "w") as file:
        file["a"] = np.arange(32.0)
        file["g/self"] = file["/"]  # hard links in a ring
    assert read_hdf5(tmp_path / "ring.h5").samples.shape == (32, 1)


TABLE = "CREATE TABLE messages (ts REAL, arbitration_id INTEGER, extended INTEGER, remote INTEGER, error INTEGER, "
ENDLESS = (
    "CREATE VIEW messages AS WITH RECURSIVE r(ts) AS (SELECT 0.0 UNION ALL SELECT ts + 1 FROM r) "
    "SELECT ts, 1 AS arbitration_id, 0 AS extended, 0 AS remote, 0 AS error, 1 AS dlc, x'00' AS data FROM r"
)


def base(path: Path, *statements: str) -> Path:
    path.unlink(missing_ok=True)
    file = sqlite3.connect(path)
    for statement in statements:
        file.execute(statement)
    file.commit()
    file.close()
    return path


def test_sqlite_views_and_programs(tmp_path: Path) -> None:
    """A view over an endless recursion filled the disk."""
    path = tmp_path / "x.db"
    refused(base(path, ENDLESS), tmp_path / "x.log", "messages is a view")
    generated = TABLE + "dlc INTEGER, data BLOB AS (zeroblob(900000000)))"
    refused(base(path, generated), tmp_path / "x.log", "of messages is computed")
    refused(base(path, "CREATE VIRTUAL TABLE messages USING fts5(ts)"), tmp_path / "x.log", "of something else")
    refused(base(path, "CREATE TABLE other (a)"), tmp_path / "x.log", "no table messages")


FRAMES = [
    ("1.0, 0x10000000000, 0, 0, 0, 1, x'61'", "identifier 10000000000"),
    ("1.0, 0x800, 0, 0, 0, 1, x'61'", "identifier 800, expected 0 to 7FF"),
    ("1.0, -1, 1, 0, 0, 1, x'61'", "identifier"),
    ("9e999, 1, 0, 0, 0, 1, x'61'", "the time inf"),
    ("-1.0, 1, 0, 0, 0, 1, x'61'", "the time -1.0"),
    ("1e300, 1, 0, 0, 0, 1, x'61'", "the time 1e+300"),
    ("NULL, 1, 0, 0, 0, 1, x'61'", "ts is 'None'"),
    ("'now', 1, 0, 0, 0, 1, x'61'", "ts is 'now'"),
    ("1.0, 1, 0, 0, 0, 1, 'text'", "data is 'text'"),
    ("1.0, 1, 0, 0, 0, 3, x'61'", "1 of 3 bytes"),
    ("1.0, 1, 0, 0, 0, -3, x'61'", "-3 bytes"),
    ("1.0, 1, 0, 0, 0, 200, zeroblob(200)", "at most 64"),
]


@pytest.mark.parametrize(("values", "words"), FRAMES)
def test_sqlite_frames_are_checked(tmp_path: Path, values: str, words: str) -> None:
    """Identifiers, times and lengths that are none came out with exit 0."""
    path = base(tmp_path / "x.db", TABLE + "dlc INTEGER, data BLOB)", f"INSERT INTO messages VALUES ({values})")
    with pytest.raises(InputError) as told:
        list(read_log(path))
    assert words in str(told.value) and "\n" not in str(told.value)


def blocks(*given: tuple[bytes, list[int], bytes]) -> bytes:
    """An MDF 4 file of blocks (id, links as numbers of blocks or -1, data), the first one at byte 64."""
    places, at = [], 64
    for _, links, data in given:
        places.append(at)
        at += 24 + 8 * len(links) + len(data)
        at += -at % 8
    out = bytearray(b"MDF     4.10    okid".ljust(64, b"\0"))
    struct.pack_into("<H", out, 28, 410)
    for (name, links, data), place in zip(given, places, strict=True):
        out += bytes(place - len(out))
        to = [0 if k < 0 else places[k] for k in links]
        out += struct.pack("<4s4xQQ", name, 24 + 8 * len(to) + len(data), len(to))
        out += struct.pack(f"<{len(to)}Q", *to) + data
    return bytes(out)


HEADER = (b"##HD", [1, -1, -1, -1, -1, -1], bytes(32))
RINGS = {
    "a data group": [HEADER, (b"##DG", [1, -1, -1, -1], bytes(8))],
    "two data groups": [HEADER, (b"##DG", [2, -1, -1, -1], bytes(8)), (b"##DG", [1, -1, -1, -1], bytes(8))],
    "a channel group": [HEADER, (b"##DG", [-1, 2, -1, -1], bytes(8)), (b"##CG", [2, -1, -1, -1, -1, -1], bytes(32))],
    "a channel": [
        HEADER, (b"##DG", [-1, 2, -1, -1], bytes(8)), (b"##CG", [-1, 3, -1, -1, -1, -1], bytes(32)),
        (b"##CN", [3, -1, -1, -1, -1, -1, -1, -1], bytes(72)),
    ],
    "a composition": [
        HEADER, (b"##DG", [-1, 2, -1, -1], bytes(8)), (b"##CG", [-1, 3, -1, -1, -1, -1], bytes(32)),
        (b"##CN", [-1, 3, -1, -1, -1, -1, -1, -1], bytes(72)),
    ],
    "a list of data": [HEADER, (b"##DG", [-1, -1, 2, -1], bytes(8)), (b"##DL", [2, -1], bytes(24))],
}  # fmt: skip


@pytest.mark.parametrize("what", list(RINGS))
def test_mdf4_links_that_form_a_ring(tmp_path: Path, what: str) -> None:
    path = tmp_path / "x.mf4"
    path.write_bytes(blocks(*RINGS[what]))
    for target in ("x.csv", "x.log"):
        refused(path, tmp_path / target, "x.mf4", "form a ring")


def test_mdf4_that_is_whole(tmp_path: Path) -> None:
    write_record(tmp_path / "x.mf4", Record(["a", "b"], np.ones((100, 2)), 100.0))
    check_mdf4(tmp_path / "x.mf4")
    assert len(read_mdf4(tmp_path / "x.mf4").samples) == 100
    (tmp_path / "3.mf4").write_bytes(b"MDF     3.30    ".ljust(200, b"\0"))
    with pytest.raises(InputError, match="expected MDF and version 4"):
        read_mdf4(tmp_path / "3.mf4")


@pytest.mark.parametrize("ending", [".h5", ".db", ".mf4", ".mcap", ".blf"])
def test_devices_stay_refused(tmp_path: Path, ending: str) -> None:
    (tmp_path / f"x{ending}").symlink_to("/dev/zero")
    target = tmp_path / ("x.log" if ending in (".db", ".blf") else "x.csv")
    refused(tmp_path / f"x{ending}", target, "device or a named pipe")
