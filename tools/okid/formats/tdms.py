# SPDX-License-Identifier: MIT
"""TDMS of LabVIEW and FlexLogger, through npTDMS."""

from __future__ import annotations

from collections import Counter
from datetime import UTC
from pathlib import Path
from typing import Any

import numpy as np

from okid._errors import InputError
from okid.data.memory import require_samples
from okid.data.records import Record, even_rate
from okid.formats.foreign_library import library, listening, reading
from okid.formats.rasters import Raster, choose_raster, sort_in


def _times(channel: Any, count: int) -> np.ndarray[Any, np.dtype[np.float64]]:
    """Of a waveform, by its wf_increment; InputError without one."""
    step = channel.properties.get("wf_increment")
    if not isinstance(step, int | float) or not step > 0:
        raise InputError(
            f"channel {channel.path} states no wf_increment above 0, others do: their rates cannot be compared"
        )
    return np.asarray(float(channel.properties.get("wf_start_offset") or 0.0) + float(step) * np.arange(count))


def read_tdms(path: str | Path, group: int | str | None = None) -> Record:
    """Read the waveforms of a TDMS file that share one rate and length; scaled values, units of `unit_string`.

    Several rasters: an InputError lists them with numbers, `group` chooses one. A name of two groups gets that of its
    group in front. Channels without wf_increment are one raster without a rate where all are so.
    """
    nptdms = library("nptdms", "TDMS")
    with reading(path, "a TDMS file"), listening("nptdms") as said, nptdms.TdmsFile.open(str(path)) as file:
        channels = [one for each in file.groups() for one in each.channels() if len(one)]
        remarks = [f"{one.path} is left out: it holds no numbers" for one in channels if one.dtype.kind not in "fiub"]
        channels = [one for one in channels if one.dtype.kind in "fiub"]
        require_samples(sum(len(one) for one in channels), 1)
        names = Counter(one.name for one in channels)
        stated = any("wf_increment" in one.properties for one in channels)
        rasters: list[Raster] = []
        for one in channels:
            name = one.name if names[one.name] == 1 else f"{one.group_name} {one.name}"
            times = _times(one, len(one)) if stated else np.arange(float(len(one)))
            unit = str(one.properties.get("unit_string") or "")
            sort_in(rasters, name, unit, times, np.asarray(one[:], dtype=np.float64))
        raster = choose_raster(rasters, group)
        rate = even_rate(raster.times_s) if stated else None
        if isinstance(rate, str):
            raise InputError(f"{raster.names[0]}: {rate}; okid does not resample")
        start = next((one.properties.get("wf_start_time") for one in channels if one.name in raster.names), None)
        when = None
        if isinstance(start, np.datetime64) and not np.isnat(start):
            when = start.astype("datetime64[us]").item().replace(tzinfo=UTC)
        title = str(file.properties.get("title") or file.properties.get("name") or "")
        samples = np.column_stack(raster.columns)
        if said.count:
            remarks.append(f"the file is not whole: {said.first}")
        return Record(raster.names, samples, rate, raster.units, title, when, remarks=remarks)
