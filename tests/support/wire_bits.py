# SPDX-License-Identifier: MIT
"""How long a frame takes on a CAN bus, counted bit by bit (ISO 11898-1:2015)."""

from __future__ import annotations

FD_LENGTHS = [0, 1, 2, 3, 4, 5, 6, 7, 8, 12, 16, 20, 24, 32, 48, 64]


def stuff(bits: str, closing: bool) -> str:
    """The bits as they stand on the wire; `closing`: a run that is full at the end is stuffed too."""
    wire = ""
    for at, bit in enumerate(bits):
        wire += bit
        if wire[-5:] in ("00000", "11111") and (closing or at + 1 < len(bits)):
            wire += "1" if bit == "0" else "0"
    return wire


def crc15(bits: str) -> str:
    value = int(bits + "0" * 15, 2)
    for shift in range(len(bits) - 1, -1, -1):
        if value >> (shift + 15) & 1:
            value ^= 0xC599 << shift
    return f"{value:015b}"


def address(identifier: int, extended: bool) -> str:
    """Start of frame and identifier, up to the bit before RTR or RRS."""
    return f"0{identifier >> 18:011b}11{identifier & 0x3FFFF:018b}" if extended else f"0{identifier:011b}"


def classic(identifier: int, extended: bool, data: bytes, bitrate: float) -> float:
    """Seconds on the wire."""
    bits = address(identifier, extended) + "000" + f"{len(data):04b}" + "".join(f"{byte:08b}" for byte in data)
    return (len(stuff(bits + crc15(bits), True)) + 13) / bitrate


def flexible(identifier: int, extended: bool, switched: bool, data: bytes, bitrate: float, dbitrate: float) -> float:
    """Seconds on the wire."""
    head = address(identifier, extended) + ("010" if extended else "0010") + ("1" if switched else "0")
    rest = "0" + f"{FD_LENGTHS.index(len(data)):04b}" + "".join(f"{byte:08b}" for byte in data)
    slow = len(stuff(head, False))
    check = 4 + (21 if len(data) > 16 else 17)
    fast = len(stuff(head + rest, False)) - slow + check + (check + 3) // 4
    return (slow + 13) / bitrate + fast / (dbitrate if switched else bitrate)
