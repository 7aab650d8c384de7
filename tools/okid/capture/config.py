# SPDX-License-Identifier: MIT
"""What a CONFIG.toml says of buses and channels, checked whole before a device is opened.

`okid check CONFIG.toml` is the full validator; the sections of identification are Session.from_config()'s.
"""

from __future__ import annotations

import difflib
import math
import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, NoReturn

from okid._errors import InputError
from okid.capture.channel_bits import FrameFilter, Selector, of_message, of_table
from okid.capture.dbc import read_dbc
from okid.capture.signal_bits import SignalBits
from okid.data.toml_file import read_toml
from okid.data.units import SI

ROLES = ("force", "acceleration", "velocity", "displacement", "aux")
_SECTIONS = (
    "acquisition", "bus", "channel", "identification", "alarm", "trigger", "hammer", "lamps", "record", "publish",
    "realtime", "geometry",
)  # fmt: skip
_ELSEWHERE = ("alarm", "lamps", "record", "publish", "realtime")  # okid run does what they ask for
_ACQUISITION_KEYS: dict[str, Any] = {
    "rate_hz": float, "decimate": (1, 64), "title": str, "operator": str, "structure": str, "specimen": str,
    "location": str, "notes": str,
}  # fmt: skip
_BUS_KEYS: dict[str, Any] = {
    "name": str, "preset": str, "type": ("socketcan", "slcan", "serial", "replay"), "interface": str, "device": str,
    "baud": (50, 20_000_000), "framing": ("cobs", "ascii", "witmotion", "vectornav"), "counter_field": (0, 251),
    "counter_bits": (2, 32), "btr": str, "clock": ("shared", "free"), "rate_hz": float, "file": str, "fd": bool,
    "bitrate": (1000, 20_000_000), "dbitrate": (1000, 20_000_000), "dbc": str, "sync_hz": float,
    "sync_id": (0, 0x1FFFFFFF), "sync_data": str, "start": list,
}  # fmt: skip
_CHANNEL_KEYS: dict[str, Any] = {
    "name": str, "preset": str, "role": ROLES, "dof": (1, 100_000), "unit": str, "bus": str, "message": str,
    "signal": str, "can_id": (0, 0x1FFFFFFF), "pgn": (0, 0x3FFFF), "source_address": (0, 255), "extended": bool,
    "start_bit": (0, 511), "length": (1, 64), "byte_order": ("little", "big", "intel", "motorola"), "signed": bool,
    "value": ("integer", "float32", "float64"), "scale": float, "offset": float, "zero_code": float,
    "field": (0, 251), "sequence": (str, dict),
}  # fmt: skip


@dataclass(frozen=True)
class BusConfig:
    """One [[bus]]. `interface` is what logs call it."""

    name: str
    type: str
    interface: str
    fd: bool = False
    bitrate: int | None = None
    device: str | None = None
    baud: int = 115200
    framing: str = "cobs"
    counter_field: int | None = None
    counter_bits: int = 32

    @property
    def serial(self) -> bool:
        """Samples of a serial line, no CAN frames."""
        return self.type == "serial"


@dataclass(frozen=True)
class ChannelConfig:
    """One [[channel]]: `frame` and `bits` on a CAN bus, `field` on a serial one. scale, offset: of one code, to SI."""

    name: str
    role: str
    bus: str
    scale: float
    offset: float
    frame: FrameFilter | None = None
    bits: SignalBits | None = None
    sequence: SignalBits | None = None
    selectors: tuple[Selector, ...] = ()
    field: int | None = None


@dataclass(frozen=True)
class CaptureConfig:
    """Channels: forces, then responses, each in the order of the file (those a Session takes), then the others."""

    path: Path
    rate_hz: float
    buses: tuple[BusConfig, ...]
    channels: tuple[ChannelConfig, ...]
    update_s: float
    remarks: tuple[str, ...]
    dbcs: tuple[str, ...] = ()

    @property
    def wanted(self) -> tuple[ChannelConfig, ...]:
        """The channels that are identified."""
        return tuple(channel for channel in self.channels if channel.role != "aux")

    def bus(self, kind: str, name: str | None = None) -> BusConfig:
        """The bus of that name, or the only one; `kind` "can" or "serial". Raises InputError when there is no such."""
        fit = [bus for bus in self.buses if bus.serial == (kind == "serial")]
        named = fit if name is None else [bus for bus in fit if bus.name == name]
        if len(named) == 1 and all(channel.bus == named[0].name for channel in self.wanted):
            return named[0]
        there = ", ".join(f"{bus.name} ({bus.type})" for bus in self.buses)
        if len(named) == 1:
            raise InputError(
                f"{self.path}: its channels are on the buses {there}, but a script reads one: identified live with "
                "all of them by `okid run`"
            )
        asked = f"a {kind} bus" if name is None else f"a {kind} bus {name!r}"
        raise InputError(f"{self.path}: found the buses {there}, expected {asked}" + " (--bus NAME)" * (len(fit) > 1))


