# SPDX-License-Identifier: MIT
"""What is to be done: which records of a group are new, cut into slices and packed into batches for the workers."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

from okid.campaign.grouping import Group
from okid.campaign.pieces import fold, folds, part_of
from okid.campaign.record_list import RecordRef
from okid.campaign.spec import CampaignSpec
from okid.campaign.sums_file import GroupSums
from okid.campaign.tasks import Slice

_MOST_SLICES, _MOST_RECORDS = 16, 256  # of a batch: what is lost when a run is interrupted


@dataclass
class GroupPlan:
    """A group with what is there of it. `files`: valid sums on disk; `todo`: records not in them."""

    group: Group
    files: list[tuple[Path, GroupSums]] = field(default_factory=list)
    todo: list[RecordRef] = field(default_factory=list)

    def finished(self, model_key: str) -> bool:
        """Nothing is left to be done."""
        if self.todo or len(self.files) != 1:
            return False
        result = self.files[0][1].result
        return result is not None and result["model_key"] == model_key

    @property
    def stale(self) -> bool:
        """All records are in the sums, which were merged into one part: another model has no ± any more."""
        return not self.todo and len(self.files) == 1 and self.files[0][1].merged


def slices_of(spec: CampaignSpec, plan: GroupPlan) -> list[Slice]:
    """The records to read, those of a part beside each other, in slices of at most `batch_bytes`."""
    if spec.identification.method == "auto":  # looks at all samples of the group at once
        return [Slice(plan.group.ident, tuple(plan.todo), True, False)] if plan.todo else []
    many = folds(spec, len(plan.group.records))
    records = sorted(plan.todo, key=lambda ref: (fold(spec, part_of(ref.name, 0)) if many else 0, ref.name))
    cut: list[list[RecordRef]] = []
    size = 0
    for ref in records:
        if not cut or size + ref.size > spec.batch_bytes or len(cut[-1]) >= _MOST_RECORDS:
            cut.append([])
            size = 0
        cut[-1].append(ref)
        size += ref.size
    alone = len(cut) == 1 and not plan.files
    return [Slice(plan.group.ident, tuple(one), alone, many) for one in cut]


def batches_of(spec: CampaignSpec, slices: Sequence[Slice]) -> list[list[Slice]]:
    """Slices packed into tasks: small groups together, as long as they stay below `batch_bytes`."""
    out: list[list[Slice]] = []
    size = 0
    for one in slices:
        own = sum(ref.size for ref in one.records)
        if not out or size + own > spec.batch_bytes or len(out[-1]) >= _MOST_SLICES:
            out.append([])
            size = 0
        out[-1].append(one)
        size += own
    return out
