# SPDX-License-Identifier: MIT
"""Fuzz the readers that live in Python: MCAP, HDF5, SQLite, SPEC.toml, results. Input N of a reader is always the same.

usage: python_readers.py [--runs N] [--first K] [--found FOLDER] [READER ..]   default: 1000 inputs of every reader
An input is taken, or refused by okid's own error in one line of bounded length that names the file; anything else is
left in FOLDER and named.
"""

from __future__ import annotations

import argparse
import copy
import functools
import io
import json
import math
import random
import re
import resource
import sqlite3
import sys
import tempfile
import traceback
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import h5py
import numpy as np
import okid
from mcap.writer import CompressionType, Writer
from okid import Error
from okid.campaign.spec import load_spec
from okid.data.records import Record
from okid.formats import read_frf, read_hdf5, read_log, read_mcap, write_hdf5
from okid.formats.hdf5 import read_hdf5_result
from okid.result.result_file import read_result

LONGEST = 2500  # letters of a refusal, beside the path
MEMORY = 3 << 30  # bytes of the whole process
NUMBERS = (0, 1, -1, 2**31 - 1, -(2**31), 2**32 - 1, 2**53, 2**63 - 1, 2**64 - 1, -(2**63), 2**70)
REALS = (0.0, -0.0, 1e-320, 1e308, -1e308, math.nan, math.inf, -math.inf, 0.1)
TEXTS = (
    "",
    " ",
    "a",
    "\x1b[31m",
    "a\nb",
    "\0",
    "\u202e",
    "1e999",
    "NaN",
    "../../x",
    "2026-11-21T12:00:00Z",
    "\u00e9" * 300,
)
SPEC = """[campaign]
title = "bridge"
structure = "b"
[records]
files = ["*.npy", "s3://bucket/*.npy"]
name = '(?P<structure>[a-z]+)_(?P<time>[0-9T]+)'
time_format = "%Y%m%dT%H%M%S"
storage = { anon = true }
[channels]
inputs = ["f"]
outputs = ["a", "b"]
columns = ["f", "a", "b", "t"]
fs_hz = 100.0
codes = 16
scale = [1e-3]
offset = [0.0, 1.0, 2.0]
[identification]
method = "okid-era"
p = 20
order = 6
sigma_blocks = 10
[group]
by = ["structure", "day"]
[temperature]
channel = "t"
[trend]
training_until = "2026-11-21"
[output]
folder = "out"
batch_mb = 10
[cluster]
workers = 2
memory_mb = 500
"""


class Reader(NamedTuple):
    """`make(dice, path)` leaves an input there, `read(path)` takes it or raises okid.Error."""

    ending: str
    make: Callable[[random.Random, Path], None]
    read: Callable[[Path], object]


def odd(dice: random.Random, depth: int = 0) -> Any:
    """A value that JSON can hold, or nearly."""
    kind = dice.randrange(8 if depth < 3 else 5)
    if kind < 5:
        return (None, dice.random() < 0.5, dice.choice(NUMBERS), dice.choice(REALS), dice.choice(TEXTS))[kind]
    if kind == 5:
        return {dice.choice(TEXTS): odd(dice, depth + 1) for _ in range(dice.randrange(3))}
    return [odd(dice, depth + 1) for _ in range(dice.randrange(4))] * dice.choice((1, 1, 1, 200))


def places(value: Any, path: tuple[Any, ...] = ()) -> list[tuple[Any, ...]]:
    """Where something stands in it: keys and numbers from the top."""
    inner = value.items() if isinstance(value, dict) else enumerate(value[:3]) if isinstance(value, list) else ()
    return [path, *(place for key, each in inner for place in places(each, (*path, key)))]


def changed(value: Any, dice: random.Random) -> Any:
    """One to three places of it hold something else, or nothing at all."""
    out = copy.deepcopy(value)
    for _ in range(dice.randrange(1, 4)):
        known = places(out)[1:]
        if not known:
            return odd(dice)
        place = dice.choice(known)
        holder = out
        for key in place[:-1]:
            holder = holder[key]
        kind = dice.randrange(4)
        if kind == 0:
            del holder[place[-1]]
        elif kind == 1 and isinstance(holder, list):
            holder.append(copy.deepcopy(holder[place[-1]]))
        else:
            holder[place[-1]] = odd(dice)
    return out


