# SPDX-License-Identifier: MIT
"""Frames of CAN buses as an MDF 4 bus log, in the layout of ASAM's bus logging that python-can and asammdf read.

python-can's own writer appends frame by frame at about 0.6 ms each and dates the file with the clock of the writing
computer; here the three groups are appended whole, and the file begins with its first frame.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterable
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from okid._errors import InputError
from okid.formats.foreign_library import library

if TYPE_CHECKING:
    import can

_DATA, _ERROR, _REMOTE = "CAN_DataFrame", "CAN_ErrorFrame", "CAN_RemoteFrame"
_LENGTHS = (0, 1, 2, 3, 4, 5, 6, 7, 8, 12, 16, 20, 24, 32, 48, 64)  # of the length codes of CAN FD


def _dtype(group: str) -> np.dtype[Any]:
    fields: list[Any] = [("BusChannel", "<u1"), ("ID", "<u4"), ("IDE", "<u1"), ("DLC", "<u1"), ("DataLength", "<u1")]
    if group != _REMOTE:
        fields.append(("DataBytes", "(64,)u1"))
    fields.append(("Dir", "<u1"))
    if group != _REMOTE:
        fields += [("EDL", "<u1"), ("BRS", "<u1"), ("ESI", "<u1")]
    return np.dtype([(f"{group}.{name}", *rest) for name, *rest in fields])


def bus_number(channel: Any) -> int:
    """The number at the end of an interface name, 0 without one: how MDF and BLF name buses."""
    found = re.search(r"(\d+)$", str(channel))
    return int(found.group(1)) & 0xFF if found else 0


def _row(frame: can.Message, group: str) -> tuple[Any, ...]:
    length = len(frame.data or b"")
    code = frame.dlc if group == _REMOTE or not frame.is_fd else _LENGTHS.index(length)
    head = (bus_number(frame.channel), frame.arbitration_id, frame.is_extended_id, code, length)
    way = 0 if frame.is_rx else 1
    if group == _REMOTE:
        return (*head, way)
    data = np.zeros(64, dtype=np.uint8)
    data[:length] = np.frombuffer(bytes(frame.data), dtype=np.uint8)
    return (*head, data, way, frame.is_fd, frame.bitrate_switch, frame.error_state_indicator)


def write_bus_mdf4(part: Path, frames: Iterable[can.Message]) -> None:
    """Write frames as an MDF 4.10 bus log; all are held in memory. InputError when asammdf is missing."""
    asammdf = library("asammdf", "MDF")
    blocks, constants = library("asammdf.blocks.v4_blocks", "MDF"), library("asammdf.blocks.v4_constants", "MDF")
    rows: dict[str, list[tuple[Any, ...]]] = {_DATA: [], _ERROR: [], _REMOTE: []}
    stamps: dict[str, list[float]] = {_DATA: [], _ERROR: [], _REMOTE: []}
    for number, frame in enumerate(frames, 1):
        if frame.is_fd and len(frame.data) not in _LENGTHS:
            raise InputError(f"frame {number} is CAN FD with {len(frame.data)} bytes, expected 0-8, 12, 16 .. 64")
        group = _ERROR if frame.is_error_frame else _REMOTE if frame.is_remote_frame else _DATA
        rows[group].append(_row(frame, group))
        stamps[group].append(frame.timestamp)
    first = min((times[0] for times in stamps.values() if times), default=0.0)
    begin = math.floor(first) if first > 0.0 else 0
    source = blocks.SourceInformation(source_type=constants.SOURCE_BUS, bus_type=constants.BUS_TYPE_CAN)
    with asammdf.MDF(version="4.10") as file:
        file.header.start_time = datetime.fromtimestamp(begin, UTC)
        for group in (_DATA, _ERROR, _REMOTE):
            samples = np.array(rows[group], dtype=_dtype(group))
            times = np.array(stamps[group], dtype=np.float64) - begin
            file.append(asammdf.Signal(name=group, samples=samples, timestamps=times, source=source))
        saved = Path(file.save(part, overwrite=True, compression=1))
        if saved != part:
            saved.replace(part)
