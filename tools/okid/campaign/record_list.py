# SPDX-License-Identifier: MIT
"""The records of a campaign: patterns and URLs expanded, with time, temperature and keys of each one."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator
from dataclasses import dataclass, field
from datetime import UTC, datetime
from pathlib import Path, PurePosixPath
from typing import Any

from okid._errors import InputError
from okid.campaign.file_systems import is_remote, opened
from okid.campaign.spec import CampaignSpec
from okid.campaign.spec_keys import Place, nearest

EXTENSIONS = (".npy", ".okj", ".log", ".csv", ".uff", ".unv", ".mf4", ".h5", ".hdf5", ".mat", ".parquet")
_FIRST_S, _LAST_S = -62135596800, 253402300799  # years 1 to 9999
_STAMPS = ("ETag", "etag", "mtime", "LastModified", "last_modified", "updated", "created")


@dataclass(frozen=True)
class RecordRef:
    """A record that was not opened yet. `name`: path from the spec's folder, or URL; `url`: what fsspec opens.

    `stamp` changes with the content as far as the file system tells; `time_s` seconds since 1970 or None.
    """

    name: str
    url: str
    size: int
    stamp: str
    time_s: float | None = None
    temperature_c: float | None = None
    keys: dict[str, str] = field(default_factory=dict, hash=False, compare=False)


@dataclass(frozen=True)
class Skipped:
    """A record that is left out, and why, in one line. `lasting`: its content is at fault, not the way to it."""

    name: str
    reason: str
    lasting: bool = False


def _stamp(info: dict[str, Any]) -> str:
    return "|".join([str(info.get("size")), *(str(info[key]) for key in _STAMPS if key in info)])


def _expanded(spec: CampaignSpec, pattern: str) -> Iterator[tuple[str, str, dict[str, Any]]]:
    """Name, URL and what the file system says of every file of a pattern."""
    remote = is_remote(pattern)
    try:
        fs = opened(pattern, spec.records.storage)
        found = fs.glob(pattern if remote else str((spec.base / pattern).absolute()), detail=True)
    except (OSError, ValueError, ImportError) as fault:
        text = " ".join(str(fault).split())[:200]
        raise InputError(f'{spec.path}: [records], key "files": {pattern!r}: {text}') from None
    base = spec.base.absolute()
    for path, info in found.items():
        if info.get("type") == "directory":
            continue
        if not remote:
            here = Path(path)
            name = here.relative_to(base).as_posix() if here.is_relative_to(base) else here.as_posix()
            yield name, path, info
        else:
            url = fs.unstrip_protocol(path)
            yield url, url, info


def _listed(spec: CampaignSpec) -> list[RecordRef]:
    place = Place(spec.path, spec.path.read_text("utf-8"), "records")
    out: dict[str, RecordRef] = {}
    for pattern in spec.records.files:
        before = len(out)
        for name, url, info in _expanded(spec, pattern):
            if PurePosixPath(name).suffix.lower() in EXTENSIONS:
                out.setdefault(name, RecordRef(name, url, int(info.get("size") or 0), _stamp(info)))
            else:
                place.refuse("files", f"{pattern!r} finds {name}, expected one of {', '.join(EXTENSIONS)}")
        if len(out) == before and before == 0 and len(spec.records.files) == 1:
            place.refuse("files", f"{pattern!r} finds no file")
    if not out:
        place.refuse("files", "the patterns find no file")
    return [out[name] for name in sorted(out)]


def _seconds(value: Any) -> float | None:
    """Seconds since 1970 of what an index holds; a time without a zone is UTC."""
    if value is None or (isinstance(value, float) and math.isnan(value)):
        return None
    if isinstance(value, int | float):
        if not _FIRST_S <= value <= _LAST_S:
            raise ValueError(f"{value!r} s since 1970")
        return float(value)
    if isinstance(value, str):
        value = datetime.fromisoformat(value)
    given: datetime = value.to_pydatetime() if hasattr(value, "to_pydatetime") else value
    return (given if given.tzinfo else given.replace(tzinfo=UTC)).timestamp()


def _index_rows(spec: CampaignSpec) -> dict[str, dict[str, Any]]:
    """The rows of the index by path and, where that is unique, by the file's own name."""
    import pandas as pd

    assert spec.records.index is not None
    path = spec.base / spec.records.index
    try:
        table = pd.read_parquet(path) if path.suffix.lower() == ".parquet" else pd.read_csv(path)
    except Exception as fault:  # pandas and pyarrow share no base class
        raise InputError(f"{path}: no table of records: {' '.join(str(fault).split())[:160]}") from None
    needed = {"index_path": spec.records.index_path}
    needed |= {"index_time": spec.records.index_time} if spec.records.time == "index" else {}
    if spec.temperature.column is not None:
        needed["column"] = spec.temperature.column
    for key, column in needed.items():
        if column not in table.columns:
            hint = nearest(column, [str(name) for name in table.columns])
            raise InputError(f'{path}: no column "{column}" ({key} of {spec.path.name}){hint}')
    rows: dict[str, dict[str, Any]] = {}
    for row in table.to_dict("records"):
        own = str(row[spec.records.index_path]).replace("\\", "/")
        rows.setdefault(own, row)
        rows.setdefault(PurePosixPath(own).name, row)
    return rows