class Place:
    """A section of a config, for messages that name file, line and key."""

    def __init__(self, path: Path, text: str, section: str, index: int = 0, many: bool = False) -> None:
        self.path, self.section, self.index, self.many = path, section, index, many
        self._lines = text.splitlines()

    def _line(self, key: str | None) -> int | None:
        bracket = r"\[\[\s*{}\s*\]\]" if self.many else r"\[\s*{}\s*\]"
        head = re.compile(r"\s*" + bracket.format(re.escape(self.section)))
        seen, found = -1, None
        for number, line in enumerate(self._lines, 1):
            if re.match(r"\s*\[", line):
                seen += bool(head.match(line))
                found = number if head.match(line) and seen == self.index else None if found else found
            if seen == self.index and found and key and re.match(rf'\s*"?{re.escape(key)}"?\s*[=.]', line):
                return number
            if seen == self.index and found and key is None:
                return number
        return None

    def refuse(self, key: str | None, text: str) -> NoReturn:
        """Raise InputError in the words of the program."""
        title = f"[[{self.section}]] number {self.index + 1}" if self.many else f"[{self.section}]"
        line = self._line(key)
        where = "" if line is None else f"line {line}, "
        raise InputError(f"{self.path}: {where}{title}" + (f', key "{key}": {text}' if key else f": {text}"))


def _shown(value: Any) -> str:
    """As it stands in the file, about."""
    if isinstance(value, str):
        return f'"{value}"'
    return str(value).lower() if isinstance(value, bool) else str(value)


def _near(name: str, known: Sequence[str]) -> str:
    close = difflib.get_close_matches(name, known, 1)
    return f' (did you mean "{close[0]}"?)' if close else ""


def _expected(value: Any, rule: Any) -> str | None:
    """What was expected instead of `value`; None when it is right."""
    if rule is str:
        return None if isinstance(value, str) and value else "text in quotes"
    if rule is bool:
        return None if isinstance(value, bool) else "true or false"
    if rule is list:
        return None if isinstance(value, list) else "an array"
    if rule is float:
        right = isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)
        return None if right else "a number"
    if isinstance(rule[0], int):
        right = isinstance(value, int) and not isinstance(value, bool) and rule[0] <= value <= rule[1]
        return None if right else f"a whole number from {rule[0]} to {rule[1]}"
    if isinstance(rule[0], str):
        return None if value in rule else "one of: " + ", ".join(rule)
    right = isinstance(value, dict) or (isinstance(value, str) and value != "")
    return None if right else "the name of a signal or { start_bit = 0, length = 16 }"


def _check_keys(place: Place, table: dict[str, Any], rules: dict[str, Any]) -> None:
    for key, value in table.items():
        if key not in rules:
            place.refuse(key, f"unknown key{_near(key, tuple(rules))}; known here: {', '.join(rules)}")
        expected = _expected(value, rules[key])
        if expected is not None:
            place.refuse(key, f"found {_shown(value)}, expected {expected}")


def _entries(path: Path, file: dict[str, Any], section: str) -> list[dict[str, Any]]:
    entries = file.get(section)
    if not isinstance(entries, list) or not entries or not all(isinstance(each, dict) for each in entries):
        raise InputError(f"{path}: no [[{section}]], expected at least one, with two brackets")
    return entries


def _read_buses(path: Path, text: str, file: dict[str, Any]) -> list[tuple[BusConfig, str | None]]:
    """Each with the path of its DBC."""
    out: list[tuple[BusConfig, str | None]] = []
    for index, table in enumerate(_entries(path, file, "bus")):
        place = Place(path, text, "bus", index, many=True)
        _check_keys(place, table, _BUS_KEYS)
        if "preset" in table:
            place.refuse("preset", "presets are built into the program: use `okid run`, or write its keys out")
        if table.get("clock") == "free":
            place.refuse("clock", "a node on a clock of its own is resampled by `okid run` only")
        if "name" not in table:
            place.refuse(None, '"name" is missing: every bus has a name')
        if any(bus.name == table["name"] for bus, _ in out):
            place.refuse("name", "another [[bus]] has this name")
        kind = table.get("type", "socketcan")
        if kind == "serial" and table.get("framing") not in ("cobs", "ascii"):
            place.refuse(
                "framing" if "framing" in table else None,
                f'found {table.get("framing")!r}, expected "cobs" or "ascii" (`okid run` reads the others too)',
            )
        keys = ("fd", "bitrate", "device", "baud", "framing", "counter_field", "counter_bits")
        given = {key: table[key] for key in keys if key in table}
        bus = BusConfig(table["name"], kind, table.get("interface", table["name"]), **given)
        out.append((bus, str(path.parent / table["dbc"]) if "dbc" in table else None))
    return out


