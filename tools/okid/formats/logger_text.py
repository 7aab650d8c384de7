# SPDX-License-Identifier: MIT
"""Text files as loggers and spreadsheets export them: LabVIEW, TOA5, scopes, serial monitors, decimal commas.

What differs from `okid identify`'s own CSV is above the data: lines of text, a line of units, any name and unit of the
time. The data themselves are judged as strictly as there: text among numbers is an error, nothing is resampled.
"""

from __future__ import annotations

import csv
import io
import re
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from okid._errors import InputError
from okid.data.records import Record, unit_of_name
from okid.formats.foreign_library import library, reading

Real = NDArray[np.float64]

LOGGER_EXTENSIONS = (".txt", ".dat", ".tsv", ".lvm")
_HEAD_BYTES = 1 << 18  # the data begin within them
_ROWS_ALIKE = 5  # so many lines of one shape are data
_OTHER_RATE = 5e-3  # of a rate: from here on two are not the same one
_SEPARATORS = ("\t", ";", ",", None)  # None: blanks
_MISSING = ("", "nan", "NaN", "NAN", "NA", "N/A", "#N/A", "#NV", "null", "-", "--", "1.#QNAN", "-1.#IND", "1.#IND")
_SECONDS = {"s": 1.0, "sec": 1.0, "second": 1.0, "seconds": 1.0, "ms": 1e-3, "us": 1e-6, "µs": 1e-6, "μs": 1e-6,
            "ns": 1e-9, "min": 60.0, "h": 3600.0}  # fmt: skip
_TIME_NAME = re.compile(
    r"(?:(?:rel|relative|abs|absolute|elapsed|sample)[ _.]*)?"
    r"(?:t|time|times|zeit|temps|tempo|tiempo|tid|timestamp|time[ _]stamp|x[ _]value|millis|micros)"
    r"(?:[ _](?P<unit>s|sec|ms|us|ns))?"
)
_UNIT = re.compile(
    r"[\[(]?(s|sec|seconds?|[mun]s|[µμ]s|min|h|[kmM]?N|kgf|lbf?|m?g|([mµμuck]?m|in|ft)(/s(\^?2|²|\*\*2)?)?|[mµμu]?V|m?A|volts?|amps?|"
    r"k?Hz|[kM]?Pa|bar|psi|°?C|deg ?C|deg|°|rad(/s)?|%|rpm|1/min|strain|[uµμ](e|m/m|strain)|mV/V|k?Nm|-|TS|RN)[\])]?",
    re.IGNORECASE,
)
_STAMP = re.compile(r"(\d{4}-\d\d-\d\d[T ])?\d{1,2}:\d\d:\d\d([.,]\d+)?(Z|[+-]\d\d:?\d\d)?")
_RATE = re.compile(
    r"^\W*(?P<what>(sampl(e|ing)|scan)[ _]*(rate|freq(uency)?)|fs|delta_x|dt|"
    r"(sampl(e|ing)|time)[ _]*(interval|period|step))"
    r"[^0-9\-+.]*(?P<value>[0-9.]+(e[+-]?\d+)?)\s*(?P<unit>[kM]?Hz|S/s|[mnuµμ]?s)?",
    re.IGNORECASE,
)


@dataclass
class _Layout:
    """Where the data begin, how a line splits, and what stands above."""

    separator: str | None
    comma: bool  # decimal comma
    first: int  # line of the first row, from 0
    shape: str  # of that row, as _shape() has it
    encoding: str
    lines: list[str]
    names: list[str] = field(default_factory=list)
    units: list[str] = field(default_factory=list)
    remarks: list[str] = field(default_factory=list)

    @property
    def width(self) -> int:
        return len(self.shape)


def _cells(line: str, separator: str | None) -> list[str]:
    if separator is None:
        return line.split()
    return [cell.strip() for cell in next(csv.reader([line], delimiter=separator), [])]


def _is_number(cell: str, comma: bool) -> bool:
    try:
        float(cell.replace(",", ".") if comma and "." not in cell else cell)
    except ValueError:
        return False
    return not (comma and "." in cell)


