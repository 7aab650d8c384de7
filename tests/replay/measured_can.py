# SPDX-License-Identifier: MIT
"""Measured CSV records as CAN frames: a DBC and a CONFIG.toml for any list of columns, in the layout of okid.dbc."""

import csv
import pathlib
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True)
class Record:
    names: list[str]
    values: NDArray[np.float64]  # samples x columns


def load(path: pathlib.Path, columns: list[str]) -> Record:
    """Read the named columns of a CSV with `#` comment lines and one header line."""
    with path.open(newline="") as file:
        rows = csv.reader(line for line in file if not line.startswith("#"))
        header = next(rows)
        pick = [header.index(name) for name in columns]
        values = [[float(row[k]) for k in pick] for row in rows]
    return Record(columns, np.array(values))


def scale_of(column: NDArray[np.float64]) -> float:
    """Least significant bit of a 16-bit channel with a tenth of headroom over the record."""
    return float(np.abs(column).max()) * 1.1 / 32767


def write_dbc(path: pathlib.Path, record: Record) -> dict[str, tuple[str, str]]:
    """Messages of a 16-bit counter and three 16-bit channels; returns channel -> (message, signal)."""
    lines = ['VERSION ""', "", "NS_ :", "", "BS_:", "", "BU_: DAQ", ""]
    place = {}
    for first in range(0, len(record.names), 3):
        number = first // 3
        message = f"Block{number}"
        lines.append(f"BO_ {0x100 + number} {message}: 8 DAQ")
        lines.append(' SG_ Counter : 0|16@1+ (1,0) [0|65535] "" Vector__XXX')
        for slot, name in enumerate(record.names[first : first + 3]):
            signal = f"Channel{slot}"
            place[name] = (message, signal)
            scale = scale_of(record.values[:, first + slot])
            lines.append(f' SG_ {signal} : {16 * (slot + 1)}|16@1- ({scale!r},0) [0|0] "" Vector__XXX')
        lines.append("")
    path.write_text("\n".join(lines))
    return place


def write_config(path: pathlib.Path, record: Record, inputs: int, rate_hz: float, settings: str) -> None:
    """The first `inputs` columns are forces, the others accelerations; `settings` is the [identification] table."""
    place = write_dbc(path.with_suffix(".dbc"), record)
    lines = [f"[acquisition]\nrate_hz = {rate_hz!r}\n"]
    lines.append(
        f'[[bus]]\nname = "can0"\ntype = "socketcan"\ninterface = "vcan0"\ndbc = "{path.with_suffix(".dbc").name}"\n'
    )
    for k, name in enumerate(record.names):
        message, signal = place[name]
        role, unit = ("force", "N") if k < inputs else ("acceleration", "m/s^2")
        lines.append(
            f'[[channel]]\nname = "{name}"\nrole = "{role}"\nunit = "{unit}"\nbus = "can0"\n'
            f'message = "{message}"\nsignal = "{signal}"\nsequence = "Counter"\n'
        )
    lines.append("[identification]\n" + settings)
    path.write_text("\n".join(lines))


def write_csv(path: pathlib.Path, record: Record, rate_hz: float) -> None:
    with path.open("w") as file:
        file.write(f"# fs_hz: {rate_hz!r}\n" + ",".join(record.names) + "\n")
        np.savetxt(file, record.values, delimiter=",", fmt="%.17g")
