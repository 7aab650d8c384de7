# SPDX-License-Identifier: MIT
"""Where a number stands in the bytes of a frame, and what it means; the same rules as drivers/include/drv/codec.h.

The start bit follows the DBC: bit n is bit n % 8 of byte n // 8; little-endian (Intel) signals name their least
significant bit, big-endian (Motorola) ones their most significant bit.
"""

from __future__ import annotations

import struct
from dataclasses import dataclass, field

_FLOATS = {"float32": ("f", 32), "float64": ("d", 64)}


@dataclass(frozen=True)
class SignalBits:
    """`length` bits from `start_bit` on; `value` "integer", "float32" or "float64". physical = raw scale + offset."""

    start_bit: int
    length: int
    big_endian: bool = False
    signed: bool = False
    value: str = "integer"
    scale: float = 1.0
    offset: float = 0.0
    first: int = field(init=False, compare=False)  # byte
    end: int = field(init=False, compare=False)  # byte behind the last one
    shift: int = field(init=False, compare=False)

    def __post_init__(self) -> None:
        begin = self.start_bit
        if self.big_endian:
            begin = begin // 8 * 8 + 7 - begin % 8  # counted from the first bit on the wire
        last = begin + self.length - 1
        object.__setattr__(self, "first", begin // 8)
        object.__setattr__(self, "end", last // 8 + 1)
        object.__setattr__(self, "shift", 7 - last % 8 if self.big_endian else begin % 8)

    def fault(self) -> str | None:
        """What is wrong with the layout, None when nothing is."""
        if not 1 <= self.length <= 64:
            return "a signal has 1 to 64 bits"
        if not 0 <= self.start_bit <= 511:
            return "the start bit must be below 512 (64 bytes)"
        if self.value in _FLOATS and self.length != _FLOATS[self.value][1]:
            return f"a {self.value} signal has {_FLOATS[self.value][1]} bits"
        return "the signal ends beyond byte 64" if self.end > 64 else None

    def raw(self, data: bytes | bytearray) -> int | None:
        """The bits as a whole number, with its sign; None when the frame is too short. Floats give their pattern."""
        if self.end > len(data):
            return None
        order = "big" if self.big_endian else "little"
        bits = int.from_bytes(data[self.first : self.end], order) >> self.shift  # type: ignore[arg-type]
        bits &= (1 << self.length) - 1
        if self.signed and self.value == "integer" and bits >> (self.length - 1):
            bits -= 1 << self.length
        return bits

    def number(self, data: bytes | bytearray) -> float | None:
        """What scale and offset are applied to: the raw integer or the float; None when the frame is too short."""
        bits = self.raw(data)
        if bits is None or self.value == "integer":
            return bits
        code, length = _FLOATS[self.value]
        return float(struct.unpack("<" + code, bits.to_bytes(length // 8, "little"))[0])

    def same_place(self, other: SignalBits) -> bool:
        """The same bits, whatever they mean."""
        return (self.start_bit, self.length, self.big_endian) == (other.start_bit, other.length, other.big_endian)