def _shape(line: str, separator: str | None, comma: bool) -> str:
    """One letter a cell: n number, s time stamp, e missing, t text."""
    kinds = (
        "e" if cell in _MISSING else "n" if _is_number(cell, comma) else "s" if _STAMP.fullmatch(cell) else "t"
        for cell in _cells(line, separator)
    )
    return "".join(kinds)


def _alike(shapes: list[str]) -> bool:
    """Rows of one table: as many cells, each column numbers, stamps or text throughout, and numbers in one of them."""
    if len({len(one) for one in shapes}) != 1 or not shapes[0]:
        return False
    columns = [set(column) - {"e"} for column in zip(*shapes, strict=True)]
    return all(len(kinds) <= 1 for kinds in columns) and any(kinds == {"n"} for kinds in columns)


def _head(path: Path) -> tuple[list[str], str]:
    """The first lines of a file and its encoding."""
    with path.open("rb") as file:
        raw = file.read(_HEAD_BYTES)
        whole = not file.read(1)
    if raw[:2] in (b"\xff\xfe", b"\xfe\xff"):
        encoding = "utf-16"
    else:
        try:
            (raw if whole else raw[: raw.rfind(b"\n") + 1]).decode("utf-8")
            encoding = "utf-8-sig"
        except UnicodeDecodeError:
            encoding = "cp1252"
    lines = raw.decode(encoding, "replace").splitlines()
    return (lines if whole else lines[:-1]), encoding


def _lay_out(path: Path) -> _Layout:
    """The separator and decimal mark under which most columns are numbers, and the first row of them."""
    lines, encoding = _head(path)
    best: tuple[int, _Layout] | None = None
    for separator in _SEPARATORS:
        for comma in (False, True):
            if separator == "," and comma:
                continue
            shapes = [_shape(line, separator, comma) for line in lines[:1000]]
            last = len(shapes) - next((k for k, line in enumerate(reversed(lines)) if line.strip()), 0)
            rows = min(_ROWS_ALIKE, max(2, last))
            first = next((k for k in range(max(0, last - rows + 1)) if _alike(shapes[k : k + rows])), None)
            if first is None:
                continue
            numbers = sum("n" in column for column in zip(*shapes[first : first + rows], strict=True))
            if best is None or numbers > best[0]:
                best = numbers, _Layout(separator, comma, first, shapes[first], encoding, lines)
    if best is None:
        raise InputError("no table of numbers was found, expected lines of numbers below the names of the channels")
    _name_columns(best[1])
    return best[1]


def is_plain(path: str | Path) -> bool:
    """Comments, one line of names, then numbers, in UTF-8 and with a separator that `okid identify` takes."""
    with reading(path, "a logger's text file"):
        layout = _lay_out(Path(path))
    above = [line for line in layout.lines[: layout.first] if line.strip() and not line.startswith("#")]
    strange = layout.separator is None or (layout.comma and layout.separator != ";") or layout.encoding != "utf-8-sig"
    return len(above) == 1 and not strange and "s" not in layout.shape


def _looks_like_units(row: list[str]) -> bool:
    filled = [cell for cell in row if cell]
    return 2 * sum(_UNIT.fullmatch(cell) is not None for cell in filled) > len(filled)


def _name_columns(layout: _Layout) -> None:
    """Names and units out of the lines right above the data that have as many cells."""
    block: list[list[str]] = []
    for line in reversed(layout.lines[: layout.first]):
        row = _cells(line.lstrip("#%"), layout.separator)
        while len(row) > layout.width and not row[-1]:
            row.pop()
        if len(row) != layout.width and not len(row) == layout.width - 1 > 1 or not any(row):
            break
        block.append((row + [""])[: layout.width])
    words = [row for row in block if not any(_is_number(cell, layout.comma) for cell in row)]
    words = [row for row in words if any(cell not in _MISSING for cell in row)]
    named = [row for row in words if not _looks_like_units(row)] or words[-1:]
    names = max(named, key=lambda row: len({*row} - {""}), default=None)
    below = [] if names is None else block[: block.index(names)]
    units = next((row for row in below if _looks_like_units(row)), None)
    plain = [""] * layout.width
    layout.names = [" ".join(name.split()) for name in names or plain]
    for k, name in enumerate(layout.names):
        earlier = layout.names[:k].count(name) if name else 0
        layout.names[k] = f"{name}_{earlier + 1}" if earlier else name or f"c{k + 1}"
        if earlier:
            layout.remarks.append(f"{name!r} stands more than once: column {k + 1} is called {layout.names[k]!r}")
    layout.units = [cell.strip("[]() ") for cell in units or plain]
    layout.units = [
        "" if unit in ("-", "TS", "RN") else unit or unit_of_name(name)
        for unit, name in zip(layout.units, layout.names, strict=True)
    ]


