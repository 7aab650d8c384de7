# SPDX-License-Identifier: MIT
"""Layouts of .mat that measuring programs export: a struct a set of signals (Testlab), variables Data1_ .. (Dewesoft).

Structs come as dictionaries, arrays of structs as lists of them, texts and cells as loadmat() gives them.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from okid._errors import InputError
from okid.data.records import Record, even_rate
from okid.formats.channel_arrays import clean
from okid.formats.rasters import Raster, choose_raster, sort_in

Real = NDArray[np.float64]
Variables = Mapping[str, Any]
_DAY_S = 86400.0
_DATENUMS = (700_000.0, 800_000.0)  # days since the year 0: 1916 to 2190


def texts(value: Any) -> list[str] | None:
    """A text or a cell array of texts as a list; None for anything else."""
    if not isinstance(value, np.ndarray):
        return None
    if value.dtype.kind == "U":
        return [str(one) for one in value.reshape(-1)] or [""]
    if value.dtype.kind != "O":
        return None
    flat = [np.asarray(one) for one in value.reshape(-1, order="F")]
    if all(one.dtype.kind == "U" and one.size <= 1 for one in flat):
        return [str(one.reshape(-1)[0]) if one.size else "" for one in flat]
    return None


def _at(value: Any, *path: str) -> Any:
    """What stands there in nested structs; of an array of structs the texts of all; None where nothing does."""
    for key in path:
        if isinstance(value, list):
            found = [texts(one.get(key)) or [""] for one in value if isinstance(one, dict)]
            value = np.array([one[0] for one in found], dtype="U")
        else:
            value = value.get(key) if isinstance(value, dict) else None
    return value


def _number(value: Any, *path: str) -> float | None:
    found = _at(value, *path)
    if not isinstance(found, np.ndarray) or found.dtype.kind not in "fiu" or found.size != 1:
        return None
    number = float(found.reshape(-1)[0])
    return number if np.isfinite(number) else None


def _labels(value: Any, count: int, *path: str) -> list[str]:
    """The texts there when there is one for each channel; else []."""
    found = [clean(one) for one in texts(_at(value, *path)) or []]
    return found if len(found) == count and all(found) else []


def _unique(names: list[str], instead: Callable[[int], str]) -> list[str]:
    """The names, those that stand twice with what distinguishes them."""
    count = Counter(names)
    unique = [name if count[name] == 1 else instead(k) for k, name in enumerate(names)]
    count = Counter(unique)
    return [name if count[name] == 1 else f"{name} {k + 1}" for k, name in enumerate(unique)]


# Testlab


def _is_signal(value: Any) -> bool:
    parts = (_at(value, "x_values"), _at(value, "y_values"))
    return all(isinstance(one, dict) for one in parts) and "values" in parts[1]


def _signal_values(variable: str, signal: Mapping[str, Any]) -> Real:
    """Samples x channels of a time history; InputError says what else it is."""
    axis, values = signal["x_values"], signal["y_values"]["values"]
    over = (texts(_at(axis, "quantity", "label")) or [""])[0].strip()
    if over not in ("", "s"):
        raise InputError(f"{variable} is a function over {over!r}, expected time histories over s")
    if not isinstance(values, np.ndarray) or values.dtype.kind not in "fiub" or values.ndim > 2:
        raise InputError(f"{variable}: y_values.values are no real samples x channels")
    table = values.reshape(-1, 1) if 1 in values.shape or values.ndim == 1 else values
    count = _number(axis, "number_of_values")
    if count is not None and len(table) != count:
        if table.shape[1] != count:
            raise InputError(f"{variable} has {values.shape} values, number_of_values says {count:g}")
        table = table.T
    return np.asarray(table, dtype=np.float64)


def _signal_times(variable: str, signal: Mapping[str, Any], count: int) -> Real:
    step, start = _number(signal, "x_values", "increment"), _number(signal, "x_values", "start_value")
    if step is None or step <= 0.0:
        raise InputError(f"{variable} states no x_values.increment above 0")
    return np.asarray((start or 0.0) + step * np.arange(count))


def _testlab(signals: Mapping[str, Mapping[str, Any]]) -> list[Raster]:
    tables = {variable: _signal_values(variable, signal) for variable, signal in signals.items()}
    owners: list[str] = []
    names: list[str] = []
    units: list[str] = []
    for variable, signal in signals.items():
        count = tables[variable].shape[1]
        numbered = [variable] if count == 1 else [f"{variable}_{k}" for k in range(1, count + 1)]
        names += (
            _labels(signal, count, "function_record", "name")
            or _labels(signal, count, "function_record", "primary_channel", "label")
            or numbered
        )
        one = _labels(signal, 1, "y_values", "quantity", "label")
        units += one * count or _labels(signal, count, "y_values", "quantity", "label") or [""] * count
        owners += [variable] * count
    names = _unique(names, lambda k: f"{owners[k]} {names[k]}")
    rasters: list[Raster] = []
    place = 0
    for variable, signal in signals.items():
        times = _signal_times(variable, signal, len(tables[variable]))
        for column in tables[variable].T:
            sort_in(rasters, names[place], units[place], times, column)
            place += 1
    return rasters


# Dewesoft


@dataclass
class _Clock:
    """Time stamps of a channel."""

    relative_s: Real  # from the first one on
    start_s: float
    resolution_s: float  # what its numbers can tell apart: 10 us of days since the year 0


@dataclass
class _Channel:
    event: str  # the number in Data1_
    name: str
    column: Real
    clock: _Clock | None


def _vector(value: Any) -> Real | None:
    if not isinstance(value, np.ndarray) or value.dtype.kind not in "fiub" or value.size < 2:
        return None
    return np.asarray(value.reshape(-1), dtype=np.float64) if value.size == max(value.shape) else None


def _clock(times: Real, rate: float | None) -> _Clock:
    """Stamps in s, or in days since the year 0: in s the steps of those would be far shorter than the rate's."""
    step = (times[-1] - times[0]) / (times.size - 1)
    days = _DATENUMS[0] < times[0] < _DATENUMS[1] and (rate is None or step * rate < 0.5)
    scale = _DAY_S if days else 1.0
    return _Clock((times - times[0]) * scale, float(times[0]) * scale, float(np.spacing(times[-1])) * scale)


