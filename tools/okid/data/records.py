# SPDX-License-Identifier: MIT
"""Measured records: arrays as the package takes them, and CSV files as `okid identify` reads them."""

from __future__ import annotations

import math
import re
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from okid._errors import InputError
from okid.abi import host
from okid.abi.arguments import unmasked
from okid.data.input_file import parse_json
from okid.shown.notebook_html import own_fields

Real = NDArray[np.float64]


def _one(values: ArrayLike, what: str, types: tuple[str, ...]) -> NDArray[Any]:
    given = unmasked(values)
    if given.dtype.kind not in "fiub":
        raise InputError(f"{what} is of type {given.dtype}, expected real numbers")
    real = given if given.dtype.str[1:] in types and given.dtype.isnative else np.asarray(given, dtype=np.float64)
    if real.ndim == 1:
        real = real[:, None]
    if real.ndim != 2 or real.shape[1] == 0:
        raise InputError(f"{what} has shape {given.shape}, expected (samples, channels)")
    return real  # perhaps the caller's own: must not be modified


def _check_finite(real: Real, what: str) -> None:
    if np.any(np.isinf(real)):
        row, column = np.argwhere(np.isinf(real))[0]
        raise InputError(
            f"{what} is infinite at sample {row} (from 0) of channel {what.split('[')[0]}{column + 1}; use NaN for "
            "missing samples"
        )


def _many(values: ArrayLike | Sequence[ArrayLike], what: str, types: tuple[str, ...]) -> list[NDArray[Any]]:
    if isinstance(values, list | tuple) and values and all(hasattr(v, "shape") and hasattr(v, "dtype") or
                                                           hasattr(v, "to_numpy") for v in values):  # fmt: skip
        return [_one(v, f"{what}[{k}]", types) for k, v in enumerate(values)]
    return [_one(values, what, types)]  # type: ignore[arg-type]


def sides(
    u: ArrayLike | Sequence[ArrayLike] | None, y: ArrayLike | Sequence[ArrayLike], types: tuple[str, ...] = ("f8",)
) -> tuple[list[NDArray[Any]], list[NDArray[Any]]]:
    """Records as two lists of arrays (N, n_u) and (N, n_y) of matching lengths, to be read only; u None = no inputs.

    Other numbers than `types` become float64. Infinite ones are not looked for.

    A list or tuple of NumPy arrays or pandas frames is several records; everything else is one. InputError names what
    does not fit.
    """
    outputs = _many(y, "y", types)
    inputs = [np.zeros((len(one), 0)) for one in outputs] if u is None else _many(u, "u", types)
    if len(inputs) != len(outputs):
        raise InputError(f"u has {len(inputs)} records and y has {len(outputs)}")
    for k, (one, other) in enumerate(zip(inputs, outputs, strict=True)):
        place = f" in record {k} (counted from 0)" if len(inputs) > 1 else ""
        if len(one) != len(other):
            turned = one.shape[1] == other.shape[1] or len(one) < one.shape[1] or len(other) < other.shape[1]
            hint = ": rows are samples, columns channels; is one of them transposed?" if turned else ""
            raise InputError(f"u has {len(one)} samples and y has {len(other)}{place}{hint}")
        if one.shape[1] != inputs[0].shape[1] or other.shape[1] != outputs[0].shape[1]:
            raise InputError(f"the number of channels changes between the records{place}")
    return inputs, outputs


def paired(
    u: ArrayLike | Sequence[ArrayLike] | None, y: ArrayLike | Sequence[ArrayLike]
) -> tuple[list[Real], list[Real]]:
    """sides() in float64, without infinite numbers. InputError names the first one."""
    inputs, outputs = sides(u, y)
    for what, given in (("u", inputs), ("y", outputs)):
        for k, one in enumerate(given):
            _check_finite(one, f"{what}[{k}]" if len(given) > 1 else what)
    return inputs, outputs


def _base(name: str) -> str:
    """A column name without its unit in brackets, as `okid identify` takes it off: "force1" of "force1 [N]"."""
    return re.split(r"[\[(]", name, maxsplit=1)[0].strip()


ROLES = ("force", "acceleration", "velocity", "displacement", "aux")


def unit_of_name(name: str) -> str:
    """The unit in a column name, by the rule of `okid identify`: "g" of "a [g]", "a (g)" and "a_g", else ""."""
    return host.unit_of_name(name)


def _name_fault(names: Sequence[str]) -> str | None:
    for name in names:
        if not name or name != name.strip() or not name.isprintable():
            return f"{name!r} is no channel name: expected printable characters without blanks at the ends"
    twice = sorted(name for name, count in Counter(names).items() if count > 1)
    return f"the channel name {twice[0]!r} stands twice" if twice else None


