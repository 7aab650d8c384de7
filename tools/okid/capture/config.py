# SPDX-License-Identifier: MIT
"""What a CONFIG.toml says of buses and channels: read and checked by the host library, as `okid check` does."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from okid._errors import InputError
from okid.abi import host


@dataclass(frozen=True)
class BusConfig:
    """One [[bus]]. `interface` is what logs call it; `device` and `baud` are those of a serial or slcan line."""

    name: str
    type: str
    interface: str
    fd: bool = False
    bitrate: int | None = None
    device: str | None = None
    baud: int = 115200
    adapter: str | None = None

    @property
    def serial(self) -> bool:
        """Samples of a serial line, no CAN frames."""
        return self.type == "serial"


@dataclass(frozen=True)
class ChannelConfig:
    """One [[channel]]. scale, offset: of the number in the frame, to `unit`; `number`: integer, float32 or float64."""

    name: str
    role: str
    bus: str
    dof: int | None
    unit: str
    scale: float
    offset: float
    number: str
    length: int
    signed: bool


@dataclass(frozen=True)
class CaptureConfig:
    """Channels: forces, then responses, each in the order of the file (those a Session takes), then the others."""

    path: Path
    rate_hz: float
    buses: tuple[BusConfig, ...]
    channels: tuple[ChannelConfig, ...]
    update_s: float
    remarks: tuple[str, ...]
    dbcs: tuple[str, ...]
    trigger: str

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
                f"{self.path}: its channels are on the buses {there}, but this command reads one: identified live with "
                "all of them by `okid run`"
            )
        asked = f"a {kind} bus" if name is None else f"a {kind} bus {name!r}"
        raise InputError(f"{self.path}: found the buses {there}, expected {asked}" + " (--bus NAME)" * (len(fit) > 1))


def _bus(table: dict[str, Any]) -> BusConfig:
    rate, interface = table["bitrate"], table["interface"] or table["name"]
    return BusConfig(
        table["name"], table["type"], interface, table["fd"], rate if rate is None else int(rate), table["device"],
        table.get("baud") or 115200, table["adapter"],
    )  # fmt: skip


def load_config(path: str | Path) -> CaptureConfig:
    """Read and check a CONFIG.toml. Raises InputError naming file, line, key, what was found and what was expected."""
    found = host.config(path)
    channels = tuple(
        ChannelConfig(
            one["name"], one["role"], one["bus"], one["dof"], one["unit"], one["scale"], one["offset"], one["value"],
            one["length"], one["signed"],
        )
        for one in found["channels"]
    )  # fmt: skip
    if found["outputs"] == 0:
        raise InputError(f"{path}: no [[channel]] has the role acceleration, velocity or displacement, expected one")
    buses = tuple(map(_bus, found["buses"]))
    dbcs = tuple(one["dbc"] for one in found["buses"] if one["dbc"])
    return CaptureConfig(
        Path(path), found["rate_hz"], buses, channels, found["identification"]["update_s"], tuple(found["warnings"]),
        dbcs, found["trigger"]["source"],
    )  # fmt: skip
