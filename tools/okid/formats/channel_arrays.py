# SPDX-License-Identifier: MIT
"""Arrays with names, as .mat and HDF5 files of other programs hold them, read as one record."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from okid._errors import InputError
from okid.data.records import Record, even_rate

RATE_NAMES = frozenset(
    "fs fs_hz rate rate_hz samplerate sample_rate sample_rate_hz "
    "sampling_rate sampling_rate_hz sampling_frequency".split()
)
STEP_NAMES = frozenset("dt dt_s ts ts_s delta_t sample_time sampling_time sampling_period".split())
TIME_NAMES = frozenset("t t_s time time_s times timestamp timestamps".split())


def stated_rate(name: str, value: Any) -> float | None:
    """Samples per second if a scalar of this name says so ("fs", "sample_rate" .. in Hz, "dt", "Ts" .. in s)."""
    key = name.lower()
    if key not in RATE_NAMES and key not in STEP_NAMES:
        return None
    flat = np.asarray(value).reshape(-1)
    if flat.dtype.kind not in "fiu" or flat.size != 1 or not np.isfinite(flat[0]) or flat[0] <= 0:
        return None
    return float(flat[0]) if key in RATE_NAMES else float(f"{1.0 / float(flat[0]):.12g}")


def _length(shapes: Mapping[str, tuple[int, ...]]) -> int:
    """The number of samples that every array has along one axis; InputError lists the shapes when there is none."""
    sizes = {name: {max(shape)} if min(shape) == 1 else set(shape) for name, shape in shapes.items()}
    shared = set.intersection(*sizes.values())
    if not shared:
        listed = ", ".join(f"{name} {' x '.join(map(str, shape))}" for name, shape in shapes.items())
        raise InputError(
            f"the arrays do not share one number of samples ({listed}): "
            "say which belong together with group= or --group"
        )
    return max(shared)


def _columns(name: str, array: NDArray[Any], samples: int, remarks: list[str]) -> NDArray[np.float64]:
    if array.shape[0] != samples:
        if min(array.shape) > 1:
            rows, columns = array.shape
            remarks.append(f"{name} is {rows} x {columns}: read as {rows} channels of {columns} samples")
        array = array.T
    return array.astype(np.float64)


def _usable(arrays: Mapping[str, NDArray[Any]], remarks: list[str]) -> dict[str, NDArray[Any]]:
    """The arrays that can be channels, two-dimensional."""
    kept: dict[str, NDArray[Any]] = {}
    for name, array in arrays.items():
        if array.size <= 1:
            continue
        if array.dtype.kind == "c":
            raise InputError(f"{name} is complex, expected real samples")
        if array.dtype.kind not in "fiub" or array.ndim > 2:
            remarks.append(f"{name} is left out: {array.ndim} dimensions of {array.dtype}, expected samples x channels")
            continue
        kept[name] = array[:, None] if array.ndim == 1 else array
    if not kept:
        raise InputError("holds no array of samples")
    return kept


def _one_rate(found: Mapping[str, float]) -> float | None:
    rates = list(found.values())
    if rates and max(rates) - min(rates) > 1e-9 * max(rates):
        listed = ", ".join(f"{name} says {rate:g} Hz" for name, rate in found.items())
        raise InputError(f"several sample rates ({listed}): okid does not resample, say which with fs=")
    return rates[0] if rates else None


def record_of_arrays(
    arrays: Mapping[str, NDArray[Any]],
    rates: Mapping[str, float],
    *,
    units: Mapping[str, str] | None = None,
    names: Sequence[str] = (),
    name_units: Sequence[str] = (),
) -> Record:
    """One record of all arrays: vectors are channels, matrices become "y1", "y2" ..; scalars are left out.

    A vector t, time, time_s .. of the same length is the time axis (s) and gives the rate when `rates` is empty; its
    steps must be even. rates: what said which rate (Hz). units: by array name. names, name_units: of all columns, if
    their number fits. InputError when lengths or rates differ: nothing is resampled.
    """
    remarks: list[str] = []
    kept = _usable(arrays, remarks)
    samples = _length({name: array.shape for name, array in kept.items()})
    times = [
        name for name, array in kept.items() if name.rpartition("/")[2].lower() in TIME_NAMES and array.size == samples
    ]
    rate = _one_rate(rates)
    if times and rate is None:
        found = even_rate(kept[times[0]].reshape(-1).astype(np.float64))
        if isinstance(found, str):
            raise InputError(f"{times[0]}: {found}; okid does not resample: say fs= if the samples are evenly taken")
        rate = found
    blocks, labels, marks = [], [], []
    for name, array in kept.items():
        if name in times and len(kept) > len(times):
            continue
        block = _columns(name, array, samples, remarks)
        many = block.shape[1] > 1
        blocks.append(block)
        labels += [f"{name}{k}" for k in range(1, block.shape[1] + 1)] if many else [name]
        marks += [(units or {}).get(name, "")] * block.shape[1]
    if len(names) == len(labels):
        labels = list(names)
        marks = list(name_units) if len(name_units) == len(labels) else marks
    return Record(
        [clean(label) for label in labels], np.hstack(blocks), rate, [clean(m) for m in marks], remarks=remarks
    )


def clean(text: str) -> str:
    """A foreign name or unit without control characters and blanks at the ends."""
    return "".join(c if c.isprintable() else " " for c in text).strip()