@dataclass(eq=False)
class Record:
    """Measured samples on a grid, from whatever file they come.

    names: m channel names, unique. samples (N, m) float64, NaN = missing. fs_hz: samples per second, None = not known.
    units: one a channel, "" = not known. title; start_time: wall time of sample 0 with its time zone, None = not known.
    roles: of ROLES or None; dofs: degrees of freedom from 1 on, or None. notes: what else is known, text by key
    (operator, source, source_sha256 ..). remarks: what the reader had to say, not part of the record.
    InputError when the parts do not fit together, a name is empty or doubled, a sample infinite.
    """

    names: list[str]
    samples: Real
    fs_hz: float | None = None
    units: list[str] = field(default_factory=list)
    title: str = ""
    start_time: datetime | None = None
    roles: list[str | None] = field(default_factory=list)
    dofs: list[int | None] = field(default_factory=list)
    notes: dict[str, str] = field(default_factory=dict)
    remarks: list[str] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.names = [str(name) for name in self.names]
        self.samples = np.asarray(self.samples, dtype=np.float64)
        count = len(self.names)
        if self.samples.ndim != 2 or self.samples.shape[1] != count or count == 0:
            raise InputError(f"samples have shape {self.samples.shape}, expected (N, {count}) for {count} names")
        fault = _name_fault(self.names)
        if fault is not None:
            raise InputError(fault)
        self.units = list(self.units) or [""] * count
        self.roles, self.dofs = list(self.roles) or [None] * count, list(self.dofs) or [None] * count
        for what, given in (("units", self.units), ("roles", self.roles), ("dofs", self.dofs)):
            if len(given) != count:
                raise InputError(f"{len(given)} {what} for {count} channels, expected one a channel")
        self._check_channels()
        if self.fs_hz is not None and not (math.isfinite(self.fs_hz) and self.fs_hz > 0.0):
            raise InputError(f"sample rate is {self.fs_hz}, expected Hz above 0")
        if any(not key or not isinstance(value, str) for key, value in self.notes.items()):
            raise InputError(f"notes are {self.notes!r}, expected text by key")
        if self.start_time is not None and self.start_time.tzinfo is None:
            raise InputError(f"start_time {self.start_time.isoformat()} has no time zone, expected one (UTC)")

    def _check_channels(self) -> None:
        for name, unit, role, dof in zip(self.names, self.units, self.roles, self.dofs, strict=True):
            if not isinstance(unit, str) or unit != unit.strip() or not (unit == "" or unit.isprintable()):
                raise InputError(f"unit of {name!r} is {unit!r}, expected printable text without blanks at the ends")
            if role is not None and role not in ROLES:
                raise InputError(f"role of {name!r} is {role!r}, expected {', '.join(ROLES)} or None")
            if dof is not None and (not isinstance(dof, int) or dof < 1):
                raise InputError(f"dof of {name!r} is {dof!r}, expected a whole number from 1 on, or None")
        if np.any(np.isinf(self.samples)):
            row, column = np.argwhere(np.isinf(self.samples))[0]
            raise InputError(f"channel {self.names[column]!r} is infinite at sample {row}; a missing sample is NaN")

    def columns(self, wanted: Sequence[str], source: str) -> Real:
        """The channels of these names, in this order, (N, len(wanted)).

        "force" also finds "force [N]" when no other channel is named so, and "force [N]" a channel "force" in N.
        InputError lists what the file has.
        """
        if isinstance(wanted, str):
            raise InputError(f"columns are given as {wanted!r}, expected a list of names, such as [{wanted!r}]")
        return self.samples[:, self._places(wanted, source)]

    def select(self, wanted: Sequence[str], source: str) -> Record:
        """The same record with only these channels, in this order; names as in columns(). InputError as there."""
        places = self._places(wanted, source).tolist()
        if places == list(range(len(self.names))):
            return self
        return replace(
            self, names=[self.names[k] for k in places], samples=self.samples[:, places],
            units=[self.units[k] for k in places], roles=[self.roles[k] for k in places],
            dofs=[self.dofs[k] for k in places],
        )  # fmt: skip

    def labels(self) -> tuple[list[str], list[str]]:
        """Names without the unit they carry ("force" of "force [N]", where that stays unique), and the units."""
        base = [_base(name) if unit and unit_of_name(name) == unit else name for name, unit in self._pairs()]
        count = Counter(base)
        sure = [b if b and count[b] == 1 else name for b, name in zip(base, self.names, strict=True)]
        return sure, list(self.units)

    def about(self) -> dict[str, Any]:
        """Everything but the samples as plain JSON values; the names as labels() gives them."""
        names, units = self.labels()
        start = None if self.start_time is None else self.start_time.astimezone(UTC).isoformat()
        return {
            "schema": "okid.record/1", "fs_hz": self.fs_hz, "title": self.title, "start_time": start,
            "names": names, "units": units, "roles": self.roles, "dofs": self.dofs, "notes": self.notes,
        }  # fmt: skip

    @classmethod
    def described(cls, samples: ArrayLike, about: Mapping[str, Any], remarks: Sequence[str] = ()) -> Record:
        """The record of these samples (N, m) and what about() gave. InputError names the key that is wrong."""
        if about.get("schema") != "okid.record/1":
            raise InputError(f"schema is {about.get('schema')!r}, expected 'okid.record/1'")
        try:
            start = about.get("start_time")
            return cls(
                list(about["names"]), np.asarray(samples, dtype=np.float64), _optional_rate(about.get("fs_hz")),
                list(about.get("units") or []), str(about.get("title") or ""),
                None if not start else datetime.fromisoformat(str(start)), list(about.get("roles") or []),
                list(about.get("dofs") or []), {str(k): str(v) for k, v in (about.get("notes") or {}).items()},
                list(remarks),
            )  # fmt: skip
        except (KeyError, TypeError, ValueError, AttributeError, ArithmeticError) as fault:
            if isinstance(fault, InputError):
                raise
            raise InputError(f"description of the record is damaged: {type(fault).__name__}: {fault}") from None

    def _pairs(self) -> Iterator[tuple[str, str]]:
        return zip(self.names, self.units, strict=True)

    def _places(self, wanted: Sequence[str], source: str) -> NDArray[np.intp]:
        found = {name: self._place(name) for name in wanted}
        missing = [name for name, place in found.items() if place is None]
        if missing:
            raise InputError(f"{source}: no column {', '.join(map(repr, missing))}; it has {', '.join(self.names)}")
        return np.array([found[name] for name in wanted], dtype=np.intp)

    def _place(self, name: str) -> int | None:
        """The channel of this name, else the only one whose name without its unit it is, or with it."""
        if name in self.names:
            return self.names.index(name)
        by_base = [k for k, full in enumerate(self.names) if name and _base(full) == name]
        by_unit = [k for k, (full, unit) in enumerate(self._pairs()) if unit and f"{full} [{unit}]" == name]
        both = by_base + by_unit
        return both[0] if len(both) == 1 else None

    def _repr_html_(self) -> str:
        return own_fields(self)


