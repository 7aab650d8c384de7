# SPDX-License-Identifier: MIT
"""Which frames a channel of a CAN bus stands in and at which bits: out of a DBC, or out of the keys of [[channel]]."""

from __future__ import annotations

import difflib
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

from okid._errors import InputError
from okid.capture.signal_bits import SignalBits


class FrameFilter(NamedTuple):
    """Frames of one identifier; `mask` 0 = exactly it, else of all that agree in these bits (a parameter group)."""

    can_id: int
    extended: bool
    mask: int = 0


class Selector(NamedTuple):
    """A multiplexor, and the values for which the frame carries the signal."""

    bits: SignalBits
    values: tuple[int, ...]


@dataclass(frozen=True)
class ChannelBits:
    """Where one number stands. `unit` as the DBC has it."""

    frame: FrameFilter
    bits: SignalBits
    sequence: SignalBits | None = None
    selectors: tuple[Selector, ...] = ()
    unit: str = ""


def _near(name: str, known: list[str]) -> str:
    close = difflib.get_close_matches(name, known, 1)
    hint = f' (did you mean "{close[0]}"?)' if close else ""
    return f'found "{name}"{hint}, expected one of: {", ".join(known[:16])}' + ", ..." * (len(known) > 16)


def _group(number: int) -> int:
    """The parameter group: below 0xF000 the low byte is an address, not part of it."""
    return number & 0x3FF00 if (number >> 8 & 0xFF) < 240 else number


def _pgn_filter(number: int, source: int | None) -> FrameFilter:
    group = _group(number)
    mask = (0x03FF0000 if (number >> 8 & 0xFF) < 240 else 0x03FFFF00) | (0xFF if source is not None else 0)
    return FrameFilter(group << 8 | (source or 0), True, mask)


def _sequence(table: dict[str, Any], message: Any) -> SignalBits | None:
    given = table.get("sequence")
    if given is None:
        return None
    if isinstance(given, str):
        if message is None:
            raise InputError('"sequence": the name of a signal needs a dbc; expected { start_bit = 0, length = 16 }')
        bits = _signal_bits(_signal(message, "sequence", given))
    else:
        known = {"start_bit", "length", "byte_order"}
        wrong = [key for key in given if key not in known]
        numbers = [given.get("start_bit"), given.get("length")]
        order = given.get("byte_order", "little")
        if wrong or not all(isinstance(n, int) for n in numbers) or order not in ("little", "big", "intel", "motorola"):
            raise InputError(
                f'"sequence": found {given!r}, expected start_bit, length and byte_order = "little" or "big"'
            )
        bits = SignalBits(given["start_bit"], given["length"], order in ("big", "motorola"))
    if bits.fault() or bits.value != "integer" or bits.signed or not 2 <= bits.length <= 63:
        raise InputError('"sequence": a counter is an unsigned integer of 2 to 63 bits')
    return replace(bits, scale=1.0, offset=0.0)


def _signal(message: Any, key: str, name: str) -> Any:
    for signal in message.signals:
        if signal.name == name:
            return signal
    names = [signal.name for signal in message.signals]
    raise InputError(f'"{key}": {_near(name, names)} (signals of {message.name})')


def _signal_bits(signal: Any) -> SignalBits:
    conversion = signal.conversion
    value = f"float{signal.length}" if conversion.is_float else "integer"
    bits = SignalBits(
        signal.start, signal.length, signal.byte_order == "big_endian", bool(signal.is_signed), value,
        float(conversion.scale), float(conversion.offset),
    )  # fmt: skip
    wrong = bits.fault()
    if wrong:
        raise InputError(f'"signal": {signal.name} of the dbc: {wrong}')
    return bits


def _selectors(message: Any, signal: Any) -> tuple[Selector, ...]:
    """The multiplexor of a signal, that one's own, and so on up to one that is always there."""
    out: list[Selector] = []
    while signal.multiplexer_ids:
        above = [s for s in message.signals if s.is_multiplexer and s.name == signal.multiplexer_signal]
        if not above or len(out) > len(message.signals):
            raise InputError(f'"signal": {signal.name} is multiplexed, but {message.name} has no multiplexor for it')
        out.append(Selector(_signal_bits(above[0]), tuple(signal.multiplexer_ids)))
        signal = above[0]
    return tuple(out)


def of_message(table: dict[str, Any], database: Any, bus: str) -> ChannelBits:
    """`message` and `signal` of a DBC. Raises InputError whose first quoted word is the key at fault."""
    for key in ("can_id", "pgn", "extended", "start_bit", "length", "byte_order", "signed", "value", "field"):
        if key in table:
            raise InputError(f'"{key}": a channel has either message and signal of a dbc, or can_id and start_bit')
    for key, other in (("message", "signal"), ("signal", "message")):
        if key not in table:
            raise InputError(f'"{other}": "{key}" is missing beside it')
    if database is None:
        raise InputError(f'"message": bus "{bus}" has no dbc, expected dbc = "FILE.dbc" in its [[bus]]')
    message = next((m for m in database.messages if m.name == table["message"]), None)
    if message is None:
        raise InputError(f'"message": {_near(table["message"], [m.name for m in database.messages])}')
    signal = _signal(message, "signal", table["signal"])
    bits = _signal_bits(signal)
    if bits.end > message.length:
        raise InputError('"signal": the signal ends beyond the message')
    frame = FrameFilter(message.frame_id, message.is_extended_frame)
    if message.protocol == "j1939":
        frame = _pgn_filter(message.frame_id >> 8 & 0x3FFFF, table.get("source_address"))
    elif "source_address" in table:
        raise InputError(f'"source_address": message {message.name} is no J1939 message')
    return ChannelBits(frame, bits, _sequence(table, message), _selectors(message, signal), signal.unit or "")


def of_table(table: dict[str, Any]) -> ChannelBits:
    """`can_id` (or `pgn`), `start_bit`, `length` .. of a [[channel]]. Raises InputError like of_message()."""
    for key in ("start_bit", "length", "can_id"):
        if key not in table and not (key == "can_id" and "pgn" in table):
            raise InputError(f"{key} is missing: a channel needs message and signal, or can_id, start_bit and length")
    if "field" in table:
        raise InputError('"field": only a channel of a serial bus has one')
    if "pgn" in table:
        for key in ("can_id", "extended"):
            if key in table:
                raise InputError(f'"{key}": a channel has either can_id or pgn, not both')
        if _group(table["pgn"]) != table["pgn"]:
            raise InputError(
                f'"pgn": found {table["pgn"]}, expected {_group(table["pgn"])}: its low byte is an address'
            )
        frame = _pgn_filter(table["pgn"], table.get("source_address"))
    else:
        if "source_address" in table:
            raise InputError('"source_address": it needs pgn beside it, or a J1939 message of a dbc')
        extended = table.get("extended", table["can_id"] > 0x7FF)
        if not extended and table["can_id"] > 0x7FF:
            raise InputError(f'"can_id": found {table["can_id"]}, expected at most 2047 with extended = false')
        frame = FrameFilter(table["can_id"], extended)
    bits = SignalBits(
        table["start_bit"], table["length"], table.get("byte_order", "little") in ("big", "motorola"),
        table.get("signed", False), table.get("value", "integer"),
    )  # fmt: skip
    wrong = bits.fault()
    if wrong:
        raise InputError(f'"start_bit": {wrong}')
    return ChannelBits(frame, bits, _sequence(table, None))
