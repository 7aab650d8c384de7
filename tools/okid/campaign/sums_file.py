# SPDX-License-Identifier: MIT
"""The sums of some records of a group, part by part, as they travel between processes and lie on disk.

Bytes: "OKIDSUM1", uint32 length and CRC-32 of a JSON header (what is inside, the records, the lengths of the parts),
then the parts: zlib of Accumulator.to_bytes(), which ends with a CRC-32 of its own.
"""

from __future__ import annotations

import json
import struct
import zlib
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from typing import Any

from okid._errors import InputError
from okid.abi.accumulator import Accumulator
from okid.campaign.pieces import empty_sums, fold, folds
from okid.campaign.refinement import Refining
from okid.campaign.spec import CampaignSpec
from okid.data.input_file import parse_json
from okid.data.memory import decompressed

_MAGIC, HEAD = b"OKIDSUM1", struct.Struct("<8sII")
_LIVE = 64 << 20  # bytes of accumulators that stay unpacked while parts are collected


@dataclass
class GroupSums:
    """Sums of records of one group. `records`: facts of each, `left_out`: of those that cannot be used; `parts`: packed
    accumulators by the number of the part.

    `result`: what the identification said when the group was complete, with `model_key` of its settings.
    """

    group: str
    lags: int
    records: list[dict[str, Any]] = field(default_factory=list)
    parts: dict[int, bytes] = field(default_factory=dict)
    result: dict[str, Any] | None = None
    left_out: list[dict[str, Any]] = field(default_factory=list)
    refinement: bytes = b""  # packed correlation sums of all records (refinement.py)
    merged: bool = False  # the parts were merged into one: modes of the same records only, no more to add

    def names(self) -> set[str]:
        """The records inside."""
        return {str(record["name"]) for record in self.records}

    def to_bytes(self) -> bytes:
        """For a file; from_bytes() is the way back."""
        order = sorted(self.parts)
        header = json.dumps(
            {"group": self.group, "lags": self.lags, "merged": self.merged, "records": self.records,
             "left_out": self.left_out, "result": self.result,
             "parts": [[part, len(self.parts[part])] for part in order], "refinement": len(self.refinement)},
            allow_nan=False,
        ).encode("utf-8")  # fmt: skip
        head = HEAD.pack(_MAGIC, len(header), zlib.crc32(header))
        return b"".join([head, header, *(self.parts[part] for part in order), self.refinement])

    @classmethod
    def from_bytes(cls, data: bytes, source: str, parts_bytes: int | None = None) -> GroupSums:
        """InputError names `source` when the bytes are damaged. `parts_bytes`: size of the parts when only the header
        is given; the parts stay empty then."""
        try:
            magic, length, crc = HEAD.unpack_from(data)
            header = data[HEAD.size : HEAD.size + length]
            if magic != _MAGIC or zlib.crc32(header) != crc:
                raise ValueError("wrong magic or checksum")
            given, at, parts = _checked(parse_json(header.decode("utf-8"))), HEAD.size + length, {}
            for part, size in given["parts"]:
                if parts_bytes is None:
                    parts[int(part)] = data[at : at + size]
                at += size
            size = given.get("refinement", 0)
            refinement = data[at : at + size]
            at += size
            if at != len(data) + (parts_bytes or 0):
                raise ValueError(f"{len(data) + (parts_bytes or 0)} bytes, expected {at}")
            return cls(
                given["group"], int(given["lags"]), given["records"], parts, given["result"], given["left_out"],
                refinement, given["merged"],
            )  # fmt: skip
        except (ValueError, KeyError, TypeError, AttributeError, ArithmeticError, struct.error) as fault:
            raise InputError(f"{source}: sums of a campaign are damaged: {fault}") from None


