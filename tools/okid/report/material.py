# SPDX-License-Identifier: MIT
"""Everything a report is made of, in one place for its sections."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, NamedTuple

from okid.report.events import Events
from okid.report.geometry import Geometry
from okid.report.loaded import Loaded
from okid.report.measured import Measured
from okid.report.svg import Pictures
from okid.result import figures

if TYPE_CHECKING:
    from okid.report.comparison import Other


class Source(NamedTuple):
    """A file that went in: what for, its name, SHA-256 in hex, bytes."""

    kind: str
    name: str
    sha256: str
    size: int


@dataclass
class Material:
    """The result, and what else was given. `texts`: name and text of the configurations."""

    result: Loaded
    measured: Measured | None = None
    events: Events | None = None
    geometry: Geometry | None = None
    other: Other | None = None
    sources: list[Source] = field(default_factory=list)
    texts: list[tuple[str, str]] = field(default_factory=list)
    pictures: Pictures = field(default_factory=Pictures)

    def unit(self, name: str) -> str:
        """Unit of a channel as the record or the run had it, "m/s²" for "m/s^2", "" when nothing says so."""
        record = None if self.measured is None else self.measured.record
        channels = {} if self.events is None else self.events.channels
        unit = str(channels.get(name, {}).get("unit") or "")
        if record is not None:  # its channels stand in the order of the result
            unit = record.units[(self.result.inputs + self.result.outputs).index(name)] or unit
        return unit.replace("^2", "²").replace("^3", "³")

    def with_unit(self, name: str) -> str:
        """The name as an axis takes it, its unit in a second line when it is known."""
        unit = self.unit(name)
        return figures.short(name, 14) + (f"\n[{figures.short(unit, 14)}]" if unit else "")