def _of_index(
    spec: CampaignSpec, ref: RecordRef, row: dict[str, Any]
) -> tuple[float | None, float | None, dict[str, str]]:
    time_s, temperature = ref.time_s, None
    if spec.records.time == "index":
        try:
            time_s = _seconds(row[spec.records.index_time])
        except (ValueError, TypeError, OverflowError):
            raise InputError(
                f"its time in the index is {row[spec.records.index_time]!r}, expected a date and time"
            ) from None
    if spec.temperature.column is not None:
        given = row[spec.temperature.column]
        temperature = float(given) if isinstance(given, int | float) and math.isfinite(given) else None
    known = {spec.records.index_path, spec.records.index_time, spec.temperature.column}
    return time_s, temperature, {str(k): str(v) for k, v in row.items() if k not in known}


def _described(spec: CampaignSpec, ref: RecordRef, rows: dict[str, dict[str, Any]] | None) -> RecordRef:
    """The record with time, temperature and keys. InputError says what is missing."""
    keys: dict[str, str] = {}
    time_s: float | None = None
    temperature: float | None = None
    if spec.records.name is not None:
        found = re.search(spec.records.name, ref.name)
        if found is None:
            raise InputError(f"its name does not match {spec.records.name!r}")
        keys = {key: value or "" for key, value in found.groupdict().items() if key != "time"}
        if spec.records.time == "name":
            text = found["time"]
            try:
                given = datetime.strptime(text, spec.records.time_format)
            except ValueError:
                raise InputError(f"its time {text!r} is not {spec.records.time_format!r}") from None
            time_s = (given if given.tzinfo else given.replace(tzinfo=UTC)).timestamp()
    if rows is not None:
        row = rows.get(ref.name) or rows.get(PurePosixPath(ref.name).name)
        if row is None:
            raise InputError(f"it is not in the index {spec.records.index}")
        stated, temperature, more = _of_index(spec, ref, row)
        keys = more | keys
        time_s = stated if spec.records.time == "index" else time_s
    if spec.records.time == "modified":
        time_s = _modified(ref)
    if time_s is None:
        raise InputError("its time is not known")
    return RecordRef(ref.name, ref.url, ref.size, ref.stamp, time_s, temperature, keys)


def _modified(ref: RecordRef) -> float | None:
    """When the file was written, as the file system says."""
    for part in ref.stamp.split("|")[1:]:
        try:
            return _seconds(float(part))
        except ValueError:
            try:
                return _seconds(part)
            except (ValueError, OverflowError):
                continue
    return None


def list_records(spec: CampaignSpec) -> tuple[list[RecordRef], list[Skipped]]:
    """All records in the order of time and name, and those that cannot be placed. O(files) calls of the file system.

    Raises InputError when a pattern finds nothing, or the index cannot be read.
    """
    rows = None if spec.records.index is None else _index_rows(spec)
    good: list[RecordRef] = []
    bad: list[Skipped] = []
    for ref in _listed(spec):
        try:
            good.append(_described(spec, ref, rows))
        except InputError as fault:
            bad.append(Skipped(ref.name, str(fault)))
    good.sort(key=lambda ref: (ref.time_s if ref.time_s is not None else 0.0, ref.name))
    return good, bad