def _table(path: Path, layout: _Layout) -> list[Any]:
    """The columns, as pyarrow read them: numbers with null where a cell is missing, or text."""
    arrow, text = library("pyarrow", "a logger's text file"), library("pyarrow.csv", "a logger's text file")
    bad: list[Any] = []

    def refuse(row: Any) -> str:
        bad.append(row)
        return "skip"

    source: Any = str(path)
    skip, separator, encoding = layout.first, layout.separator or "\t", layout.encoding
    if layout.separator is None or layout.encoding == "utf-16":
        body = path.read_text(encoding).splitlines()[layout.first :]
        if layout.separator is None:
            body = ["\t".join(line.split()) for line in body]
        source, skip, encoding = io.BytesIO("\n".join(body).encode()), 0, "utf-8"
    keys = [f"{k}" for k in range(layout.width)]
    kinds = {keys[k]: arrow.string() for k, kind in enumerate(layout.shape) if kind == "s"}
    table = text.read_csv(
        source,
        text.ReadOptions(use_threads=False, skip_rows=skip, column_names=keys, encoding=encoding.replace("-sig", "")),
        text.ParseOptions(delimiter=separator, invalid_row_handler=refuse),
        text.ConvertOptions(
            decimal_point="," if layout.comma else ".", null_values=list(_MISSING), strings_can_be_null=True,
            column_types=kinds, true_values=[], false_values=[],
        ),
    )  # fmt: skip
    if bad:
        place = "" if bad[0].number is None else f"line {bad[0].number + (0 if skip else layout.first)}: "
        raise InputError(f"{place}{bad[0].actual_columns} cells, expected {bad[0].expected_columns}")
    return [table.column(key) for key in keys]


def _numbers(layout: _Layout, place: int, column: Any) -> Real | None:
    """A column of numbers, null as NaN; None for a column of text; InputError where text stands among numbers."""
    import pyarrow as arrow

    if arrow.types.is_floating(column.type) or arrow.types.is_integer(column.type):
        return np.asarray(column.cast(arrow.float64()).to_numpy(), dtype=np.float64)
    if arrow.types.is_null(column.type):
        return np.full(len(column), np.nan)
    cells = [None if cell is None else str(cell) for cell in column.to_pylist()]
    fits = [cell is None or _is_number(cell.strip(), layout.comma) for cell in cells]
    if all(fits):  # blanks around numbers
        return np.array([np.nan if c is None else float(c.replace(",", ".") if layout.comma else c) for c in cells])
    if not any(cell is not None and fit for cell, fit in zip(cells, fits, strict=True)):
        return None
    row = fits.index(False)
    raise InputError(
        f"line {layout.first + row + 1}, column {place + 1} ({layout.names[place]}): found {str(cells[row])[:40]!r}, "
        "expected a number, nan or an empty cell"
    )


def _stamps(layout: _Layout, column: Any) -> Real:
    """Seconds from the first stamp: dates with a clock, or a clock that may pass midnight."""
    text = [None if cell is None else str(cell).strip().replace(",", ".") for cell in column.to_pylist()]
    row = next((k for k, cell in enumerate(text) if cell is None or not _STAMP.fullmatch(cell)), None)
    if row is not None:
        raise InputError(f"line {layout.first + row + 1}: found {text[row]!r}, expected a time stamp")
    bare = [re.sub(r"(Z|[+-]\d\d:?\d\d)$", "", str(cell)) for cell in text]
    days = [cell if "-" in cell else f"1970-01-01 {cell:0>8}" for cell in bare]
    padded = [re.sub(r"([T ])(\d):", r"\g<1>0\2:", cell) for cell in days]
    ns = np.array(padded, dtype="datetime64[ns]").astype(np.int64)
    seconds = (ns - ns[0]) / 1e9
    if "-" not in bare[0]:
        seconds = seconds + 86400.0 * np.cumsum(np.diff(seconds, prepend=0.0) < -43200.0)
    return np.asarray(seconds, dtype=np.float64)


