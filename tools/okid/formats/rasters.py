# SPDX-License-Identifier: MIT
"""Channels sorted by the time stamps they share; which of them are one record is asked, nothing is resampled."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from okid._errors import InputError
from okid.data.records import even_rate

Real = NDArray[np.float64]


@dataclass
class Raster:
    """The channels that share one row of time stamps."""

    times_s: Real
    names: list[str] = field(default_factory=list)
    units: list[str] = field(default_factory=list)
    columns: list[Real] = field(default_factory=list)

    def fits(self, times_s: Real) -> bool:
        return len(times_s) == len(self.times_s) and np.allclose(times_s, self.times_s, rtol=0.0, atol=1e-9)

    def text(self, number: int) -> str:
        rate = even_rate(self.times_s)
        grid = f"{rate:g} Hz" if isinstance(rate, float) else "uneven"
        shown = ", ".join(self.names[:6]) + (" .." if len(self.names) > 6 else "")
        return f"{number}: {shown} ({len(self.times_s)} samples, {grid})"


def sort_in(found: list[Raster], name: str, unit: str, times_s: Real, column: Real) -> None:
    """A channel into the raster whose time stamps it has, or a new one."""
    raster = next((one for one in found if one.fits(times_s)), None)
    if raster is None:
        raster = Raster(times_s)
        found.append(raster)
    raster.names.append(name.strip() or f"channel {len(raster.names) + 1}")
    raster.units.append(unit.strip())
    raster.columns.append(column)


def choose_raster(rasters: list[Raster], group: int | str | None) -> Raster:
    """The only one, or that of the number `group`; InputError lists them."""
    if not rasters:
        raise InputError("holds no channel with samples")
    listed = "; ".join(one.text(k) for k, one in enumerate(rasters, 1))
    if group is None:
        if len(rasters) > 1:
            raise InputError(
                f"channels of {len(rasters)} rasters, okid does not resample: choose with group= or --group ({listed})"
            )
        return rasters[0]
    if not str(group).isdigit() or not 1 <= int(group) <= len(rasters):
        raise InputError(f"group is {group!r}, expected one of {listed}")
    return rasters[int(group) - 1]
