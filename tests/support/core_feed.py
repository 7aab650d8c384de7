# SPDX-License-Identifier: MIT
"""tests/embedded/core/feed.c fed with rig W1, and what its lines must say: the states of the library's own sums."""

from __future__ import annotations

import ctypes
import subprocess
import sys
import zlib
from pathlib import Path

import numpy as np
import systems
from numpy.typing import NDArray
from okid import Accumulator, abi

ROOT = Path(__file__).resolve().parents[2]
HERE, BOARDS = ROOT / "tests" / "embedded" / "core", ROOT / "tests" / "embedded" / "node"
SAMPLES, FIRST, MISSING, P, LAGS = 3001, 1200, 5, 20, 100
Codes = NDArray[np.int16]


def w1(count: int) -> Codes:
    """W1, 1 % noise, as a converter of 16 bits gives it: force, then the accelerations; an offset on each channel."""
    return record_codes(systems.w1(), count, 7)


def record_codes(structure: systems.Structure, count: int, seed: int) -> Codes:
    """The same of any structure with four channels."""
    record = np.hstack(systems.record(structure, count, 1.0, seed))
    codes = np.round(record / np.abs(record).max(axis=0) * 30000) + [100, -300, 250, 40]
    return codes.astype(np.int16)


def generate(folder: Path) -> None:
    """okid_core.c/.h, okid_modes.cpp/.h and the record as codes.h."""
    subprocess.run([sys.executable, ROOT / "tools" / "amalgamate.py", folder], check=True)
    write_codes(folder)


def write_codes(folder: Path) -> None:
    """The record as codes.h."""
    rows = ",\n".join("{" + ", ".join(map(str, row)) + "}" for row in w1(SAMPLES).tolist())
    head = f"#include <stdint.h>\nenum {{ SAMPLES = {SAMPLES} }};\n"
    text = f"{head}static const int16_t codes[SAMPLES][4] = {{{rows}}};\n"
    (folder / "codes.h").write_text(text)


def compile(compiler: list[str], folder: Path, image: Path, *rest: object) -> None:
    """feed.c with okid_core.c of the folder to an image; rest: the board's sources and the linker's arguments."""
    command = [*compiler, "-I.", f"-I{BOARDS}", HERE / "feed.c", "okid_core.c", *rest, "-o", image]
    subprocess.run([str(word) for word in command], cwd=folder, check=True)


def sketch(library: Path, name: str, compiler: list[str], image: Path, *rest: object) -> None:
    """A sketch of packaging/arduino over the record, with the stubs; rest: objects, sources, the linker's arguments."""
    source, stubs = library / "examples" / name / f"{name}.ino", ROOT / "tests" / "boards" / "stubs"
    include = [f"-I{library / 'src'}", f"-I{stubs}", f"-I{BOARDS}", f'-DSKETCH="{source}"']
    command = [*compiler, "-std=gnu++17", "-Wall", "-Wextra", "-Werror", *include, stubs / "sketch.cpp", *rest]
    subprocess.run([str(word) for word in [*command, "-o", image]], check=True)


def correlation(parts: list[Codes], lags: int, gap: int) -> bytes:
    """The state of the library's correlation sums of two runs, buffers of the host's size."""

    def call(name: str, *arguments: object) -> None:
        abi.check(getattr(abi.library(), name)(*arguments), name)

    config = abi.CorrelationConfig(1, 3, lags, 0, abi.SAMPLE_INT16, 0, 2, 0, 0, 1.0)
    block = abi.block(abi.library().okid_correlation_memsize(ctypes.byref(config)))
    handle = ctypes.c_void_p()
    call("okid_correlation_create", ctypes.byref(handle), ctypes.byref(config), block.ctypes.data, block.size)
    for k, part in enumerate(parts):
        if k > 0:
            abi.library().okid_correlation_gap(handle, gap)
        codes = np.ascontiguousarray(part)
        call("okid_correlation_add_i16", handle, codes.ctypes.data_as(abi.int16s), len(codes))
    out = ctypes.create_string_buffer(abi.library().okid_correlation_serialised_size(handle))
    call("okid_correlation_serialise", handle, out, len(out))
    return out.raw


def expected() -> dict[str, tuple[int, int]]:
    """Bytes and CRC-32 of each state: the library's kernel in double, Python's CRC."""
    codes = w1(SAMPLES)
    wide = codes.astype(np.int32) * 256 + (np.arange(SAMPLES, dtype=np.int32) % 256)[:, None]
    states = {}
    for name, bits, record in (("sums16", 16, codes), ("sums24", 24, wide)):
        sums = Accumulator(1, 3, P, codes=bits, edges=False)
        sums.add(record)
        states[name] = sums.to_bytes()
    states["correlation"] = correlation([codes[:FIRST], codes[FIRST:]], LAGS, MISSING)
    return {name: (len(state), zlib.crc32(state[:-4])) for name, state in states.items()}


def read(lines: str) -> tuple[dict[str, tuple[int, int]], dict[str, int]]:
    """What feed.c wrote: bytes and CRC of each state; instructions a sample."""
    rows = [line.split() for line in lines.split("end\n")[0].splitlines()]
    assert all(len(row) == 4 for row in rows), lines
    return {r[0]: (int(r[1]), int(r[2], 16)) for r in rows}, {r[0]: int(r[3]) for r in rows}