def _read_channel(
    place: Place, table: dict[str, Any], buses: list[tuple[BusConfig, str | None]], dbcs: dict[str, Any]
) -> ChannelConfig:
    for key in ("name", "role"):
        if key not in table:
            place.refuse(None, f'"{key}" is missing: every channel has one')
    if "preset" in table:
        place.refuse("preset", "presets are built into the program: use `okid run`, or write its keys out")
    names = [bus.name for bus, _ in buses]
    name = table.get("bus", names[0] if len(names) == 1 else None)
    if name not in names:
        found = '"bus" is missing' if name is None else f'found "{name}"{_near(name, names)}'
        place.refuse("bus" if "bus" in table else None, f"{found}, expected one of: {', '.join(names)}")
    bus, dbc = buses[names.index(name)]
    channel = ChannelConfig(table["name"], table["role"], bus.name, 1.0, 0.0)
    scale, offset, unit = 1.0, 0.0, str(table.get("unit", ""))
    try:
        if bus.serial:
            if "field" not in table:
                raise InputError('"field" is missing: on a serial bus it says the place in a sample, from 0')
            bits = SignalBits(0, 1)
            channel = replace(channel, field=table["field"])
        else:
            by_name = "message" in table or "signal" in table
            found_bits = of_message(table, dbcs.get(dbc or ""), bus.name) if by_name else of_table(table)
            bits, unit = found_bits.bits, unit or found_bits.unit
            channel = replace(
                channel,
                frame=found_bits.frame,
                bits=bits,
                sequence=found_bits.sequence,
                selectors=found_bits.selectors,
            )
        scale, offset = bits.scale, bits.offset
    except InputError as fault:
        key = next((word for word in re.findall(r'"(\w+)"', str(fault)) if word in table), "")
        place.refuse(key or None, str(fault).removeprefix(f'"{key}": '))
    scale, offset = float(table.get("scale", scale)), float(table.get("offset", offset))
    if scale == 0:
        place.refuse("scale" if "scale" in table else None, "the scale is 0, expected another number")
    offset -= float(table.get("zero_code", 0.0)) * scale
    factor = SI[unit][0] if unit in SI else 1.0
    return replace(channel, scale=scale * factor, offset=offset * factor)


def _read_channels(
    path: Path, text: str, file: dict[str, Any], buses: list[tuple[BusConfig, str | None]]
) -> tuple[ChannelConfig, ...]:
    dbcs = {dbc: read_dbc(dbc) for _, dbc in buses if dbc is not None}
    out: list[ChannelConfig] = []
    for index, table in enumerate(_entries(path, file, "channel")):
        place = Place(path, text, "channel", index, many=True)
        _check_keys(place, table, _CHANNEL_KEYS)
        channel = _read_channel(place, table, buses, dbcs)
        if any(other.name == channel.name for other in out):
            place.refuse("name", "another [[channel]] has this name")
        out.append(channel)
    if all(channel.role in ("force", "aux") for channel in out):
        raise InputError(f"{path}: no [[channel]] has the role acceleration, velocity or displacement, expected one")
    return tuple(sorted(_share_counters(out), key=lambda channel: {"force": 0, "aux": 2}.get(channel.role, 1)))


def _share_counters(channels: list[ChannelConfig]) -> list[ChannelConfig]:
    """One message has one counter: a channel that names none takes that of its neighbours."""
    counters: dict[tuple[str, FrameFilter | None], SignalBits] = {
        (c.bus, c.frame): c.sequence for c in channels if c.frame and c.sequence
    }
    return [c if c.sequence else replace(c, sequence=counters.get((c.bus, c.frame))) for c in channels]


def load_config(path: str | Path) -> CaptureConfig:
    """Read and check a CONFIG.toml. Raises InputError naming file, line, key, what was found and what was expected."""
    path = Path(path)
    file, text = read_toml(path)
    for section in file:
        if section not in _SECTIONS:
            raise InputError(f'{path}: unknown section "{section}"{_near(section, _SECTIONS)}')
    acquisition = Place(path, text, "acquisition")
    if not isinstance(file.get("acquisition", {}), dict):
        acquisition.refuse(None, "expected a section [acquisition]")
    _check_keys(acquisition, file.get("acquisition", {}), _ACQUISITION_KEYS)
    rate = file.get("acquisition", {}).get("rate_hz")
    if _expected(rate, float) is not None or not 0 < rate <= 1e6:
        acquisition.refuse("rate_hz", f"found {rate!r}, expected a number above 0 to 1000000")
    if file["acquisition"].get("decimate", 1) != 1:
        acquisition.refuse("decimate", "only `okid run` decimates: its filter is the same for every channel")
    for section in ("trigger", "hammer"):
        if file.get(section, {}).get("source") != "immediate" and section in file:
            Place(path, text, section).refuse(None, "waited for by `okid run` only; leave the section out here")
    update = file.get("identification", {}).get("update_s", 0.5)
    if _expected(update, float) is not None or update * rate < 1:
        Place(path, text, "identification").refuse("update_s", f"found {update!r}, expected seconds, a sample at least")
    buses = _read_buses(path, text, file)
    remarks = tuple(f"[{name}] is for `okid run`: nothing is done about it here" for name in _ELSEWHERE if name in file)
    channels = _read_channels(path, text, file, buses)
    dbcs = tuple(dbc for _, dbc in buses if dbc is not None)
    return CaptureConfig(path, float(rate), tuple(bus for bus, _ in buses), channels, float(update), remarks, dbcs)
