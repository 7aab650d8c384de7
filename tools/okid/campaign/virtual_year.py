# SPDX-License-Identifier: MIT
"""A year of a 3-storey frame on the computer: temperature softens the columns, one day a column is damaged."""

from __future__ import annotations

import json
import math
from collections.abc import Callable
from dataclasses import asdict, dataclass
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from okid._errors import InputError
from okid.data.whole_file import whole_file
from okid.mechanics.structure import Structure

Real = NDArray[np.float64]
MASSES = np.array([1.0, 0.8, 1.2])  # kg
COLUMNS = np.array([3e4, 2e4, 2.5e4])  # N/m at 15 °C, first to ground
ALPHA, BETA = 1.0, 5e-5  # R = alpha M + beta K
NAMES = ("force", "acc1", "acc2", "acc3")
_DAY = 86400.0
_NOISE = 0.01  # of each channel's own rms


@dataclass(frozen=True)
class Year:
    """What is simulated. `softening`: relative loss of stiffness a °C; `damage`: of column `damaged` from `damage_day`
    on; no damage: 0."""

    records: int = 1460
    samples: int = 4096
    fs_hz: float = 128.0
    days: float = 365.0
    seed: int = 1
    softening: float = 1e-3
    damage: float = 0.02
    damage_day: float = 250.0
    damaged: int = 2
    ambient: bool = False

    def check(self) -> None:
        """Raises InputError that names what is out of range."""
        limits = {"records": (1, 10**6), "samples": (256, 2**24), "fs_hz": (100.0, 1e6), "days": (1e-3, 36525.0),
                  "seed": (0, 2**31), "softening": (0.0, 0.02), "damage": (0.0, 0.9), "damaged": (1, 3)}  # fmt: skip
        for name, (low, high) in limits.items():
            if not low <= getattr(self, name) <= high:
                raise InputError(f"{name} is {getattr(self, name)}, expected {low} to {high}")


def structure(columns: Real) -> Structure:
    """The frame with these column stiffnesses (N/m)."""
    free = Structure.chain(MASSES.tolist(), columns.tolist())
    return Structure(free.M, ALPHA * free.M + BETA * free.K, free.K)


def frequencies(columns: Real) -> Real:
    """Natural frequencies in Hz, undamped."""
    return np.array([mode.frequency_hz for mode in structure(columns).modes(damped=False)])


def temperature(time_s: Real, seed: int) -> Real:
    """°C: the season (coldest in mid January), the hour (warmest at 15 h), and weather that lasts some days."""
    day = time_s / _DAY
    rng = np.random.default_rng([seed, 1])
    phases, periods = rng.uniform(0.0, 2.0 * np.pi, 6), rng.uniform(3.0, 15.0, 6)
    weather = sum(np.sin(2.0 * np.pi * day / w + a) for w, a in zip(periods, phases, strict=True))
    return np.asarray(
        12.0 - 10.0 * np.cos(2.0 * np.pi * (day - 15.0) / 365.0) + 4.0 * np.cos(2.0 * np.pi * (day % 1.0 - 0.625))
        + 1.5 * weather
    )  # fmt: skip


def columns_of(year: Year, time_s: float, celsius: float) -> Real:
    """Column stiffnesses (3,) in N/m at a time of the year."""
    now = COLUMNS * (1.0 - year.softening * (celsius - 15.0))
    if time_s >= year.damage_day * _DAY:
        now[year.damaged - 1] *= 1.0 - year.damage
    return now


def _filters(columns: Real, fs_hz: float, forces: int) -> tuple[Real, Real]:
    """Accelerations over held forces as filters: numerators (3, forces, 7), the denominator (7,) they share."""
    model = structure(columns).model(fs_hz, range(1, forces + 1), [1, 2, 3])
    markov, state = [model.D], model.B
    for _ in range(6):
        markov.append(model.C @ state)
        state = model.A @ state
    bottom = np.real(np.poly(model.A))
    answer = np.stack(markov)  # (7, 3, forces)
    top = [[np.convolve(bottom, answer[:, r, c])[:7] for c in range(forces)] for r in range(3)]
    return np.array(top), bottom


def _record(year: Year, columns: Real, number: int) -> Real:
    """One record (samples, 4): force at the first storey and accelerations, with noise; ambient: forces at all storeys,
    of which the first one is in the record."""
    from scipy.signal import lfilter  # takes a second to load, which every call of okid-campaign would pay

    forces = 3 if year.ambient else 1
    top, bottom = _filters(columns, year.fs_hz, forces)
    rng = np.random.default_rng([year.seed, 2, number])
    lead = round(4.0 * year.fs_hz)  # until the start is forgotten
    force = rng.standard_normal((lead + year.samples, forces))
    y = [sum(lfilter(top[r, c], bottom, force[:, c]) for c in range(forces)) for r in range(3)]
    clean = np.column_stack([force[:, 0], *y])[lead:]
    sigma = _NOISE * np.sqrt(np.mean(clean**2, axis=0))
    return np.asarray(clean + sigma * rng.standard_normal(clean.shape))


