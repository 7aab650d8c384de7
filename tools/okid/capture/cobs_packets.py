# SPDX-License-Identifier: MIT
"""Packets of the project's own serial stream: COBS, CRC-32, sequence, device time; see docs/wire-protocol.md."""

from __future__ import annotations

import struct
import zlib
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from okid._errors import InputError

LONGEST = 1024  # bytes of a packet, CRC included
LONGEST_ON_THE_WIRE = LONGEST + LONGEST // 254 + 2
OVERHEAD = 16
_SIZES = (2, 3, 4)  # int16, int24, float32
_HEAD = struct.Struct("<BBBBII")


@dataclass(frozen=True)
class Packet:
    """`rows` (samples, channels): codes, or numbers of format 2; `sequence` of the first, its `time_us` by the node."""

    sequence: int
    time_us: int
    rows: NDArray[np.float64]


def stuff(plain: bytes) -> bytes:
    """COBS without the closing 0: no byte of the result is 0."""
    out, pieces = bytearray(), plain.split(b"\0")
    for number, piece in enumerate(pieces, 1):
        full = len(piece) >= 254
        while len(piece) >= 254:
            out += b"\xff" + piece[:254]
            piece = piece[254:]
        if piece or not full or number < len(pieces):  # a last block of 254 ends by itself
            out += bytes([len(piece) + 1]) + piece
    return bytes(out)


def unstuff(stuffed: bytes) -> bytes | None:
    """The reverse; None when it is no COBS."""
    out, at = bytearray(), 0
    while at < len(stuffed):
        code = stuffed[at]
        if code == 0 or at + code > len(stuffed):
            return None
        out += stuffed[at + 1 : at + code]
        at += code
        if code < 255 and at < len(stuffed):
            out.append(0)
    return bytes(out)


def encode_packet(packet: Packet, number_format: int) -> bytes:
    """Bytes for the wire, the closing 0 included. `number_format` 0 int16, 1 int24, 2 float32.

    Raises InputError when it would be longer than a packet may be.
    """
    samples, channels = packet.rows.shape
    if not 1 <= channels <= 252 or not 1 <= samples <= 255 or room(channels, number_format) < samples:
        raise InputError(f"{samples} samples of {channels} channels do not fit a packet of {LONGEST} bytes")
    head = _HEAD.pack(1, number_format, channels, samples, packet.sequence & 0xFFFFFFFF, packet.time_us & 0xFFFFFFFF)
    if number_format == 2:
        numbers = packet.rows.astype("<f4").tobytes()
    else:
        words = packet.rows.astype("<i4").reshape(-1, 1).view(np.uint8)
        numbers = words[:, : _SIZES[number_format]].tobytes()
    body = head + numbers
    return stuff(body + struct.pack("<I", zlib.crc32(body))) + b"\0"


def room(channels: int, number_format: int) -> int:
    """Samples of so many channels that a packet can hold."""
    return min(255, (LONGEST - OVERHEAD) // (channels * _SIZES[number_format]))


def decode_packet(stuffed: bytes) -> Packet | None:
    """What stood before a 0; None when sum, length, version or format is wrong."""
    plain = unstuff(stuffed)
    if plain is None or len(plain) < OVERHEAD or zlib.crc32(plain[:-4]) != int.from_bytes(plain[-4:], "little"):
        return None
    version, number_format, channels, samples, sequence, time_us = _HEAD.unpack_from(plain)
    if version != 1 or number_format > 2 or channels == 0 or samples == 0:
        return None
    body = plain[_HEAD.size : -4]
    if len(body) != channels * samples * _SIZES[number_format]:
        return None
    if number_format == 2:
        numbers = np.frombuffer(body, "<f4").astype(np.float64)
    elif number_format == 0:
        numbers = np.frombuffer(body, "<i2").astype(np.float64)
    else:
        words = np.zeros((channels * samples, 4), np.uint8)
        words[:, 1:] = np.frombuffer(body, np.uint8).reshape(-1, 3)  # the sign in its place
        numbers = (words.view("<i4")[:, 0] >> 8).astype(np.float64)
    return Packet(sequence, time_us, numbers.reshape(samples, channels))