def damaged(whole: bytes, dice: random.Random) -> bytes:
    """Bytes changed, a number of 4 or 8 bytes replaced, a piece missing, doubled, moved or cut off."""
    data = bytearray(whole)
    for _ in range(dice.choice((1, 1, 2, 5, 20))):
        at = dice.randrange(max(1, len(data)))
        piece = data[at : at + dice.choice((1, 4, 16, 100))]
        kind = dice.randrange(6)
        if kind == 0:
            data[at : at + 1] = bytes([dice.randrange(256)])
        elif kind == 1:
            width = dice.choice((2, 4, 8))
            data[at : at + width] = (dice.choice(NUMBERS) % 256**width).to_bytes(width, dice.choice(("little", "big")))
        elif kind == 2:
            del data[at : at + len(piece)]
        elif kind == 3:
            data[at:at] = piece * dice.choice((1, 3))
        elif kind == 4:
            to = dice.randrange(max(1, len(data)))
            data[to : to + len(piece)] = piece
        elif dice.random() < 0.2:
            del data[at:]
    return bytes(data)


@functools.cache
def record() -> Record:
    """A small one with a gap."""
    samples = np.arange(60.0).reshape(20, 3) / 7
    samples[3, 1] = np.nan
    return Record(
        ["f", "a", "b"], samples, 100.0, ["N", "g", ""], title="t", roles=["force", "acceleration", None],
        dofs=[1, 2, None], notes={"operator": "x"},
    )  # fmt: skip


@functools.cache
def result() -> dict[str, Any]:
    """What a method finds in a small record."""
    u, y = okid.demo_record()
    found = okid.identify(u[:1000], y[:1000], fs=1000.0, method="okid-era", p=8, order=4).to_dict()
    return dict(json.loads(json.dumps(found)))


def mcap_bytes(about: Any, rows: list[Any], packing: CompressionType) -> bytes:
    """As okid.formats.write_mcap() lays a record out."""
    out = io.BytesIO()
    writer = Writer(out, chunk_size=400, compression=packing)
    writer.start()
    writer.add_metadata("okid.record/1", {"json": json.dumps(about)})
    schema = writer.register_schema("signals", "jsonschema", b"{}")
    channel = writer.register_channel("/signals", "json", schema)
    for k, row in enumerate(rows):
        writer.add_message(channel, log_time=k, data=json.dumps(row).encode(), publish_time=k)
    writer.finish()
    return out.getvalue()


def make_mcap(dice: random.Random, path: Path) -> None:
    about, names = record().about(), record().names
    rows = [{"sample": k, **dict(zip(names, row, strict=True))} for k, row in enumerate(record().samples.tolist())]
    rows = [{k: None if v != v else v for k, v in row.items()} for row in rows]
    packing = dice.choice((CompressionType.NONE, CompressionType.ZSTD, CompressionType.LZ4))
    kind = dice.randrange(4)
    if kind == 0:
        about = changed(about, dice)
    elif kind == 1:
        rows = changed(rows, dice)
        rows = rows if isinstance(rows, list) else [rows]
    data = mcap_bytes(about, rows, packing)
    path.write_bytes(data if kind < 2 else damaged(data, dice))


def attribute(dice: random.Random) -> Any:
    """What HDF5 can keep beside a dataset."""
    kind = dice.randrange(9)
    if kind == 0:
        return h5py.Empty(dice.choice(("f8", "S3", "i4")))
    if kind == 1:
        return np.array([dice.choice(REALS) for _ in range(dice.randrange(4))])
    if kind == 2:
        return np.array([dice.choice(TEXTS).replace("\0", "") for _ in range(dice.randrange(1, 4))], dtype=object)
    if kind == 3:
        return np.bytes_(dice.randbytes(dice.randrange(9)))
    if kind == 4:
        return np.zeros(dice.choice(((), (1,), (2, 3))), dtype=[("a", "f8"), ("b", "i4")])
    if kind == 5:
        return dice.choice(NUMBERS[:8])
    if kind == 6:
        return dice.choice(REALS)
    if kind == 7:
        return np.array([True, False])[: dice.randrange(3)]
    return dice.choice(TEXTS).replace("\0", "")


