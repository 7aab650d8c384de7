# SPDX-License-Identifier: MIT
"""Which records are summed together: one group for every combination of the keys in [group] by."""

from __future__ import annotations

import hashlib
import json
import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from datetime import UTC, datetime

from okid.campaign.record_list import RecordRef, Skipped
from okid.campaign.spec import BAND, TIME_KEYS, CampaignSpec

_FORMATS = {"hour": "%Y-%m-%dT%H", "day": "%Y-%m-%d", "week": "%G-W%V", "month": "%Y-%m", "year": "%Y"}
assert tuple(_FORMATS) == TIME_KEYS


@dataclass
class Group:
    """Records that are summed together. `key`: values of [group] by; `series`: those that are no time or band."""

    key: dict[str, str]
    series: str
    records: list[RecordRef] = field(default_factory=list)

    @property
    def label(self) -> str:
        """The key as people read it."""
        return " · ".join(self.key.values()) or "all records"

    @property
    def ident(self) -> str:
        """A short name for files."""
        return hashlib.sha256(json.dumps(self.key, sort_keys=True).encode()).hexdigest()[:16]


def _value(spec: CampaignSpec, key: str, ref: RecordRef) -> str | None:
    if key == "record":
        return ref.name
    if key in _FORMATS:
        return None if ref.time_s is None else datetime.fromtimestamp(ref.time_s, UTC).strftime(_FORMATS[key])
    if key == BAND:
        if ref.temperature_c is None:
            return None
        low = math.floor(ref.temperature_c / spec.band_c) * spec.band_c
        return f"{low:g} to {low + spec.band_c:g} °C"
    return ref.keys.get(key)


def _series(spec: CampaignSpec, key: dict[str, str], ref: RecordRef) -> str:
    """What a trend is drawn of: the keys of [trend] series, by default all that are no time and no temperature."""
    chosen: Sequence[str] | None = spec.trend.series
    if chosen is None:
        chosen = [name for name in key if name not in (*TIME_KEYS, BAND, "record")]
    values = [key[name] for name in chosen if key.get(name)]
    if not values and "structure" in ref.keys and spec.trend.series is None:
        return ref.keys["structure"] if "record" in key else spec.structure
    return " · ".join(values) or spec.structure


def group_records(spec: CampaignSpec, records: Sequence[RecordRef]) -> tuple[list[Group], list[Skipped]]:
    """Groups in the order of the first record of each; records that lack a key are left out."""
    groups: dict[tuple[str, ...], Group] = {}
    bad: list[Skipped] = []
    for ref in records:
        values = {key: _value(spec, key, ref) for key in spec.by}
        missing = [key for key, value in values.items() if value is None or value == ""]
        if missing:
            known = ", ".join(sorted(ref.keys)) or "none"
            bad.append(Skipped(ref.name, f'no value of the key "{missing[0]}" of [group] (keys it has: {known})'))
            continue
        key = {name: str(value) for name, value in values.items()}
        groups.setdefault(tuple(key.values()), Group(key, _series(spec, key, ref))).records.append(ref)
    return list(groups.values()), bad