def _checked(given: dict[str, Any]) -> dict[str, Any]:
    """A header whose checksum is right may still hold anything. ValueError, or what a wrong type raises."""
    facts = [one["name"] for one in [*given["records"], *given["left_out"]]]
    sizes = [size for _, size in given["parts"]] + [given.get("refinement", 0)]
    if not all(isinstance(one, str) for one in [given["group"], *facts]):
        raise ValueError("a name is no text")
    if not all(type(size) is int and size >= 0 for size in sizes):
        raise ValueError("a size is no size")
    if given["result"] is not None and not isinstance(given["result"]["model_key"], str):
        raise ValueError("the result is of no settings")
    return given


def pack(sums: Accumulator) -> bytes:
    """Smaller by about a factor of 3, at about the cost of the accumulator's own checksum."""
    return zlib.compress(sums.to_bytes(), 1)


def unpack(data: bytes) -> Accumulator:
    """InputError when the bytes are damaged."""
    try:
        return Accumulator.from_bytes(decompressed(data, what="sums of a campaign"))
    except zlib.error as fault:
        raise InputError(f"sums of a campaign are damaged: {fault}") from None


class Collector:
    """Accumulators into parts: those at hand stay unpacked as long as they take less than 64 MB together."""

    def __init__(self, spec: CampaignSpec, lags: int) -> None:
        self._spec, self._lags = spec, lags
        self._live: dict[int, Accumulator] = {}
        self._packed: dict[int, list[bytes]] = {}

    def add(self, part: int, sums: Accumulator) -> None:
        """Merge into a part; `sums` is not kept."""
        if part not in self._live:
            self._live[part] = empty_sums(self._spec, self._lags)
        self._live[part].merge(sums)
        if len(self._live) > 1 and sum(one.nbytes for one in self._live.values()) > _LIVE:
            self._pack_all()

    def _pack_all(self) -> None:
        for part, sums in self._live.items():
            self._packed.setdefault(part, []).append(pack(sums))
        self._live.clear()

    def accumulators(self) -> list[Accumulator]:
        """All parts in order, without packing those at hand."""
        if self._packed:
            return [unpack(data) for data in self.parts().values()]
        return [self._live[part] for part in sorted(self._live)]

    def parts(self) -> dict[int, bytes]:
        """All parts, packed."""
        self._pack_all()
        self._packed = {part: [_merged(self._spec, self._lags, many)] for part, many in sorted(self._packed.items())}
        return {part: many[0] for part, many in self._packed.items()}


def _merged(spec: CampaignSpec, lags: int, packed: Sequence[bytes]) -> bytes:
    if len(packed) == 1:
        return packed[0]
    whole = empty_sums(spec, lags)
    for one in packed:
        whole.merge(unpack(one))
    return pack(whole)


def merge_sums(spec: CampaignSpec, many: Sequence[GroupSums]) -> GroupSums:
    """Sums of the same group into one, part by part: exact for codes, in the given order for real numbers."""
    first = many[0]
    if len(many) == 1 and not folds(spec, len(first.records)):
        return first
    parts: dict[int, list[bytes]] = {}
    large = folds(spec, sum(len(one.records) for one in many))
    for one in many:
        for part, data in sorted(one.parts.items()):
            parts.setdefault(fold(spec, part) if large else part, []).append(data)
    merged = {part: _merged(spec, first.lags, packed) for part, packed in sorted(parts.items())}
    records = sorted((r for one in many for r in one.records), key=lambda record: str(record["name"]))
    left_out = [one for each in many for one in each.left_out]
    return GroupSums(
        first.group, first.lags, records, merged, left_out=left_out, merged=first.merged,
        refinement=Refining(spec).merge(one.refinement for one in many).packed(),
    )  # fmt: skip


def whole_of(spec: CampaignSpec, lags: int, parts: Iterable[Accumulator]) -> Accumulator:
    """All parts in one: the same bytes for codes, however the records came together."""
    whole = empty_sums(spec, lags)
    for part in parts:
        whole.merge(part)
    return whole
