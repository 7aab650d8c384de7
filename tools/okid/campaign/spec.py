# SPDX-License-Identifier: MIT
"""SPEC.toml: what a campaign reads, how it groups and identifies, where it writes; checked whole before any record."""

from __future__ import annotations

import hashlib
import json
import re
import tomllib
from dataclasses import asdict, dataclass, field, replace
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from okid._errors import InputError
from okid.campaign.file_systems import is_remote, protocol_of, storage_fault
from okid.campaign.spec_keys import Place, check_keys, nearest
from okid.data.input_file import parse_toml, read_input

GROUPS, FEWEST = 20, 8  # parts that are left out in turn; below 8 a standard deviation says nothing
TIME_KEYS = ("hour", "day", "week", "month", "year")
BAND = "temperature_band"
_ALONE = "record"  # a group key: every record by itself
_ONE_METHOD = ("p", "rows", "order", "max_order", "hankel", "pieces", "stabilization")
_AUTO = ("band", "decimate")
_WHO = ('only "auto" does', 'name one method, such as "okid-era"')


@dataclass(frozen=True)
class Channels:
    """Channels of every record. `columns`: of arrays without names (.npy); value = scale code + offset."""

    inputs: tuple[str, ...]
    outputs: tuple[str, ...]
    columns: tuple[str, ...]
    fs_hz: float
    codes: int
    scale: tuple[float, ...]
    offset: tuple[float, ...]
    saturated: str

    @property
    def names(self) -> tuple[str, ...]:
        """Inputs, then outputs."""
        return self.inputs + self.outputs


@dataclass(frozen=True)
class Identification:
    """[identification]: as in CONFIG.toml; `pieces` a record is cut into for the standard deviations.

    Method "auto" looks at the samples and not at sums: it has neither orders nor pieces, but `band` and `decimate`."""

    method: str = "auto"
    p: int = 40
    rows: int = 0
    order: int = 0
    max_order: int = 0
    hankel: str = "system"
    detrend: str = "mean"
    sigma_blocks: int = GROUPS
    pieces: int = 1
    stabilization: bool = True
    band: tuple[float, ...] = ()
    decimate: int = 0
    refine: str = ""


@dataclass(frozen=True)
class Sources:
    """[records]: patterns and how the time and the keys of a record are found."""

    files: tuple[str, ...]
    name: str | None = None
    time_format: str = "%Y%m%dT%H%M%S"
    time: str = "modified"
    index: str | None = None
    index_path: str = "path"
    index_time: str = "time"
    config: str | None = None
    storage: dict[str, Any] = field(default_factory=dict)


@dataclass(frozen=True)
class Temperature:
    """Of a channel (mean over the record, scale code + offset) or of a column of the index; neither: not known."""

    channel: str | None = None
    scale: float = 1.0
    offset: float = 0.0
    column: str | None = None


@dataclass(frozen=True)
class Trend:
    """[trend]: training period, false alarms, which modes are good enough to be followed."""

    training_until: datetime | None = None
    training_share: float = 0.25
    false_alarm_per_year: float = 0.05
    min_mpc: float = 0.8
    max_damping: float = 0.2
    series: tuple[str, ...] | None = None
    seed: int = 1
    temperature_order: int | str = "auto"
    change_test: bool = False


@dataclass(frozen=True)
class CampaignSpec:
    """One campaign. `by`: keys of a group; `workers`, `address`: the cluster; `keep`: what stays on disk of a group."""

    path: Path
    title: str
    structure: str
    records: Sources
    channels: Channels
    identification: Identification
    by: tuple[str, ...]
    band_c: float
    temperature: Temperature
    trend: Trend
    folder: Path
    keep: str
    batch_bytes: int
    workers: int
    address: str | None
    memory_mb: float
    plan: bytes = b""  # of the sums for a refinement

    @property
    def base(self) -> Path:
        """What relative paths in the file are relative to."""
        return self.path.parent

    @property
    def refines(self) -> bool:
        """Are correlation sums kept beside the others?"""
        return self.identification.method != "auto" and self.identification.refine in ("auto", "yes")

    @property
    def sums_key(self) -> str:
        """Hash of everything that the sums of a record depend on."""
        i = self.identification
        lags = {"method": i.method, "p": i.p, "rows": i.rows, "pieces": i.pieces, "blocks": i.sigma_blocks}
        if self.refines:
            lags["order"] = i.order, i.max_order
        if i.method == "auto":
            lags = {"method": i.method, "blocks": i.sigma_blocks, "band": i.band, "decimate": i.decimate}
        config = None
        if self.records.config is not None:
            config = hashlib.sha256((self.base / self.records.config).read_bytes()).hexdigest()
        return _digest(
            [3, asdict(self.channels), lags, i.detrend, i.hankel, self.temperature.channel, config,
             self.temperature.scale, self.temperature.offset]
        )  # fmt: skip

    @property
    def model_key(self) -> str:
        """Hash of everything that the modes of given sums depend on."""
        unset = _AUTO if self.identification.refine else (*_AUTO, "refine")
        own = {key: value for key, value in asdict(self.identification).items() if key not in unset}
        return _digest([self.sums_key, own])