def put(attrs: Any, key: str, value: Any) -> None:
    """An attribute; as text of any length where it is texts."""
    if isinstance(value, np.ndarray) and value.dtype == object:
        attrs.create(key, value, dtype=h5py.string_dtype())
    else:
        attrs[key] = value


@functools.cache
def hdf5_seeds() -> tuple[bytes, ...]:
    """A record, a result, frequency responses, and a file of another program."""
    with tempfile.TemporaryDirectory() as folder:
        own, found, responses, other = (Path(folder) / f"{name}.h5" for name in "abcd")
        write_hdf5(own, record())
        write_hdf5(found, result())
        with h5py.File(responses, "w") as file:
            file["frequency_hz"], file["response"] = np.arange(1.0, 9.0), np.ones((8, 2, 1), dtype=complex)
            file.attrs["inputs"], file.attrs["outputs"] = ["f"], ["a", "b"]
        with h5py.File(other, "w") as file:
            for name in ("a", "b"):
                file[f"run/{name}"] = np.arange(20.0)
                file[f"run/{name}"].attrs["unit"] = "g"
            file["run"].attrs["fs"] = 50.0
        return tuple(one.read_bytes() for one in (own, found, responses, other))


def make_hdf5(dice: random.Random, path: Path) -> None:
    path.write_bytes(dice.choice(hdf5_seeds()))
    with h5py.File(path, "r+") as file:
        objects = [file]
        file.visititems(lambda _, item: objects.append(item))
        for _ in range(dice.randrange(1, 4)):
            item = dice.choice(objects)
            keys = [*item.attrs, "fs", "dt", "unit", "schema", "names", "start_time", "sample_rate", "inputs"]
            key = dice.choice(keys)
            if dice.random() < 0.2 and key in item.attrs:
                del item.attrs[key]
            else:
                put(item.attrs, key, attribute(dice))
        if dice.random() < 0.3:
            name = dice.choice(("samples", "frequency_hz", "response", "json", "run/a", "notes", "t"))
            if name in file:
                del file[name]
            value = attribute(dice)
            if isinstance(value, np.ndarray) and value.dtype == object:
                file.create_dataset(name, data=value, dtype=h5py.string_dtype())
            else:
                file[name] = value


def read_any_hdf5(path: Path) -> None:
    """Every reader of HDF5; refused when all of them refuse."""
    refused: list[Error] = []
    for read in (read_hdf5, read_hdf5_result, read_frf):
        try:
            read(path)
        except Error as told:
            expect_one_line(told, path)
            refused.append(told)
    if len(refused) == 3:
        raise refused[0]


TABLE = (
    "CREATE TABLE messages (ts REAL, arbitration_id INTEGER, extended INTEGER, remote INTEGER, error INTEGER, "
    "dlc INTEGER, data BLOB)"
)


def make_sqlite(dice: random.Random, path: Path) -> None:
    path.unlink(missing_ok=True)
    file = sqlite3.connect(path)
    statement = TABLE
    if dice.random() < 0.15:
        word = dice.choice(("TABLE", "REAL", "INTEGER", "BLOB", "messages", "dlc", ")"))
        instead = dice.choice(("", "TEXT", "x", "NUMERIC", "PRIMARY KEY", "data AS (ts)", ") WITHOUT ROWID", "-1"))
        statement = TABLE.replace(word, instead, 1)
    rows: list[list[Any]] = [[1.0 + 0.01 * k, 0x100 + k, 0, 0, 0, 2, b"ab"] for k in range(5)]
    if dice.random() < 0.6:
        for _ in range(dice.randrange(1, 3)):
            value = dice.choice(
                (None, dice.choice(NUMBERS[:8]), dice.choice(REALS), dice.choice(TEXTS), dice.randbytes(70))
            )
            rows[dice.randrange(5)][dice.randrange(7)] = value
    try:
        file.execute(statement)
        file.executemany("INSERT INTO messages VALUES (?, ?, ?, ?, ?, ?, ?)", rows)
    except (sqlite3.Error, OverflowError):
        pass  # what the library itself refuses to write
    file.commit()
    file.close()
    if dice.random() < 0.5:
        path.write_bytes(damaged(path.read_bytes(), dice))


