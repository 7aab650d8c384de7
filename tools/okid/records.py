# SPDX-License-Identifier: MIT
"""Measured records: arrays as the package takes them, and CSV files as `okid identify` reads them."""

from __future__ import annotations

import csv
import io
import math
import re
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from okid._errors import InputError

Real = NDArray[np.float64]


def _one(values: ArrayLike, what: str) -> Real:
    given = np.asarray(values)
    if given.dtype.kind not in "fiub":
        raise InputError(f"{what} is of type {given.dtype}, expected real numbers")
    real = np.array(given, dtype=np.float64)  # a copy: the caller's array is never modified
    if real.ndim == 1:
        real = real[:, None]
    if real.ndim != 2 or real.shape[1] == 0:
        raise InputError(f"{what} has shape {given.shape}, expected (samples, channels)")
    if np.any(np.isinf(real)):
        row, column = np.argwhere(np.isinf(real))[0]
        raise InputError(f"{what} is infinite at sample {row}, channel {column}; use NaN for missing samples")
    return real


def _many(values: ArrayLike | Sequence[ArrayLike], what: str) -> list[Real]:
    if isinstance(values, list | tuple) and values and all(isinstance(v, np.ndarray) for v in values):
        return [_one(v, f"{what}[{k}]") for k, v in enumerate(values)]
    return [_one(values, what)]  # type: ignore[arg-type]


def paired(
    u: ArrayLike | Sequence[ArrayLike] | None, y: ArrayLike | Sequence[ArrayLike]
) -> tuple[list[Real], list[Real]]:
    """Records as two lists of float64 copies (N, n_u) and (N, n_y) of matching lengths; u None = no inputs.

    A list or tuple of NumPy arrays is several records; everything else is one. InputError names what does not fit.
    """
    outputs = _many(y, "y")
    inputs = [np.zeros((len(one), 0)) for one in outputs] if u is None else _many(u, "u")
    if len(inputs) != len(outputs):
        raise InputError(f"u has {len(inputs)} records and y has {len(outputs)}")
    for k, (one, other) in enumerate(zip(inputs, outputs, strict=True)):
        place = f" in record {k}" if len(inputs) > 1 else ""
        if len(one) != len(other):
            raise InputError(f"u has {len(one)} samples and y has {len(other)}{place}")
        if one.shape[1] != inputs[0].shape[1] or other.shape[1] != outputs[0].shape[1]:
            raise InputError(f"the number of channels changes between the records{place}")
    return inputs, outputs


def _base(name: str) -> str:
    """A column name without its unit in brackets, as `okid identify` takes it off: "force1" of "force1 [N]"."""
    return re.split(r"[\[(]", name, maxsplit=1)[0].strip()


class CsvRecord(NamedTuple):
    """A CSV file: column names, samples (N, columns) with NaN for missing ones, sample rate in Hz or None."""

    names: list[str]
    samples: Real
    fs_hz: float | None

    def columns(self, wanted: Sequence[str], source: str) -> Real:
        """The columns of these names, in this order; "force" also finds "force [N]" when no other column is named so.

        InputError lists what the file has.
        """
        found = {name: self._place(name) for name in wanted}
        missing = [name for name, place in found.items() if place is None]
        if missing:
            raise InputError(f"{source}: no column {', '.join(map(repr, missing))}; it has {', '.join(self.names)}")
        return self.samples[:, np.array([found[name] for name in wanted], dtype=np.intp)]

    def _place(self, name: str) -> int | None:
        """The column of this name, else the only one whose name without its unit it is."""
        if name in self.names:
            return self.names.index(name)
        by_base = [k for k, full in enumerate(self.names) if name and _base(full) == name]
        return by_base[0] if len(by_base) == 1 else None


def _separator(header: str) -> str:
    unquoted = re.sub(r'"[^"]*"', "", header)
    return max(";\t,", key=unquoted.count) if any(c in unquoted for c in ";\t,") else ","


def _rate(comments: Sequence[str]) -> float | None:
    for line in comments:
        found = re.search(r"\b(?:fs_hz|sample_rate_hz)\s*[:=]\s*([0-9.][0-9.eE+-]*)", line)
        if found:
            try:
                rate = float(found.group(1))
            except ValueError:
                continue
            if rate > 0.0 and math.isfinite(rate):
                return rate
    return None


def _cell(text: str, comma_decimal: bool, where: str) -> float:
    cleaned = text.strip().strip('"')
    if cleaned == "" or cleaned.lower() == "nan":
        return math.nan
    try:
        value = float(cleaned.replace(",", ".") if comma_decimal else cleaned)
    except ValueError:
        raise InputError(f"{where}: expected a number, found {cleaned!r}") from None
    if math.isinf(value):
        raise InputError(f"{where}: infinite value; leave the cell empty when the sample is missing")
    return value


def _slow(lines: Sequence[str], first: int, names: Sequence[str], separator: str, source: str) -> Real:
    rows = []
    for offset, cells in enumerate(csv.reader(lines, delimiter=separator)):
        if not cells or (len(cells) == 1 and not cells[0].strip() and len(names) > 1):
            continue
        line = first + offset
        if len(cells) != len(names):
            raise InputError(f"{source}:{line}: expected {len(names)} cells, found {len(cells)}")
        rows.append(
            [
                _cell(text, separator == ";", f"{source}:{line}: column {name!r}")
                for name, text in zip(names, cells, strict=True)
            ]
        )
    return np.array(rows, dtype=np.float64).reshape(-1, len(names))


def read_csv(path: str | Path) -> CsvRecord:
    """Read a record: `#` comments first, one header line, comma, semicolon or tab, decimal comma with semicolon.

    `nan` and empty cells are missing samples. The rate comes from a `fs_hz` or `sample_rate_hz` comment, else from a
    `time_s` column. InputError names file, line and column of the first fault.
    """
    source = str(path)
    try:
        text = Path(path).read_bytes().decode("utf-8-sig")
    except OSError as fault:
        raise InputError(f"{source}: {fault.strerror or fault}") from None
    except UnicodeDecodeError as fault:
        raise InputError(f"{source}: not UTF-8 text (byte {fault.start})") from None
    lines = text.splitlines()
    start = 0
    while start < len(lines) and (lines[start].startswith("#") or not lines[start].strip()):
        start += 1
    if start >= len(lines):
        raise InputError(f"{source}: no header line found, expected column names")
    separator = _separator(lines[start])
    names = [name.strip() for name in next(csv.reader([lines[start]], delimiter=separator))]
    twice = sorted({name for name in names if names.count(name) > 1})
    if twice or "" in names:
        raise InputError(f"{source}:{start + 1}: duplicate or empty column name {twice or ['']}")
    body = lines[start + 1 :]
    if not any(line.strip() for line in body):
        raise InputError(f"{source}: no samples after the header")
    try:
        if separator == ";":
            raise ValueError("decimal commas need the slow way")
        samples = np.loadtxt(io.StringIO("\n".join(body)), delimiter=separator, ndmin=2, comments=None)
        if samples.shape[1] != len(names) or np.any(np.isinf(samples)):
            raise ValueError("the slow way finds the line")
    except ValueError:
        samples = _slow(body, start + 2, names, separator, source)
    if len(samples) == 0:
        raise InputError(f"{source}: no samples after the header")
    rate = _rate(lines[:start])
    if rate is None and "time_s" in names and len(samples) > 1:
        time = samples[:, names.index("time_s")]
        span = float(time[-1] - time[0])
        rate = (len(time) - 1) / span if span > 0.0 else None
    return CsvRecord(names, samples, rate)