def times_of(year: Year) -> Real:
    """Seconds from the beginning of the year, (records,), even."""
    return np.asarray((np.arange(year.records) + 0.5) * year.days * _DAY / year.records)


SCALE = (1.5e-4, 6e-4, 6e-4, 6e-4)  # N, m/s^2 a code: full scale 4.9 N and 20 m/s^2
BEGIN = datetime(2025, 1, 1, tzinfo=UTC)


def simulate_year(folder: Path, year: Year, on_record: Callable[[int], None] | None = None) -> None:
    """Write records/*.npy (int16), index.csv (path, time, temperature_c), SPEC.toml and truth.json into a folder.

    Raises InputError when something is out of range, or the folder cannot be written.
    """
    year.check()
    place = folder / "records"
    try:
        place.mkdir(parents=True, exist_ok=True)
        times = times_of(year)
        celsius = temperature(times, year.seed)
        columns = [columns_of(year, t, c) for t, c in zip(times.tolist(), celsius.tolist(), strict=True)]
        names = [f"frame_{BEGIN + timedelta(seconds=round(t)):%Y%m%dT%H%M%S}.npy" for t in times.tolist()]
        for k, one in enumerate(columns):
            codes = np.rint(_record(year, one, k) / np.array(SCALE))
            np.save(place / names[k], np.clip(codes, -32767, 32767).astype(np.int16))
            if on_record is not None:
                on_record(k + 1)
        rows = [f"records/{name},{BEGIN + timedelta(seconds=round(t)):%Y-%m-%dT%H:%M:%SZ},{c:.2f}"
                for name, t, c in zip(names, times.tolist(), celsius.tolist(), strict=True)]  # fmt: skip
        _put(folder / "index.csv", "path,time,temperature_c\n" + "\n".join(rows) + "\n")
        _put(folder / "SPEC.toml", _spec_text(year))
        _put(folder / "truth.json", json.dumps(_truth(year), indent=1) + "\n")
    except OSError as fault:
        raise InputError(f"{fault.filename or folder}: {fault.strerror or fault}") from None


def _put(path: Path, text: str) -> None:
    with whole_file(path) as part:
        part.write_text(text, encoding="utf-8")


def _truth(year: Year) -> dict[str, Any]:
    whole = columns_of(year, -1.0, 15.0)
    hurt = columns_of(year, year.damage_day * _DAY, 15.0)
    at = BEGIN + timedelta(days=year.damage_day)
    return {
        "schema": "okid.campaign.truth/1", **asdict(year), "damage_time": f"{at:%Y-%m-%dT%H:%M:%SZ}",
        "frequency_hz_at_15_c": frequencies(whole).tolist(), "damaged_frequency_hz_at_15_c": frequencies(hurt).tolist(),
        "relative_change_per_c": -year.softening / 2.0,
    }  # fmt: skip


def _spec_text(year: Year) -> str:
    inputs = "" if year.ambient else 'inputs = ["force"]\n'
    method = 'method = "n4sid-cva"\nrows = 20' if year.ambient else 'method = "okid-era"\np = 20'
    daily = year.records / year.days
    pieces = (
        f"\npieces = {math.ceil(20 / daily)}             # a record is cut into, for the standard deviations of a day"
    )
    by, pieces = ('["day"]', pieces) if daily >= 2 else ('["record"]', "")
    return f"""# A simulated year: okid-campaign run SPEC.toml
[campaign]
title = "3-storey frame, one year (simulated)"
structure = "frame"
[records]
files = ["records/*.npy"]
index = "index.csv"             # columns path, time, temperature_c
[channels]
{inputs}outputs = ["acc1", "acc2", "acc3"]
columns = ["force", "acc1", "acc2", "acc3"]
fs_hz = {year.fs_hz}
scale = [{", ".join(f"{one:g}" for one in (SCALE[1:] if year.ambient else SCALE))}]  # value = scale code
[identification]
{method}{pieces}
[group]
by = {by}
[temperature]
column = "temperature_c"
[trend]
training_share = 0.4
false_alarm_per_year = 0.05     # probability of any alarm in a year without damage
[cluster]
workers = 2
[output]
folder = "out"
"""
