# SPDX-License-Identifier: MIT
"""Records as CSV files that `okid identify`, spreadsheets and read_csv() read."""

from __future__ import annotations

import json
import re
from pathlib import Path

from okid._errors import InputError
from okid.data.records import Record, unit_of_name
from okid.data.whole_file import whole_file

_ROWS = 65536


def _header(name: str, unit: str) -> str:
    """The name with its unit as `okid identify` takes it; "[]" where it would see one that is not there."""
    full = name if unit_of_name(name) == unit else f"{name} [{unit}]"
    if re.fullmatch(r"[\w .+\-/^*\[\]()°²µ]+", full):
        return full
    return '"' + full.replace('"', '""') + '"'


def _without_rate(text: str) -> str:
    """JSON of the same value in which no reader finds a sample rate: a title may hold "fs_hz: 5"."""
    return re.sub(r"(?i)(fs|sample_rate)_hz", r"\1\\u005fhz", text)


def write_csv(path: str | Path, record: Record) -> None:
    """Write a record as CSV: comments, one line of names with units, numbers that read back to the same bits.

    `# fs_hz:` holds the rate, a `# okid:` line everything else (title, start time, roles, dofs, notes). NaN is `nan`.
    About 4 s for 10^6 rows of 4 channels, and 2 s to read them. InputError when the file cannot be written.
    """
    about = record.about()
    names, units = record.labels()
    heads = [_header(name, unit) for name, unit in zip(names, units, strict=True)]
    if len(set(heads)) != len(heads):
        raise InputError(f"{path}: two channels would have the same header with their units: {', '.join(heads)}")
    rate = about.pop("fs_hz")
    with whole_file(path) as part, part.open("w", encoding="utf-8", newline="\n") as out:
        if rate is not None:
            out.write(f"# fs_hz: {rate!r}\n")
        out.write(f"# okid: {_without_rate(json.dumps(about))}\n")
        out.write(",".join(heads) + "\n")
        for first in range(0, len(record.samples), _ROWS):
            rows = record.samples[first : first + _ROWS].tolist()
            out.write("\n".join([",".join(map(repr, row)) for row in rows]) + "\n")
