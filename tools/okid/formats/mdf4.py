# SPDX-License-Identifier: MIT
"""MDF 4 (.mf4) through asammdf: records out, and channels of one raster in."""

from __future__ import annotations

import contextlib
import gc
import json
import logging
import re
import sys
from collections.abc import Iterator
from datetime import UTC, datetime
from html import unescape
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from okid._errors import InputError
from okid.data.input_file import parse_json
from okid.data.memory import require_samples
from okid.data.records import Record, even_rate
from okid.formats.foreign_library import library, reading, writing
from okid.formats.mdf4_blocks import check_mdf4
from okid.formats.rasters import Raster, choose_raster, sort_in

Real = NDArray[np.float64]
_MARK = "okid record "


def write_mdf4(path: str | Path, record: Record) -> None:
    """Write a record as MDF 4.10: one channel group, float64 channels with units, a time channel n / fs.

    Title, start time and everything else that about() gives stand in the header's comment. A file without a known
    start begins at 1970-01-01. About 1 s for 10^6 samples of 4 channels. InputError when the rate is not known,
    asammdf is missing or the file cannot be written.
    """
    asammdf = library("asammdf", "MDF")
    if record.fs_hz is None:
        raise InputError(f"{path}: MDF needs a sample rate and the record has none: give fs_hz (okid-convert --fs)")
    about = record.about()
    times = np.arange(len(record.samples)) / record.fs_hz
    with writing(path) as part, asammdf.MDF(version="4.10") as file:
        file.header.start_time = record.start_time or datetime(1970, 1, 1, tzinfo=UTC)
        file.header.comment = f"{record.title}\n{_MARK}{json.dumps(about)}".lstrip("\n")
        signals = [
            asammdf.Signal(np.ascontiguousarray(column), times, unit=unit, name=name)
            for column, name, unit in zip(record.samples.T, about["names"], about["units"], strict=True)
        ]
        file.append(signals, acq_name="okid", comment="okid", common_timebase=True)
        saved = Path(file.save(part, overwrite=True, compression=1))
        if saved != part:  # asammdf puts its own extension on names it does not like
            saved.replace(part)


def _samples(signal: Any) -> Real | None:
    """A channel as float64, NaN where its invalidation bit is set; None when it holds no numbers."""
    values = np.asarray(signal.samples)
    if values.ndim != 1 or values.dtype.kind not in "fiub":
        return None
    column: Real = values.astype(np.float64)
    invalid = signal.invalidation_bits
    if invalid is not None:
        column[np.asarray(invalid, dtype=bool)] = np.nan
    return column


def _rasters(file: Any, remarks: list[str]) -> list[Raster]:
    found: list[Raster] = []
    require_samples(sum(int(g.channel_group.cycles_nr) * max(1, len(g.channels)) for g in file.groups), 1)
    for number, group in enumerate(file.groups):
        master = file.masters_db.get(number)
        for place, channel in enumerate(group.channels):
            if str(channel.name).startswith(("CAN_DataFrame", "CAN_ErrorFrame", "CAN_RemoteFrame")):
                raise InputError(
                    "holds CAN frames, not samples: convert it to a log first (okid-convert IN.mf4 OUT.log)"
                )
            if place == master:
                continue
            signal = file.get(group=number, index=place, ignore_invalidation_bits=True)
            column = _samples(signal)
            if column is None:
                remarks.append(f"{channel.name} is left out: it holds no numbers")
            elif len(column):
                sort_in(found, str(channel.name), str(signal.unit or ""), np.asarray(signal.timestamps, float), column)
    return found


def _own_words(comment: str) -> dict[str, Any] | None:
    """What write_mdf4() put into the header's comment."""
    found = re.search(_MARK + r"(\{.*\})", unescape(comment))
    if found is None:
        return None
    try:
        about = parse_json(found.group(1))
    except ValueError:
        return None
    return about if isinstance(about, dict) else None


def _record(file: Any, group: int | str | None) -> Record:
    remarks: list[str] = []
    raster = choose_raster(_rasters(file, remarks), group)
    samples, about = np.column_stack(raster.columns), _own_words(str(file.header.comment or ""))
    if about is not None and about.get("names") == raster.names and about.get("units") == raster.units:
        return Record.described(samples, about, remarks)
    rate = even_rate(raster.times_s)
    if isinstance(rate, str):
        raise InputError(f"{raster.names[0]}: {rate}; okid does not resample")
    start = file.header.start_time
    known = isinstance(start, datetime) and start.tzinfo is not None and start.timestamp() > 0.0
    return Record(raster.names, samples, rate, raster.units, start_time=start if known else None, remarks=remarks)


@contextlib.contextmanager
def quiet_asammdf() -> Iterator[None]:
    """What asammdf prints over a damaged file stays unprinted: the InputError says it.

    A reader that fails while it opens a file also fails in its finalizer, where no caller can catch it.
    """
    before, log = sys.unraisablehook, logging.getLogger("asammdf")
    level = log.level
    sys.unraisablehook = lambda _what: None
    log.setLevel(logging.CRITICAL + 1)
    try:
        yield
    finally:
        sys.unraisablehook = before
        log.setLevel(level)


def _open(asammdf: Any, path: str | Path) -> Any:
    check_mdf4(path)
    text = None
    try:
        return asammdf.MDF(path)
    except Exception as fault:  # asammdf raises almost anything over a damaged file
        text = f"{type(fault).__name__}: {' '.join(str(fault).split())[:160]}"
    gc.collect()  # only now nothing refers to the half-open reader
    raise InputError(f"not an MDF 4 file, or damaged: {text}")


def read_mdf4(path: str | Path, group: int | str | None = None) -> Record:
    """Read the channels of an MDF file that share one raster; samples with their invalidation bit set are NaN.

    Several rasters: an InputError lists them with numbers, `group` chooses one. Nothing is resampled: uneven time
    stamps are an InputError. A bus log (CAN frames) is one too, with the way to convert it.
    """
    asammdf = library("asammdf", "MDF")
    with reading(path, "an MDF 4 file"), quiet_asammdf(), _open(asammdf, path) as file:
        return _record(file, group)


def holds_frames(path: str | Path) -> bool:
    """Whether an .mf4 file is a log of CAN frames. InputError when it cannot be read."""
    asammdf = library("asammdf", "MDF")
    with reading(path, "an MDF 4 file"), quiet_asammdf(), _open(asammdf, path) as file:
        return any(str(c.name).startswith("CAN_DataFrame") for group in file.groups for c in group.channels)