def _dewesoft_channels(variables: Variables, rate: float | None, remarks: list[str]) -> list[_Channel]:
    found = {key: (m[1], m[2]) for key in variables if (m := re.fullmatch(r"Data(\d+)_(.+)", key, re.DOTALL))}
    vectors = {key: vector for key in found if (vector := _vector(variables[key])) is not None}
    clocks = {key for key in vectors if found[key][1].startswith("time_")}
    used: set[str] = set()
    out = []
    for key, column in vectors.items():
        event, name = found[key]
        if key in clocks:
            continue
        near = [f"Data{event}_time_{name[:k]}" for k in range(len(name), 0, -1)]  # its own, else that of its message
        clock = next((one for one in near if one in clocks and vectors[one].size == column.size), None)
        used |= {clock} if clock else set()
        out.append(_Channel(event, name, column, _clock(vectors[clock], rate) if clock else None))
    for key in sorted(clocks - used):
        remarks.append(f"{key} is left out: the time of no channel of {vectors[key].size} samples")
    return out


def _dewesoft_rate(channel: _Channel, rate: float | None) -> float:
    """Of one channel: that of the recorder, a whole fraction of it, or what its own time stamps say."""
    clock = channel.clock
    if clock is None:
        if rate is None:
            raise InputError(f"{channel.name} has no time stamps and the file no Sample_rate")
        return rate
    count = clock.relative_s.size
    step = float(clock.relative_s[-1]) / (count - 1)
    parts = round(step * rate) if rate is not None and np.isfinite(step) else 0
    if rate is not None and parts >= 1 and abs(step * rate / parts - 1.0) < 1e-3:
        exact = rate / parts
        off = np.max(np.abs(clock.relative_s - np.arange(count) / exact))
        if off <= max(0.25 / exact, 2.0 * clock.resolution_s):
            return exact
    own = even_rate(clock.relative_s)
    if isinstance(own, str):
        raise InputError(f"{channel.name}: {own}; okid does not resample")
    return own


def _dewesoft(channels: list[_Channel], rate: float | None) -> list[Raster]:
    rasters: list[Raster] = []
    events = list(dict.fromkeys(one.event for one in channels))
    for event in events:
        of_event = [one for one in channels if one.event == event]
        first_s = min((one.clock.start_s for one in of_event if one.clock), default=0.0)
        found: list[Raster] = []
        for one in of_event:
            start_s = one.clock.start_s - first_s if one.clock else 0.0
            name = one.name if len(events) == 1 else f"Data{event}_{one.name}"
            sort_in(found, name, "", start_s + np.arange(one.column.size) / _dewesoft_rate(one, rate), one.column)
        rasters += found
    return rasters


# Both


def _testlab_file(variables: Variables, wanted: list[str] | None) -> tuple[list[str], list[Raster]] | None:
    signals = {key: value for key, value in variables.items() if _is_signal(value)}
    taken = {key: value for key, value in signals.items() if wanted is None or key in wanted}
    return (list(signals), _testlab(taken)) if signals else None


def _dewesoft_file(
    variables: Variables, wanted: list[str] | None, remarks: list[str]
) -> tuple[list[str], list[Raster]] | None:
    rate = next((_number({key: value}, key) for key, value in variables.items() if key.lower() == "sample_rate"), None)
    channels = _dewesoft_channels(variables, rate, remarks)
    if not channels or (rate is None and all(one.clock is None for one in channels)):
        return None
    known = [f"Data{one.event}_{one.name}" for one in channels]
    taken = [one for one, key in zip(channels, known, strict=True) if wanted is None or key in wanted]
    return known, _dewesoft(taken, rate)


def exported(variables: Variables, group: int | str | None) -> Record | None:
    """The record of a file that one of these programs exported; None when it has neither layout.

    group: the number of a raster, or variables with commas. InputError lists the rasters when there are several.
    """
    remarks: list[str] = []
    number = group is None or str(group).isdigit()
    wanted = None if number else [name.strip() for name in str(group).split(",")]
    found = _testlab_file(variables, wanted)
    program = "Testlab" if found else "Dewesoft"
    found = found or _dewesoft_file(variables, wanted, remarks)
    if found is None:
        return None
    known, rasters = found
    missing = [name for name in wanted or [] if name not in known]
    if missing:
        raise InputError(f"no variable {missing[0]!r}; it has {', '.join(known)}")
    raster = choose_raster(rasters, group if number else None)
    rate_hz = even_rate(raster.times_s)
    if isinstance(rate_hz, str):
        raise InputError(f"{raster.names[0]}: {rate_hz}")
    remarks.insert(0, f"read as an export of {program}")
    return Record(raster.names, np.column_stack(raster.columns), rate_hz, raster.units, remarks=remarks)
