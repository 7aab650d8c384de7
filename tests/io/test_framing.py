# SPDX-License-Identifier: MIT
"""The framing code of drivers/, compiled alone, against PyPI cobs, zlib and binascii."""

from __future__ import annotations

import binascii
import ctypes
import os
import subprocess
import zlib
from pathlib import Path

import pytest
from cobs import cobs
from hypothesis import given, settings
from hypothesis import strategies as st

ROOT = Path(__file__).resolve().parents[2]


@pytest.fixture(scope="module")
def code(tmp_path_factory: pytest.TempPathFactory) -> ctypes.CDLL:
    built = tmp_path_factory.mktemp("framing") / "framing.so"
    sources = [str(ROOT / "drivers" / "src" / f"{name}.c") for name in ("cobs", "crc")]
    compiler = os.environ.get("CC", "cc")
    subprocess.run(
        [compiler, "-std=c99", "-O1", "-shared", "-fPIC", f"-I{ROOT / 'drivers' / 'include'}", *sources, "-o", built],
        check=True,
    )
    library = ctypes.CDLL(str(built))
    library.drv_cobs_encode.restype = ctypes.c_size_t
    library.drv_cobs_encode.argtypes = [ctypes.c_void_p, ctypes.c_size_t, ctypes.c_void_p]
    library.drv_cobs_decode.restype = ctypes.c_ssize_t
    library.drv_cobs_decode.argtypes = [ctypes.c_void_p, ctypes.c_size_t, ctypes.c_void_p]
    library.drv_crc32.restype = ctypes.c_uint32
    library.drv_crc32.argtypes = [ctypes.c_uint32, ctypes.c_char_p, ctypes.c_size_t]
    library.drv_crc16_ccitt.restype = ctypes.c_uint16
    library.drv_crc16_ccitt.argtypes = [ctypes.c_uint16, ctypes.c_char_p, ctypes.c_size_t]
    return library


def encode(code: ctypes.CDLL, data: bytes, *, in_place: bool) -> bytes:
    room = len(data) + len(data) // 254 + 1
    out = ctypes.create_string_buffer(room)
    if in_place:
        ctypes.memmove(ctypes.addressof(out) + room - len(data), data, len(data))
        source = ctypes.addressof(out) + room - len(data)
    else:
        held = ctypes.create_string_buffer(data, len(data) or 1)
        source = ctypes.addressof(held)
    size = code.drv_cobs_encode(source, len(data), out)
    return out.raw[:size]


def decode(code: ctypes.CDLL, data: bytes) -> bytes | None:
    held = ctypes.create_string_buffer(data, len(data) or 1)
    size = code.drv_cobs_decode(held, len(data), held)
    return None if size < 0 else held.raw[:size]


# Long runs without a zero meet the blocks of 254.
pieces = st.lists(st.one_of(st.binary(max_size=20), st.integers(250, 260).map(lambda n: b"\x01" * n)), max_size=6)


@settings(max_examples=400)
@given(parts=pieces, in_place=st.booleans())
def test_cobs_is_that_of_pypi(code: ctypes.CDLL, parts: list[bytes], in_place: bool) -> None:
    data = b"".join(parts)
    wire = encode(code, data, in_place=in_place)
    assert cobs.decode(wire) == data
    assert len(wire) <= len(cobs.encode(data)) + 1  # a full last block may be closed by an empty one, or not
    assert 0 not in wire
    assert decode(code, wire) == data
    assert decode(code, cobs.encode(data)) == data


@settings(max_examples=400)
@given(wire=st.one_of(st.binary(max_size=300), st.binary(max_size=12)))
def test_cobs_refuses_what_pypi_refuses(code: ctypes.CDLL, wire: bytes) -> None:
    try:
        wanted = cobs.decode(wire) if wire else None
    except cobs.DecodeError:
        wanted = None
    assert decode(code, wire) == wanted


@settings(max_examples=200)
@given(first=st.binary(max_size=300), second=st.binary(max_size=300))
def test_sums_are_those_of_zlib_and_binascii(code: ctypes.CDLL, first: bytes, second: bytes) -> None:
    whole = first + second
    assert code.drv_crc32(0, whole, len(whole)) == zlib.crc32(whole)
    assert code.drv_crc32(code.drv_crc32(0, first, len(first)), second, len(second)) == zlib.crc32(whole)
    assert code.drv_crc16_ccitt(0, whole, len(whole)) == binascii.crc_hqx(whole, 0)
    closed = whole + binascii.crc_hqx(whole, 0).to_bytes(2, "big")
    assert code.drv_crc16_ccitt(0, closed, len(closed)) == 0