CsvRecord = Record  # the name of version 0.1


def _optional_rate(value: Any) -> float | None:
    return None if value is None else float(value)


def even_rate(times_s: Real) -> float | str:
    """Samples per second of time stamps in s, to 9 digits, by the rule of `okid identify`: no step is off by 5 %.

    Otherwise what is wrong, as text: nothing here resamples.
    """
    if len(times_s) < 2:
        return "one time stamp has no rate"
    steps = np.diff(times_s)
    mean = float(times_s[-1] - times_s[0]) / (len(times_s) - 1)
    if not math.isfinite(mean) or not np.all(np.isfinite(steps)):
        return "time stamps are missing"
    if np.any((steps <= 0.0) | (np.abs(steps - mean) > 0.05 * abs(mean))):
        worst = int(np.argmax(np.abs(steps - np.median(steps))))
        return f"a step of {steps[worst]:.6g} s after sample {worst}, {mean:.6g} s on average: not evenly spaced"
    return float(f"{1.0 / mean:.9g}")


def _units(names: Sequence[str], units: Sequence[str], comments: Sequence[str]) -> list[str]:
    """Units in the names, else those of a `# units:` line as `okid convert` and `okid simulate` write it."""
    listed = next((line.split("units:", 1)[1] for line in comments if re.match(r"#\s*units:", line)), "")
    out = list(units)
    for k, name in enumerate(names):
        found = re.search(rf"(?:^|[\s,]){re.escape(name)}[ =]([^\s,]+)", listed)
        if not out[k] and found and found.group(1) != "-":
            out[k] = found.group(1)
    return out


def _stated(comments: Sequence[str], names: Sequence[str]) -> dict[str, Any]:
    """What write_csv() said about these columns in its `# okid:` line; {} without one or when it is of others."""
    line = next((c for c in comments if re.match(r"#\s*okid:\s*\{", c)), None)
    if line is None:
        return {}
    try:
        about = parse_json(line.split(":", 1)[1])
    except ValueError:
        return {}
    known = about.get("names")
    fits = isinstance(known, list) and len(known) == len(names) and all(isinstance(name, str) for name in known)
    return about if fits and all(full.startswith(name) for full, name in zip(names, known, strict=True)) else {}


def read_csv(path: str | Path) -> Record:
    """Read a record by the rules of `okid identify`, all its columns: `#` comments first, one header line, comma,
    semicolon or tab, decimal comma with semicolon.

    `nan` and empty cells are missing samples. The rate comes from a `fs_hz` or `sample_rate_hz` comment, else from a
    column `time_s`, `Time [s]`, `time` or `t` with even steps. Names stand as in the header; units come from them
    ("a [g]", "a_g") or from a `# units:` comment. What write_csv() said about the record is taken over. InputError
    names file, line and column of the first fault.
    """
    about, samples = host.csv(path)
    names, comments = about["names"], about["comments"]
    rate_remark = about["rate_remark"]
    remarks = [f"time_s gives no sample rate: {rate_remark}"] if rate_remark else []
    stated = _stated(comments, names)
    try:
        if stated:
            return Record.described(samples, {**stated, "fs_hz": about["fs_hz"]}, remarks)
        units = _units(names, about["units"], comments)
        return Record(names, samples, about["fs_hz"], units, remarks=remarks)
    except InputError as fault:
        raise InputError(f"{path}: {fault}") from None