def toml(value: Any) -> str:
    """A value as TOML."""
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, dict):
        return "{ " + ", ".join(f"{json.dumps(k)} = {toml(v)}" for k, v in value.items()) + " }"
    if isinstance(value, list):
        return "[" + ", ".join(map(toml, value)) + "]"
    return "2026-01-01" if value is None else json.dumps(value) if isinstance(value, str) else repr(value)


def make_spec(dice: random.Random, path: Path) -> None:
    lines = SPEC.splitlines()
    for _ in range(dice.randrange(1, 4)):
        at = dice.randrange(len(lines))
        key, equals, _ = lines[at].partition(" = ")
        kind = dice.randrange(5)
        if kind == 0:
            del lines[at]
        elif kind == 1:
            lines.insert(dice.randrange(len(lines)), lines[at])
        elif equals and kind < 4:
            lines[at] = f"{key} = {toml(odd(dice))}"
        else:
            lines[at] = dice.choice((
                'method = "auto"', 'refine = "yes"', "band = [1.0, 2.0]", 'by = ["record"]', "decimate = 3",
                "pieces = 9", 'files = ["simplecache::http://h/*.npy"]', 'index = "none.csv"', 'time = "index"', "[x]",
                'name = "("',
            ))  # fmt: skip
    data = "\n".join(lines).encode("utf-8", "surrogatepass")
    path.write_bytes(damaged(data, dice) if dice.random() < 0.3 else data)


def make_result(dice: random.Random, path: Path) -> None:
    value = changed(result(), dice)
    data = json.dumps(value).encode("utf-8", "surrogatepass")
    path.write_bytes(damaged(data, dice) if dice.random() < 0.3 else data)


def read_whole_result(path: Path) -> None:
    """What is taken can be asked for, shown and given away."""
    raw = read_result(path)
    try:
        found = okid.Result.from_dict(raw)
        found.table()
    except Error as told:  # of an object, which has no file
        raise okid.InputError(f"{path}: {told}") from None
    repr(found), found.confident_modes
    json.dumps(found.to_dict())


READERS = {
    "mcap": Reader(".mcap", make_mcap, read_mcap),
    "hdf5": Reader(".h5", make_hdf5, read_any_hdf5),
    "sqlite": Reader(".db", make_sqlite, lambda path: list(read_log(path))),
    "spec": Reader(".toml", make_spec, lambda path: load_spec(path).sums_key),
    "result": Reader(".json", make_result, read_whole_result),
}


def expect_one_line(told: Error, path: Path) -> None:
    """The refusal as a user reads it."""
    text = str(told)
    assert "\n" not in text and len(text) < LONGEST + len(str(path)), text[:300]
    assert path.name in text, text[:300]
    assert not re.search("[\x00-\x08\x0b-\x1f\x7f]", text), text[:300]


def attempt(name: str, number: int, folder: Path) -> bool:
    """Is input `number` of the reader taken? Raises what is neither that nor a refusal as it should be."""
    reader = READERS[name]
    path = folder / f"{name}{reader.ending}"
    reader.make(random.Random(f"{name} {number}"), path)
    try:
        reader.read(path)
    except Error as told:
        expect_one_line(told, path)
        return False
    return True


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--runs", type=int, default=1000)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--found", type=Path, default=Path("build-fuzz/found"))
    parser.add_argument("readers", nargs="*", choices=[*READERS, []], default=[])
    given = parser.parse_args()
    resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY))
    wrong = 0
    with tempfile.TemporaryDirectory() as folder:
        for name in given.readers or READERS:
            taken, last = 0, given.first + given.runs
            for number in range(given.first, last):
                try:
                    taken += attempt(name, number, Path(folder))
                except Exception as fault:
                    wrong += 1
                    given.found.mkdir(parents=True, exist_ok=True)
                    path = given.found / f"{name}-{number}{READERS[name].ending}"
                    path.write_bytes((Path(folder) / f"{name}{READERS[name].ending}").read_bytes())
                    print(f"python {name:11} FAILED: {path}, again by --first {number} --runs 1 {name}:")
                    print("".join(traceback.format_exception(fault)[-3:]))
                    break
            else:
                print(f"python {name:11} {given.runs} executions ({taken} taken), nothing found", flush=True)
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
