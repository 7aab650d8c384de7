# SPDX-License-Identifier: MIT
"""Correlation sums of the records of a campaign: made one by one, merged, and what a group is refined from.

How far they look back and the filter of the noise must be the same for all: a plan, of the first record that gives a
model, tells both. Each record goes in engineering units and less its own means.
"""

from __future__ import annotations

import zlib
from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np

from okid._errors import Error
from okid.abi.arguments import behind_head
from okid.campaign.group_model import in_units, stream_of
from okid.campaign.pieces import part_of
from okid.campaign.record_list import RecordRef
from okid.campaign.record_read import ReadRecord, read_one
from okid.campaign.spec import CampaignSpec
from okid.data.memory import decompressed
from okid.identification.stream import HostStream, behind_refinement

_TRIED = 8  # records


def _stream(spec: CampaignSpec, **more: Any) -> HostStream:
    return stream_of(spec, sigma_blocks=0, refine="yes", **more)


def _feed(spec: CampaignSpec, record: ReadRecord, to: HostStream) -> None:
    rows, _ = in_units(spec, record)
    if record.missing is not None:
        rows[record.missing] = np.nan
    if spec.identification.detrend == "mean":
        rows -= np.nanmean(rows, axis=0)
    to.add(rows)
    to.gap(0)


def _alone(state: bytes) -> bytes:
    state = behind_head(state)
    return zlib.compress(state[: len(state) - len(behind_refinement(state))], 1)


def plan_of(spec: CampaignSpec, records: Sequence[RecordRef]) -> bytes:
    """Lags and filter, as empty sums; b"" when none of the first records (by their names alone) gives a model."""
    for ref in sorted(records, key=lambda ref: (part_of(ref.name, 0), ref.name))[:_TRIED]:
        stream = _stream(spec)
        try:
            _feed(spec, read_one(spec, ref.name, ref.url), stream)
            state = stream.state()
        except Error:
            continue
        stream.restore(state)
        stream.reset()
        return zlib.compress(stream.state())
    return b""


class Refining:
    """Correlation sums of records, by the plan of the spec; none without one."""

    def __init__(self, spec: CampaignSpec) -> None:
        self._spec, self._one, self._all = spec, None, None
        if spec.plan:
            self._one, self._all = _stream(spec), _stream(spec, states_only=True)
            self._one.restore(decompressed(spec.plan))

    def add(self, record: ReadRecord) -> None:
        """All of a record."""
        if self._one is None or self._all is None:
            return
        self._one.reset()
        _feed(self._spec, record, self._one)
        self._all.merge(decompressed(_alone(self._one.state())))

    def merge(self, packed: Iterable[bytes]) -> Refining:
        """What packed() gave."""
        for one in packed:
            if self._all is not None and one:
                self._all.merge(decompressed(one))
        return self

    def packed(self) -> bytes:
        """The sums; b"" without any."""
        try:
            return b"" if self._all is None else _alone(self._all.state())
        except Error:
            return b""
