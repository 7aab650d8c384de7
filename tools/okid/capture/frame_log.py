# SPDX-License-Identifier: MIT
"""Frames out of a file: a log of any kind that okid-convert reads (candump .log, BLF, ASC, TRC, MF4 ..)."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import islice
from pathlib import Path

import can

from okid._errors import InputError
from okid.capture.config import CaptureConfig
from okid.formats.can_log import read_log
from okid.formats.log_names import is_frame_csv

_LOOK_AHEAD = 20000  # frames that tell which interfaces a log has
_SAMPLES = (".csv", ".uff", ".unv", ".h5", ".hdf5", ".mat", ".parquet")


def log_messages(path: str | Path, remarks: list[str] | None = None) -> Iterator[can.Message]:
    """Every frame, in the order of the file; `channel` is an interface name ("can0" where the file has a number).

    remarks: gets what could not be read and was left out. Raises InputError that names the file and the line or frame:
    a file that is cut off or damaged gives what stands before the damage, then that. About 10 us a frame.
    """
    name = Path(path)
    if name.suffix.lower() in _SAMPLES and name.is_file() and not is_frame_csv(name):
        table = name if name.suffix.lower() == ".csv" else name.with_suffix(".csv")
        first = "" if table == name else f"okid-convert {name} {table}, then "
        raise InputError(
            f"{name}: holds samples, expected CAN frames; identify samples with {first}okid identify {table}"
        )
    return read_log(path, remarks)


def messages_for(path: str | Path, config: CaptureConfig, remarks: list[str] | None = None) -> Iterator[can.Message]:
    """Those of a log that belong to the config: `channel` of each is then the interface of a [[bus]].

    A log with one interface feeds the only CAN bus, as with `okid replay`. Raises InputError when none fits.
    """
    wanted = {bus.interface for bus in config.buses if not bus.serial}
    there = list(dict.fromkeys(str(message.channel) for message in islice(log_messages(path), _LOOK_AHEAD)))
    if wanted & set(there) or not there:
        return (message for message in log_messages(path, remarks) if str(message.channel) in wanted)
    if len(wanted) == 1 and len(there) == 1:
        return _renamed(path, wanted.pop(), remarks)
    raise InputError(
        f"{path}: found frames of {', '.join(there)}, "
        f"expected an interface of {config.path}: {', '.join(sorted(wanted))}"
    )


def _renamed(path: str | Path, interface: str, remarks: list[str] | None) -> Iterator[can.Message]:
    for message in log_messages(path, remarks):
        message.channel = interface
        yield message