def _digest(value: Any) -> str:
    return hashlib.sha256(json.dumps(value, sort_keys=True, default=list).encode()).hexdigest()[:16]


def load_spec(path: str | Path, **changes: Any) -> CampaignSpec:
    """Read and check a SPEC.toml; `changes` replace attributes of the result (workers, address, folder).

    Raises InputError that names file, line, key, what was found and what was expected.
    """
    source = Path(path)
    try:
        text = read_input(source).decode("utf-8")
        file = parse_toml(text)
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as fault:
        raise InputError(f"{source}: not a TOML file: {fault}") from None
    check_keys(source, text, file)
    return replace(_Reader(source, text, file).spec(), **changes)


class _Reader:
    """The sections of a file whose keys are known and in range, and what must hold between them."""

    def __init__(self, path: Path, text: str, file: dict[str, Any]) -> None:
        self.path, self.text, self.file = path, text, file

    def place(self, section: str) -> Place:
        return Place(self.path, self.text, section)

    def table(self, section: str) -> dict[str, Any]:
        return dict(self.file.get(section, {}))

    def spec(self) -> CampaignSpec:
        campaign, output, cluster = self.table("campaign"), self.table("output"), self.table("cluster")
        records = self.records()
        temperature = self.temperature(records)
        by, band = self.group(records, temperature)
        identification, trend = self.identification(by), self.trend(by)
        if trend.change_test and identification.method == "auto":
            self.place("trend").refuse("change_test", 'method "auto" keeps no sums: name a method, such as "okid-era"')
        return CampaignSpec(
            path=self.path, title=campaign.get("title", self.path.stem),
            structure=campaign.get("structure", "structure"),
            records=records, channels=self.channels(temperature), identification=identification, by=by,
            band_c=band, temperature=temperature, trend=trend,
            folder=self.path.parent / output.get("folder", f"{self.path.stem}.campaign"),
            keep=output.get("keep", "auto"), batch_bytes=round(1e6 * output.get("batch_mb", 128)),
            workers=cluster.get("workers", 2), address=cluster.get("address"), memory_mb=cluster.get("memory_mb", 2000),
        )  # fmt: skip

    def records(self) -> Sources:
        table, place = self.table("records"), self.place("records")
        if not table.get("files"):
            place.refuse("files" if "files" in table else None, 'key "files" is missing or empty, expected patterns')
        if "name" in table:
            try:
                names = re.compile(table["name"]).groupindex
            except re.error as fault:
                place.refuse("name", f"found {table['name']!r}, which is no regular expression: {fault}")
            if not names:
                place.refuse("name", "found no named group, expected at least one like (?P<time>[0-9T]+)")
        way = "name" if "time" in self.name_groups(table) else "index" if "index" in table else "modified"
        way = table.setdefault("time", way)
        if way == "name" and "time" not in self.name_groups(table):
            place.refuse("time", 'found "name", but key "name" has no group (?P<time>...)')
        if way == "index" and "index" not in table:
            place.refuse("time", 'found "index", but there is no key "index"')
        for key in ("index", "config"):
            if key in table and not (self.path.parent / table[key]).is_file():
                place.refuse(key, f"found {table[key]!r}, expected a file: {self.path.parent / table[key]} is none")
        self.check_places(table, place)
        table["files"] = tuple(table["files"])
        return Sources(**table)

    @staticmethod
    def check_places(table: dict[str, Any], place: Place) -> None:
        """Only file systems that run no code of a file, with options that do not either."""
        for pattern in filter(is_remote, table["files"]):
            try:
                protocol = protocol_of(pattern)
            except InputError as fault:
                place.refuse("files", f"found {pattern!r}: {fault}")
            if wrong := storage_fault(protocol, table.get("storage", {})):
                place.refuse("storage", wrong)

    @staticmethod
    def name_groups(table: dict[str, Any]) -> tuple[str, ...]:
        return tuple(re.compile(table["name"]).groupindex) if "name" in table else ()

    def channels(self, temperature: Temperature) -> Channels:
        table, place = self.table("channels"), self.place("channels")
        inputs, outputs = tuple(table.get("inputs", ())), tuple(table.get("outputs", ()))
        if not outputs:
            place.refuse("outputs" if "outputs" in table else None, 'key "outputs" is missing or empty, expected names')
        if "fs_hz" not in table:
            place.refuse(None, 'key "fs_hz" is missing, expected the sample rate of the records in Hz')
        names = inputs + outputs
        if len(set(names)) != len(names):
            place.refuse("outputs", f"a channel stands twice in {list(names)}")
        extra = () if temperature.channel is None or temperature.channel in names else (temperature.channel,)
        columns = tuple(table.get("columns", names + extra))
        for name in names + extra:
            if name not in columns:
                place.refuse("columns", f"{name!r} is not among them{nearest(name, columns)}")
        if len(set(columns)) != len(columns):
            place.refuse("columns", f"a column stands twice in {list(columns)}")
        codes = table.get("codes", 16 if "scale" in table else 0)
        if codes and "scale" not in table:
            place.refuse("codes", f'found {codes}, but key "scale" is missing: value = scale code + offset')
        return Channels(
            inputs, outputs, columns, float(table["fs_hz"]), codes,
            self.factors("scale", len(names), 1.0), self.factors("offset", len(names), 0.0),
            table.get("saturated", "keep"),
        )  # fmt: skip

    def factors(self, key: str, count: int, default: float) -> tuple[float, ...]:
        given = self.table("channels").get(key, [default])
        if len(given) not in (1, count):
            self.place("channels").refuse(
                key, f"found {len(given)} numbers, expected 1 or {count}: inputs, then outputs"
            )
        if key == "scale" and any(value == 0 for value in given):
            self.place("channels").refuse(key, "found 0, expected a factor that is not 0")
        return tuple(float(value) for value in (given * count if len(given) == 1 else given))

    def identification(self, by: tuple[str, ...]) -> Identification:
        table, place = self.table("identification"), self.place("identification")
        if table.get("order") == "auto":
            del table["order"]
        single = [key for key in _ONE_METHOD if key in table]
        method = table.setdefault("method", "okid-era" if single else "auto")
        for key in single if method == "auto" else [key for key in _AUTO if key in table]:
            place.refuse(key, f'method "{method}" does not have it: {_WHO[method == "auto"]}')
        if table.get("refine") in ("auto", "yes") and not self.table("channels").get("inputs"):
            place.refuse("refine", 'a refinement needs a measured force: [channels] has no "inputs"')
        band = table["band"] = tuple(table.get("band", ()))
        if band and not (len(band) == 2 and 0 <= band[0] < band[1]):
            place.refuse("band", f"found {list(band)}, expected [lowest, highest] in Hz")
        blocks = table.get("sigma_blocks", GROUPS)
        table.setdefault("pieces", max(1, blocks) if by == (_ALONE,) else 1)
        if method != "auto" and blocks and by == (_ALONE,) and table["pieces"] < FEWEST:
            place.refuse(
                "pieces",
                f"found {table['pieces']}, expected {FEWEST} or more (or sigma_blocks = 0): every record is a group",
            )
        return Identification(**table)

    def group(self, records: Sources, temperature: Temperature) -> tuple[tuple[str, ...], float]:
        table, place = self.table("group"), self.place("group")
        by = tuple(table.get("by", (_ALONE,)))
        known = [*TIME_KEYS, BAND, _ALONE, *(n for n in self.name_groups(self.table("records")) if n != "time")]
        for key in by:
            if key not in known and records.index is None:
                place.refuse("by", f'"{key}" is no key of a record{nearest(key, known)}')
        if len(set(by)) != len(by):
            place.refuse("by", f"a key stands twice in {list(by)}")
        if _ALONE in by and len(by) > 1:
            place.refuse("by", '"record" stands alone: every record is then a group by itself')
        if BAND in by and temperature.column is None:
            place.refuse(
                "by", f'"{BAND}" needs [temperature] column: the mean of a channel is known only after reading'
            )
        return by, float(table.get("band_c", 5.0))

    def temperature(self, records: Sources) -> Temperature:
        table, place = self.table("temperature"), self.place("temperature")
        if "channel" in table and "column" in table:
            place.refuse("column", '"channel" and "column" exclude each other: give one of them')
        if "column" in table and records.index is None:
            place.refuse("column", "a column of the index, but [records] has no index")
        return Temperature(**table)

    def trend(self, by: tuple[str, ...]) -> Trend:
        table, place = self.table("trend"), self.place("trend")
        if "training_until" in table and "training_share" in table:
            place.refuse("training_share", '"training_until" and "training_share" exclude each other')
        if "training_until" in table:
            try:
                given = datetime.fromisoformat(table["training_until"])
            except ValueError:
                place.refuse("training_until", f"found {table['training_until']!r}, expected a date like 2026-04-01")
            table["training_until"] = given if given.tzinfo else given.replace(tzinfo=UTC)
        for name in table.get("series", ()):
            if name not in by:
                place.refuse("series", f"{name!r} is not among the keys of [group]{nearest(name, by)}")
        if "series" in table:
            table["series"] = tuple(table["series"])
        return Trend(**table)