def _time_unit(layout: _Layout, place: int) -> str | None:
    """The unit of a column that is a time by its name; "" where none is stated, None where it is no time."""
    name = re.split(r"[\[(]", layout.names[place])[0].strip().lower()
    found = _TIME_NAME.fullmatch(name)
    if not found:
        return None
    by_name = {"millis": "ms", "micros": "us"}.get(name, "")
    unit = layout.units[place].lower() or found["unit"] or by_name
    return unit if not unit or unit in _SECONDS else None


def _resolution(times: Real) -> float:
    """The last decimal place that the stamps use."""
    for digits in range(10):
        if np.all(np.abs(times - np.round(times, digits)) < 10.0 ** (-digits - 3)):
            return float(10.0**-digits)
    return 0.0


def _grid(layout: _Layout, times: Real) -> tuple[float, NDArray[np.int64]]:
    """The rate in Hz, and the number of each row on the grid of that rate: rows that are missing leave numbers out.

    InputError where the stamps do not rise or fit no such grid: nothing is resampled.
    """
    if len(times) < 3 or not np.all(np.isfinite(times)):
        raise InputError("the time has fewer than 3 stamps, or stamps are missing")
    steps = np.diff(times)
    if np.any(steps <= 0.0):
        row = int(np.argmax(steps <= 0.0))
        raise InputError(f"line {layout.first + row + 2}: the time does not rise; give the rate with --fs")
    rounding, step = _resolution(times), float(np.mean(steps[steps < 1.6 * np.median(steps)]))
    whole = np.concatenate([[0], np.cumsum(np.maximum(1, np.round(steps / step)).astype(np.int64))])
    fits = []
    for numbers in (np.arange(len(times)), whole):
        slope, start = np.polyfit(numbers, times - times[0], 1)
        fits.append((np.abs(times - times[0] - start - slope * numbers), float(slope), numbers))
    off, slope, rows = min(fits, key=lambda fit: float(np.max(fit[0])))  # where both fit, the first: no row is missing
    if np.any(off > max(0.25 * slope, min(rounding, slope))):
        row = int(np.argmax(off))
        raise InputError(
            f"line {layout.first + row + 1}: {off[row]:.3g} s away from even steps of {slope:.6g} s; okid does not "
            "resample: give the rate with --fs if the rows are even"
        )
    if rows[-1] + 1 > 2 * len(times):
        raise InputError(f"of {rows[-1] + 1} samples only {len(times)} are there: the time fits no rate")
    if np.max(off) > max(0.05 * slope, rounding):
        layout.remarks.append(f"the stamps are up to {1e3 * np.max(off):.3g} ms off even steps; taken as even")
    blur = 2.0 * (float(np.max(off)) + rounding) / float(times[-1] - times[0]) + 1e-9
    rates = (float(f"{1.0 / slope:.{digits}g}") for digits in range(2, 17))
    return next(rate for rate in rates if abs(rate * slope - 1.0) <= blur), rows


def _stated_rate(lines: list[str]) -> float | None:
    """A rate or interval among the lines above the data."""
    for line in lines:
        found = _RATE.search(line.replace('"', ""))
        if not found:
            continue
        try:
            value = float(found["value"])
        except ValueError:
            continue
        unit, what = (found["unit"] or "").lower(), found["what"].lower()
        if re.search(r"rate|freq|fs", what) and not unit.endswith("s") or unit == "s/s":
            value *= {"khz": 1e3, "mhz": 1e6}.get(unit, 1.0)
        elif value > 0.0:
            value = 1.0 / (value * _SECONDS.get(unit, 1.0))
        if value > 0.0:
            return value
    return None


