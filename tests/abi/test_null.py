# SPDX-License-Identifier: MIT
"""NULL where a pointer is expected, for every public function: an error or nothing, never a fault (okid.h)."""

from __future__ import annotations

import ctypes
import os
import re
import signal
import subprocess
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

import okid
import pytest
from okid import abi
from okid.abi import host

ROOT = Path(__file__).resolve().parents[2]
HEADERS = [ROOT / "lib" / "include" / "okid", ROOT / "firmware_host" / "include"]
PLAIN = {"int": ctypes.c_int, "int32_t": ctypes.c_int32, "uint32_t": ctypes.c_uint32, "int64_t": ctypes.c_int64,
         "uint64_t": ctypes.c_uint64, "size_t": ctypes.c_size_t, "double": ctypes.c_double,
         "okid_real_t": ctypes.c_double, "okid_status_t": ctypes.c_int32, "okid_detrend_t": ctypes.c_int32,
         "okid_method_t": ctypes.c_int32}  # fmt: skip
TEXTS = {"okid_version", "okid_backend", "okid_status_text", "okid_warning_code", "okid_mkr_note"}  # without pointers
COUNTS = {"unit", "capture_done", "result_array", "result_decomposition"}  # of okid_host: 0 is no success


class Function(NamedTuple):
    name: str
    gives: str  # "void", "okid_status_t", ..
    takes: tuple[Any, ...]


def functions() -> Iterator[Function]:
    for header in sorted(path for folder in HEADERS for path in folder.rglob("*.h")):
        text = re.sub(r"//[^\n]*|/\*.*?\*/", "", header.read_text(), flags=re.DOTALL)
        for gives, name, arguments in re.findall(
            r"OKID(?:_HOST)?_API\s+([^;{}()]*?)(okid_\w+)\s*\(([^;{}]*?)\)\s*;", text
        ):
            words = [one.strip() for one in arguments.split(",") if one.strip() not in ("", "void")]
            takes = tuple(
                ctypes.c_void_p if "*" in one or "okid_host_stage_t" in one else PLAIN[one.split()[-2]] for one in words
            )
            yield Function(name, gives.replace("OKID_NODISCARD", "").strip(), takes)


EVERY = {one.name: one for one in functions()}
WITH_POINTERS = [name for name, one in EVERY.items() if ctypes.c_void_p in one.takes]


def linked(one: Function) -> Any:
    """A function of its own: those of the binding have their types."""
    library = ctypes.CDLL((host.library() if one.name.startswith("okid_host_") else abi.library())._name)
    name = f"{one.name}_{abi.ABI}_double"
    function = library[name if hasattr(library, name) else one.name]
    gives = ctypes.c_void_p if "*" in one.gives else PLAIN.get(one.gives)
    function.restype, function.argtypes = gives, one.takes
    return function


def in_a_child(call: Any) -> int:
    """How a process ends that calls it: 0, 1 when it gives False, minus the signal."""
    child = os.fork()
    if child == 0:
        signal.alarm(60)
        os._exit(0 if call() else 1)
    return os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])


def expected(one: Function, given: Any) -> bool:
    if one.gives == "okid_status_t":
        return bool(given < 0)
    host_name = one.name.removeprefix("okid_host_")
    if host_name in ("capture_events", "side_of_column"):  # never NULL
        return ctypes.string_at(given) == b""
    if host_name != one.name and one.gives in ("int", "int32_t") and host_name not in COUNTS:
        return abs(given) == 2 and b"NULL" in host.library().okid_host_error()
    return given is None or given == 0


def test_they_are_found() -> None:
    """Those of the headers are those of the libraries: nothing is left out by the way it is written."""
    assert "okid_accumulator_gap" in EVERY and set(EVERY) >= TEXTS
    for library in (abi.library(), host.library()):
        names = subprocess.run(
            ["nm", "-D", "--defined-only", library._name], capture_output=True, text=True, check=True
        )
        exported = set(re.findall(r" T (okid_\w+)", names.stdout))
        shared = {name.removesuffix(f"_{abi.ABI}_double") for name in exported}
        assert len(shared) > 50 and shared <= set(EVERY), shared - set(EVERY)


@pytest.mark.parametrize("name", WITH_POINTERS)
def test_all_pointers_null(name: str) -> None:
    one = EVERY[name]
    for number in (0, 1, 3):
        values = [None if kind is ctypes.c_void_p else kind(number) for kind in one.takes]
        ended = in_a_child(lambda values=values: expected(one, linked(one)(*values)))
        assert ended == 0, (name, number, ended)


OBJECTS = {
    "okid_accumulator_": lambda: okid.Accumulator(1, 2, 5),
    "okid_square_root_": lambda: okid.SquareRoot(1, 2, 5),
}


@pytest.mark.parametrize("name", [name for name in WITH_POINTERS if name.startswith(tuple(OBJECTS))])
def test_null_beside_an_object(name: str) -> None:
    """The first argument is there, the others are not."""
    one = EVERY[name]
    if name.endswith(("_memsize", "_create")):
        return
    made = next(make() for start, make in OBJECTS.items() if name.startswith(start))
    rest = [None if kind is ctypes.c_void_p else kind(1) for kind in one.takes[1:]]
    ended = in_a_child(lambda: linked(one)(made.handle, *rest) is not False)
    assert ended == 0, (name, ended)


def test_structs_are_zeros_and_gaps_end() -> None:
    raw = abi.AccumulatorStats(1, 2, 3, 4, 5, 6)
    abi.library().okid_accumulator_stats(None, ctypes.byref(raw))
    assert not any(getattr(raw, name) for name, *_ in raw._fields_)
    for sums in (okid.Accumulator(1, 1, 2), okid.SquareRoot(1, 1, 2)):
        for count in (-1, 2**62, 2**62, 2**63 - 1, 5):
            getattr(abi.library(), f"{sums.kernel}_gap")(sums.handle, count)
        assert sums.stats.missing == 2**62
        sums.add([[1.0, 2.0]] * 5)
        assert sums.stats.samples == 5
