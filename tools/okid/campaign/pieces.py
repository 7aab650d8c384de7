# SPDX-License-Identifier: MIT
"""Sums of a record, cut into pieces for the standard deviations; every piece is centred by itself, then only merged."""

from __future__ import annotations

import zlib
from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from okid._errors import InputError
from okid.abi.accumulator import Accumulator
from okid.campaign.record_read import ReadRecord
from okid.campaign.spec import CampaignSpec
from okid.identification.identifier import Identifier


def make_identifier(spec: CampaignSpec) -> Identifier:
    """The identifier of the campaign; its `lags` are those of the sums."""
    i, n_u, n_y = spec.identification, len(spec.channels.inputs), len(spec.channels.outputs)
    return Identifier(
        n_u, n_y, fs=spec.channels.fs_hz, p=i.p, rows=i.rows, order=i.order, max_order=i.max_order, detrend=i.detrend,
        method=i.method, hankel=i.hankel,
    )  # fmt: skip


def empty_sums(spec: CampaignSpec, lags: int) -> Accumulator:
    """An accumulator of the campaign with the units of its channels."""
    c = spec.channels
    made = Accumulator(len(c.inputs), len(c.outputs), lags, codes=c.codes, saturated=c.saturated)
    if c.codes:
        made.set_units(c.scale, c.offset)
    return made


def part_of(name: str, piece: int) -> int:
    """The part of its group that a piece of a record is: by its name alone, whatever other records there are."""
    return zlib.crc32(f"{name}#{piece}".encode())


def folds(spec: CampaignSpec, records: int) -> bool:
    """Has a group of so many records more pieces than are left out one by one?"""
    return records * spec.identification.pieces > 2 * spec.identification.sigma_blocks


def fold(spec: CampaignSpec, part: int) -> int:
    """The part of a large group: one of `sigma_blocks`. Folding twice changes nothing."""
    return part % max(1, spec.identification.sigma_blocks)


def _cuts(samples: int, pieces: int) -> list[int]:
    return [round(k * samples / pieces) for k in range(pieces + 1)]


def _runs(missing: NDArray[np.bool_] | None, low: int, high: int) -> Iterator[tuple[int, int]]:
    """Unbroken pieces of low .. high - 1."""
    if missing is None:
        yield low, high
        return
    edges = np.flatnonzero(np.diff(np.concatenate(([True], missing[low:high], [True])).astype(np.int8)))
    for first, last in zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True):
        yield low + first, low + last


def feed(into: Accumulator, samples: NDArray[Any], missing: NDArray[np.bool_] | None) -> None:
    """All samples as one record; a missing one ends the run, none is invented in its place."""
    at = 0
    for first, last in _runs(missing, 0, len(samples)):
        if first > at:
            into.gap(first - at)
        into.add(samples[first:last])
        at = last
    if at < len(samples):
        into.gap(len(samples) - at)


def record_sums(spec: CampaignSpec, record: ReadRecord, lags: int) -> list[Accumulator]:
    """The sums of each piece of a record, with the `lags` samples before it as history; centred with detrend "mean".

    Raises InputError when no piece gives an equation. Cost: O(m^2 lags) a sample, least for 16-bit codes.
    """
    cuts = _cuts(len(record.samples), spec.identification.pieces)
    out = []
    for low, high in zip(cuts[:-1], cuts[1:], strict=True):
        first = max(0, low - lags)
        sums = empty_sums(spec, lags)
        feed(sums, record.samples[first:high], None if record.missing is None else record.missing[first:high])
        if spec.identification.detrend == "mean" and sums.rows > 0:
            sums.centre()
        out.append(sums)
    if all(sums.rows == 0 for sums in out):
        raise InputError(
            f"holds {len(record.samples)} samples without a piece of {lags + 1} unbroken ones: too short for "
            f"{lags} lags"
        )
    return out