def _times(layout: _Layout, columns: list[Any], found: dict[int, Real]) -> tuple[int, Real] | None:
    """The column of the time, in s, and its place; the first one that is one."""
    for place, kind in enumerate(layout.shape):
        if kind == "s":
            return place, _stamps(layout, columns[place])
        unit = _time_unit(layout, place) if place in found else None
        if unit is None:
            continue
        times = found[place] * _SECONDS[unit or "s"]
        if not unit and len(times) > 1 and np.all(times == np.round(times)):
            raise InputError(
                f"the time in column {layout.names[place]!r} counts in whole numbers and has no unit: call it "
                f'"{layout.names[place]} [ms]" (or [s], [us]), or give --fs'
            )
        return place, times
    return None


def _contradiction(layout: _Layout, columns: list[Any], found: dict[int, Real], fs: float) -> list[str]:
    """That the time of the file, or a line above its data, is not of the rate that is used instead."""
    said = len(layout.remarks)
    try:
        time = _times(layout, columns, found)
        rate = _stated_rate(layout.lines[: layout.first]) if time is None else _grid(layout, time[1])[0]
    except InputError:  # the reason for which a rate is given
        rate = None
    del layout.remarks[said:]
    if rate is None or abs(rate / fs - 1.0) <= _OTHER_RATE:
        return []
    where = f"column {layout.names[time[0]]!r}" if time is not None else "a line above the data"
    return [f"{fs:.9g} Hz is used, {where} says {rate:.9g} Hz: every frequency scales with it"]


def read_logger(path: str | Path, fs: float | None = None) -> Record:
    """Read a text file of a logger or spreadsheet: samples (N, m), NaN = missing, with rate, names and units found.

    The rate comes from the time column (t, time, Zeit, timestamp .. in s, ms, us, or clock times), else from a line
    above the data (sample rate, Delta_X, dt ..), else it is not known. Rows that the time shows to be missing become
    NaN. `fs` in Hz replaces all these. What was taken for what is in `remarks`, the lines above the data in
    the note "header". About 1 s for 10^6 rows of 4 channels. InputError names line and column of the first fault.
    """
    file = Path(path)
    with reading(file, "a logger's text file"):
        layout = _lay_out(file)
        columns = _table(file, layout)
        arrays = {k: _numbers(layout, k, one) for k, one in enumerate(columns)}
        found = {k: array for k, array in arrays.items() if array is not None}
        time = None if fs is not None else _times(layout, columns, found)
        stated = _stated_rate(layout.lines[: layout.first])
        rate, rows = stated, np.arange(len(columns[0]), dtype=np.int64)
        if time is not None:
            rate, rows = _grid(layout, time[1])
            missing = int(rows[-1]) + 1 - len(rows)
            layout.remarks.append(f"{rate:.9g} Hz by column {layout.names[time[0]]!r}")
            if missing:
                first = layout.first + int(np.argmax(np.diff(rows) > 1)) + 2
                layout.remarks.append(f"{missing} samples are missing by the time, first before line {first}: NaN")
            if stated is not None and abs(stated / rate - 1.0) > _OTHER_RATE:
                layout.remarks.append(f"a line above the data states {stated:.9g} Hz, the time says {rate:.9g} Hz")
        elif fs is not None:
            layout.remarks += _contradiction(layout, columns, found, fs)
        elif stated is not None:
            layout.remarks.append(f"{stated:.9g} Hz by a line above the data")
        others = {k: array for k, array in arrays.items() if time is None or k != time[0]}
        kept = [k for k, array in others.items() if array is not None and not np.all(np.isnan(array))]
        if not kept:
            raise InputError("no channel of numbers beside the time")
        left = [layout.names[k] for k, array in others.items() if array is None]
        layout.remarks += [f"{name} is left out: it holds no numbers" for name in left]
        samples = np.full((int(rows[-1]) + 1, len(kept)), np.nan)
        samples[rows] = np.column_stack([found[k] for k in kept])
        parted = {"\t": "tab", ";": "semicolon", ",": "comma", None: "blanks"}[layout.separator]
        form = f"data from line {layout.first + 1}, separated by {parted}" + ", decimal comma" * layout.comma
        layout.remarks.insert(0, f"read as a logger's file: {form}")
        header = "\n".join(line.rstrip() for line in layout.lines[: layout.first] if line.strip())[:4000]
        return Record(
            [layout.names[k] for k in kept], samples, fs if fs is not None else rate, [layout.units[k] for k in kept],
            notes={"header": header} if header else {}, remarks=layout.remarks,
        )  # fmt: skip
