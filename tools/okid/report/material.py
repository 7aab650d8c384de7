# SPDX-License-Identifier: MIT
"""Everything a report is made of, in one place for its sections."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, NamedTuple

from okid.data.structure_motion import StructureMotion
from okid.report.events import Events
from okid.report.loaded import Loaded
from okid.report.measured import Measured
from okid.report.svg import Pictures
from okid.result import figures
from okid.result.shape_places import struck_at

if TYPE_CHECKING:
    from okid.report.comparison import Other


def is_struck(result: Loaded) -> bool:
    """Is it of hits in files, each with its place?"""
    return bool(result.raw.get("hits") and result.inputs) and all(struck_at(name) for name in result.inputs)


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
    no_record: str = ""  # why the records that the result names are not here
    events: Events | None = None
    structure: StructureMotion | None = None
    other: Other | None = None
    sources: list[Source] = field(default_factory=list)
    texts: list[tuple[str, str]] = field(default_factory=list)
    pictures: Pictures = field(default_factory=Pictures)

    @property
    def struck(self) -> bool:
        """Is the result of a hammer test in files?"""
        return is_struck(self.result)

    @property
    def channels(self) -> list[str]:
        """Of the records, in their order: a hammer has one force, wherever it struck."""
        force = [(struck_at(self.result.inputs[0]) or ("", 0))[0]] if self.struck else self.result.inputs
        return force + self.result.outputs

    @property
    def needs_record(self) -> str:
        """What to do for a picture that takes the record."""
        if self.result.raw.get("set_ups"):
            return "needs a record of all sensors: see the report of each set-up"
        if self.result.raw.get("responses"):
            return "needs the responses: run okid-report again with --record RESPONSES"
        if self.struck:
            why = f" ({self.no_record})" if self.no_record else ""
            return f"needs the records of the hits{why}: run okid-report again with --record FILE ..."
        return "needs the record: run okid-report again with --record FILE.csv"

    def unit(self, name: str) -> str:
        """Unit of a channel as the record or the run had it, "m/s²" for "m/s^2", "" when nothing says so."""
        record = None if self.measured is None else self.measured.record
        channels = {} if self.events is None else self.events.channels
        unit = str(channels.get(name, {}).get("unit") or "")
        if record is not None:
            struck = name in self.result.inputs and self.struck
            unit = record.units[0 if struck else self.channels.index(name)] or unit
        return unit.replace("^2", "²").replace("^3", "³")

    def with_unit(self, name: str) -> str:
        """The name as an axis takes it, its unit in a second line when it is known."""
        unit = self.unit(name)
        return figures.short(name, 14) + (f"\n[{figures.short(unit, 14)}]" if unit else "")
