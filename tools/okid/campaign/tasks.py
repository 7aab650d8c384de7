# SPDX-License-Identifier: MIT
"""What a worker does: read and sum a batch of records, merge sums, identify a group. No state between calls."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

from okid._errors import Error, InputError
from okid.abi.accumulator import Accumulator
from okid.campaign.group_model import MOST_NUMBERS, agree, identify_group, in_units
from okid.campaign.pieces import fold, make_identifier, part_of, record_sums
from okid.campaign.record_list import RecordRef, Skipped
from okid.campaign.record_read import ReadRecord, Unreachable, content_hash, read_one
from okid.campaign.refinement import Refining
from okid.campaign.spec import CampaignSpec
from okid.campaign.sums_file import Collector, GroupSums, merge_sums, pack, unpack, whole_of

_KEPT = 4  # parts stay on disk when they take less than this part of the records


@dataclass(frozen=True)
class Slice:
    """Records of one group that are summed in one go; `complete`: they are all of it; `folded`: of a large one."""

    group: str
    records: tuple[RecordRef, ...]
    complete: bool
    folded: bool


@dataclass
class SliceDone:
    """What came of a slice; `sums.result` is there when the slice was the whole group."""

    sums: GroupSums
    skipped: list[Skipped] = field(default_factory=list)

    def skip(self, ref: RecordRef, fault: Error) -> None:
        """A record that cannot be used; what another try cannot change is kept."""
        reason, lasting = str(fault).removeprefix(f"{ref.name}: "), not isinstance(fault, Unreachable)
        self.skipped.append(Skipped(ref.name, reason, lasting))
        if lasting:
            self.sums.left_out.append({"name": ref.name, "stamp": ref.stamp, "reason": reason})


def _facts(ref: RecordRef, sha256: str, counts: dict[str, int], temperature: float | None) -> dict[str, Any]:
    return {"name": ref.name, "stamp": ref.stamp, "bytes": ref.size, "sha256": sha256, **counts,
            "temperature_c": temperature}  # fmt: skip


def _counts(record: ReadRecord) -> dict[str, int]:
    missing = 0 if record.missing is None else int(record.missing.sum())
    return {"samples": len(record.samples), "missing": missing, "saturated": 0}


def look_at_slice(spec: CampaignSpec, piece: Slice) -> SliceDone:
    """Read the records of a group and identify them by method auto: as many as it bears, by their names."""
    done, used, numbers = SliceDone(GroupSums(piece.group, 0, merged=True)), {}, 0
    for ref in sorted(piece.records, key=lambda ref: (part_of(ref.name, 0), ref.name)):
        try:
            if numbers >= MOST_NUMBERS:
                raise InputError(
                    f"method auto looks at {MOST_NUMBERS} numbers of a group at most: make groups smaller, or name a "
                    'method, such as "okid-era", whose sums have no bound'
                )
            record = read_one(spec, ref.name, ref.url)
        except Error as fault:
            done.skip(ref, fault)
            continue
        counts = _counts(record)
        used[ref.name], counts["saturated"] = in_units(spec, record)
        numbers += used[ref.name].size
        done.sums.records.append(_facts(ref, record.sha256, counts, record.temperature_c))
    done.sums.records.sort(key=lambda record: str(record["name"]))
    if used:
        done.sums.result = agree(spec, [used[name] for name in sorted(used)])
    return done


def sum_slice(spec: CampaignSpec, piece: Slice) -> tuple[SliceDone, Collector]:
    """Read every record of a slice once, one at a time; one that cannot be used is left out and reported."""
    lags = make_identifier(spec).lags
    into, done, refining = Collector(spec, lags), SliceDone(GroupSums(piece.group, lags)), Refining(spec)
    for ref in piece.records:
        try:
            record = read_one(spec, ref.name, ref.url)
            sums = record_sums(spec, record, lags)
        except Error as fault:
            done.skip(ref, fault)
            continue
        counts = _counts(record)
        for k, one in enumerate(sums):
            counts["saturated"] += one.stats.saturated
            part = part_of(ref.name, k)
            into.add(fold(spec, part) if piece.folded else part, one)
        refining.add(record)
        done.sums.records.append(_facts(ref, record.sha256, counts, record.temperature_c))
    done.sums.records.sort(key=lambda record: str(record["name"]))
    done.sums.refinement = refining.packed()
    return done, into


def _keeps_parts(spec: CampaignSpec, sums: GroupSums, parts: Sequence[Accumulator]) -> bool:
    """Are all parts worth their place on the disk? The first one shows their size, so that not all are packed."""
    if spec.keep != "auto" or sums.merged:
        return spec.keep == "parts" or sums.merged
    return _KEPT * len(parts) * len(pack(parts[0])) <= sum(int(record["bytes"]) for record in sums.records)


def _merged(spec: CampaignSpec, sums: GroupSums, parts: Sequence[Accumulator]) -> None:
    """All parts in one."""
    sums.parts, sums.merged = {0: pack(whole_of(spec, sums.lags, parts))}, True


def run_batch(spec: CampaignSpec, slices: Sequence[Slice]) -> list[SliceDone]:
    """Sum every slice; groups that are complete by that are identified on the spot."""
    out = []
    for piece in slices:
        if spec.identification.method == "auto":
            out.append(look_at_slice(spec, piece))
            continue
        done, into = sum_slice(spec, piece)
        out.append(done)
        if not piece.complete or not done.sums.records:
            done.sums.parts = into.parts()
            continue
        parts = into.accumulators()
        done.sums.result = identify_group(spec, parts, done.sums.refinement)
        if _keeps_parts(spec, done.sums, parts):
            done.sums.parts = into.parts()
        else:
            _merged(spec, done.sums, parts)
    return out


def merge_batch(spec: CampaignSpec, packed: Sequence[bytes]) -> bytes:
    """One node of the tree of merges."""
    return merge_sums(spec, [GroupSums.from_bytes(one, "a merge") for one in packed]).to_bytes()


def finish_group(spec: CampaignSpec, packed: Sequence[bytes]) -> GroupSums:
    """The last node of the tree: everything of a group, identified."""
    sums = merge_sums(spec, [GroupSums.from_bytes(one, "a merge") for one in packed])
    parts = [unpack(data) for _, data in sorted(sums.parts.items())]
    sums.result = identify_group(spec, parts, sums.refinement)
    if not _keeps_parts(spec, sums, parts):
        _merged(spec, sums, parts)
    return sums


def hash_records(spec: CampaignSpec, records: Sequence[RecordRef]) -> list[str | None]:
    """Content hashes of records whose stamp changed; None: cannot be read."""
    out: list[str | None] = []
    for ref in records:
        try:
            out.append(content_hash(ref.url, spec.records.storage))
        except (OSError, ValueError):
            out.append(None)
    return out
