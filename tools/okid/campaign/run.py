# SPDX-License-Identifier: MIT
"""A campaign from its records to modes of every group: what Dask is asked to do, in which order, and what is kept."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import CancelledError
from contextlib import ExitStack
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from okid._errors import InputError
from okid.campaign.cluster import connected
from okid.campaign.grouping import Group, group_records
from okid.campaign.plan import GroupPlan, batches_of, slices_of
from okid.campaign.record_list import Skipped, list_records
from okid.campaign.refinement import plan_of
from okid.campaign.spec import CampaignSpec
from okid.campaign.state_folder import StateFolder, same_faults, still_valid
from okid.campaign.sums_file import GroupSums
from okid.campaign.tasks import Slice, finish_group, hash_records, merge_batch, run_batch
from okid.shown.notebook_html import own_fields

FAN_IN = 8
Steps = Callable[[int, int, int, int], None]  # records in sums of all, groups finished of all: after every step
_HASHED_AT_ONCE = 64


@dataclass
class Outcome:
    """What a run found: sums' headers with results by group, in the order of the groups.

    `read`: records that were opened in this run; `skipped`: those left out; `remarks`: what else is to be known.
    """

    groups: list[Group]
    done: dict[str, GroupSums] = field(default_factory=dict)
    faults: dict[str, str] = field(default_factory=dict)
    skipped: list[Skipped] = field(default_factory=list)
    remarks: list[str] = field(default_factory=list)
    read: int = 0

    def _repr_html_(self) -> str:
        return own_fields(self)


@dataclass
class _Split:
    """A slice over which a worker ended: records still to come, files of those that came."""

    left: int
    files: list[Path] = field(default_factory=list)


@dataclass
class _Tree:
    """Merges of one group: node (level, index) -> file, None = nothing came of it. Fixed by the plan, not by time."""

    plan: GroupPlan
    leaves: int
    nodes: dict[tuple[int, int], Path | None] = field(default_factory=dict)
    left_out: list[dict[str, Any]] = field(default_factory=list)  # of leaves without any record

    def width(self, level: int) -> int:
        """Nodes of a level."""
        count = self.leaves
        for _ in range(level):
            count = -(-count // FAN_IN)
        return count

    def ready(self, level: int, index: int) -> tuple[int, list[tuple[int, int]]] | None:
        """The parent of a node and its children, when all of them are there."""
        parent = index // FAN_IN
        children = [(level, k) for k in range(parent * FAN_IN, min((parent + 1) * FAN_IN, self.width(level)))]
        return (parent, children) if all(child in self.nodes for child in children) else None


def run_campaign(spec: CampaignSpec, client: Any = None, on_step: Steps | None = None) -> Outcome:
    """Do what is still to be done of a campaign; `client` a dask.distributed.Client, else the cluster of the spec.

    Records that were finished by an earlier run are not read again. Raises InputError when the records cannot be
    listed or the folder cannot be written; KeyboardInterrupt passes, what is finished stays.
    """
    records, bad = list_records(spec)
    groups, keyless = group_records(spec, records)
    state = StateFolder(spec.folder, spec.sums_key)
    with ExitStack() as stack:

        def connect() -> Any:
            return client or stack.enter_context(connected(spec.workers, spec.address, spec.memory_mb))

        return _Run(spec, connect, state, groups, [*bad, *keyless], on_step).run()


class _Run:
    """One run: futures that are under way, and what they belong to."""

    def __init__(
        self, spec: CampaignSpec, connect: Callable[[], Any], state: StateFolder, groups: list[Group],
        bad: list[Skipped], on_step: Steps | None,
    ) -> None:  # fmt: skip
        self.spec, self.state = spec, state
        self._connect = connect
        self._client: Any = None
        self._queue: Any = None
        self.out = Outcome(groups, skipped=list(bad))
        self.trees: dict[str, _Tree] = {}
        self.leaf_of: dict[tuple[str, str], int] = {}
        self.split_up: dict[tuple[str, int], _Split] = {}
        self.suspects: list[Slice] = []  # records that were with a worker when it died
        self.under_way: dict[Any, tuple[Any, ...]] = {}
        self.inside = 0  # records in sums
        self.on_step = on_step
        self.all = sum(len(group.records) for group in groups)

    @property
    def client(self) -> Any:
        """The cluster, begun when there is something to do."""
        if self._client is None:
            from distributed import as_completed

            self._client = self._connect()
            self._queue = as_completed(loop=self._client.loop)  # type: ignore[no-untyped-call]
        return self._client

    def run(self) -> Outcome:
        if self.spec.refines:
            self.spec = replace(self.spec, plan=self.refinement_plan())
        slices = [one for plan in self.plans() for one in self.begin(plan)]
        for batch in batches_of(self.spec, slices):
            self.submit_batch(batch)
        try:
            while self.under_way or self.suspects:
                if not self.under_way:  # nothing else runs: who dies now, dies of this record
                    self.submit_batch([self.suspects.pop()], alone=True)
                future = next(self._queue)
                self.arrived(future, self.under_way.pop(future))
                if self.on_step is not None:
                    groups = len(self.out.done) + len(self.out.faults)
                    self.on_step(self.inside, self.all, groups, len(self.out.groups))
        finally:
            for future in self.under_way:
                future.cancel()
        self.tell()
        return self.out

    def refinement_plan(self) -> bytes:
        """That of an earlier run, else of the first records."""
        plan = self.state.plan()
        if not plan:
            records = [ref for group in self.out.groups for ref in group.records]
            plan = self.client.submit(plan_of, self.spec, records, pure=False).result()
            self.state.keep_plan(plan)
        if not plan:
            self.out.remarks.append("nothing is refined: the first records give no model to refine from")
        return plan

    def plans(self) -> list[GroupPlan]:
        """What is there of each group and what is not; sums that hold other records than the group are removed."""
        on_disk = self.state.load()
        changed = self.changed_records(on_disk)
        known = {group.ident for group in self.out.groups}
        for ident, files in on_disk.items():
            if ident not in known:
                for path, _ in files:
                    self.state.remove(path)
                self.out.remarks.append(
                    f"a group of an earlier run has no record any more: its sums were removed ({ident})"
                )
        plans = []
        for group in self.out.groups:
            records = {ref.name: ref for ref in group.records}
            plan = GroupPlan(group)
            for path, header in on_disk.get(group.ident, []):
                if still_valid(header, records, changed):
                    plan.files.append((path, header))
                else:
                    self.state.remove(path)
                    self.out.remarks.append(
                        f"{group.label}: records were changed, removed or added to finished sums: read again"
                    )
            dealt_with = {name for _, header in plan.files for name in header.names()}
            for _, header in plan.files:
                for one in same_faults(header, records):
                    dealt_with.add(one["name"])
                    self.out.skipped.append(Skipped(one["name"], one["reason"], True))
            plan.todo = [ref for ref in group.records if ref.name not in dealt_with]
            plans.append(plan)
        return plans

    def changed_records(self, on_disk: dict[str, list[tuple[Path, GroupSums]]]) -> set[str]:
        """Records in sums whose content is not what it was: those with another stamp are hashed to know."""
        refs = {ref.name: ref for group in self.out.groups for ref in group.records}
        known = {str(r["name"]): r for files in on_disk.values() for _, header in files for r in header.records}
        doubtful = [refs[name] for name, facts in known.items() if name in refs and facts["stamp"] != refs[name].stamp]
        futures = [
            (chunk, self.client.submit(hash_records, self.spec, chunk, pure=False))
            for chunk in (doubtful[at : at + _HASHED_AT_ONCE] for at in range(0, len(doubtful), _HASHED_AT_ONCE))
        ]
        changed = set()
        for chunk, future in futures:
            hashes = future.result()
            changed |= {ref.name for ref, one in zip(chunk, hashes, strict=True) if one != known[ref.name]["sha256"]}
        return changed

    def begin(self, plan: GroupPlan) -> list[Slice]:
        """The slices of a group; one that is finished, or needs no record, is dealt with at once."""
        ident = plan.group.ident
        self.inside += sum(len(header.records) for _, header in plan.files)
        if plan.finished(self.spec.model_key):
            self.out.done[ident] = plan.files[0][1]
            return []
        if plan.stale and self.spec.identification.sigma_blocks:
            self.out.remarks.append(f"{plan.group.label}: only merged sums were kept: the new model has no ±")
        slices = slices_of(self.spec, plan)
        tree = _Tree(plan, len(plan.files) + len(slices))
        self.trees[ident] = tree
        for k, (path, _) in enumerate(plan.files):
            tree.nodes[0, k] = path
        for k, one in enumerate(slices):
            self.leaf_of[ident, one.records[0].name] = len(plan.files) + k
        if not slices:
            self.climb(ident, 0, 0)
        return slices

    def submit(self, what: tuple[Any, ...], function: Any, *arguments: Any, priority: int = 0) -> None:
        future = self.client.submit(function, self.spec, *arguments, pure=False, priority=priority)
        self.under_way[future] = what
        self._queue.add(future)

    def submit_batch(self, batch: Sequence[Slice], alone: bool = False) -> None:
        self.submit(("batch", list(batch), alone), run_batch, list(batch))

    def arrived(self, future: Any, what: tuple[Any, ...]) -> None:
        kind = what[0]
        try:
            value = future.result()
        except CancelledError:
            raise InputError("the Dask cluster has gone away; what is finished is kept, run again to go on") from None
        except Exception as fault:  # whatever a task, or the death of a worker, raises
            self.failed(what, fault)
            return
        if kind == "batch":
            for piece, done in zip(what[1], value, strict=True):
                self.slice_done(piece, done.sums, done.skipped)
        elif kind == "merge":
            _, ident, level, index, files = what
            self.trees[ident].nodes[level, index] = self.state.write(GroupSums.from_bytes(value, ident), files)
            self.climb(ident, level, index)
        else:
            _, ident, files = what
            self.finished(ident, value, files)

    def slice_done(self, piece: Slice, sums: GroupSums, skipped: list[Skipped]) -> None:
        self.out.skipped += skipped
        self.out.read += len(piece.records)
        self.inside += len(sums.records)
        ident = piece.group
        if piece.complete:
            if sums.records:
                self.finished(ident, sums, [])
            else:
                self.out.faults[ident] = "no record of it could be used"
            return
        leaf = self.leaf_of[ident, piece.records[0].name]
        path = self.state.write(sums) if sums.records else None
        if path is None:
            self.trees[ident].left_out += sums.left_out
        if (ident, leaf) in self.split_up:
            self.of_split(ident, leaf, path)
            return
        self.trees[ident].nodes[0, leaf] = path
        self.climb(ident, 0, leaf)

    def failed(self, what: tuple[Any, ...], fault: BaseException) -> None:
        """A worker died over a task, or the task failed: batches are taken apart until the record is alone."""
        reason = " ".join(str(fault).split())[:200] or type(fault).__name__
        if what[0] != "batch":
            ident, files = what[1], what[-1]
            for path in files:
                self.state.remove(path)
            self.out.faults[ident] = f"its sums could not be merged and were removed, run again to read it: {reason}"
            return
        slices: list[Slice] = what[1]
        if len(slices) > 1:
            for one in slices:
                self.submit_batch([one])
            return
        piece, died = slices[0], type(fault).__name__ == "KilledWorker"
        if len(piece.records) > 1 and self.spec.identification.method == "auto":
            why = "a worker ended over it: too large for its memory?" if died else reason
            self.out.faults[piece.group] = f"its records could not be identified, run again: {why}"
        elif len(piece.records) > 1:
            self.split(piece)
        elif died and not what[2]:
            self.suspects.append(piece)
        else:
            why = "a worker ended over it, alone: too large for its memory?" if died else reason
            piece = Slice(piece.group, piece.records, False, piece.folded)
            self.slice_done(piece, GroupSums(piece.group, 0), [Skipped(piece.records[0].name, why)])

    def split(self, piece: Slice) -> None:
        """Read each record of a slice by itself; together they are the leaf that the slice would have been."""
        leaf = self.leaf_of[piece.group, piece.records[0].name]
        self.split_up[piece.group, leaf] = _Split(len(piece.records))
        for ref in piece.records:
            self.leaf_of[piece.group, ref.name] = leaf
            self.submit_batch([Slice(piece.group, (ref,), False, piece.folded)])

    def of_split(self, ident: str, leaf: int, path: Path | None) -> None:
        """One record of a slice that was taken apart is done."""
        split = self.split_up[ident, leaf]
        split.left -= 1
        split.files += [] if path is None else [path]
        if split.left > 0:
            return
        del self.split_up[ident, leaf]
        if len(split.files) > 1:
            files = sorted(split.files)
            self.submit(
                ("merge", ident, 0, leaf, files), merge_batch, [self.state.read(path) for path in files], priority=10
            )
            return
        self.trees[ident].nodes[0, leaf] = split.files[0] if split.files else None
        self.climb(ident, 0, leaf)

    def climb(self, ident: str, level: int, index: int) -> None:
        """Merge the children of a node's parent, when all are there; at the top, identify."""
        tree = self.trees[ident]
        found = tree.ready(level, index)
        if found is None:
            return
        parent, children = found
        files = [path for child in children if (path := tree.nodes[child]) is not None]
        top = tree.width(level) <= FAN_IN
        if top and not files:
            self.out.faults[ident] = "no record of it could be used"
        elif top and self.reusable(tree, files):
            self.out.done[ident] = tree.plan.files[0][1]
        elif top:
            self.submit(("finish", ident, files), finish_group, [self.state.read(path) for path in files], priority=20)
        elif len(files) > 1:
            what = ("merge", ident, level + 1, parent, files)
            self.submit(what, merge_batch, [self.state.read(path) for path in files], priority=10)
        else:
            tree.nodes[level + 1, parent] = files[0] if files else None
            self.climb(ident, level + 1, parent)

    def reusable(self, tree: _Tree, files: list[Path]) -> bool:
        """Every new record was unusable: the result of the sums that were there stands."""
        there = tree.plan.files
        if [path for path, _ in there] != files or len(there) != 1:
            return False
        result = there[0][1].result
        return result is not None and result["model_key"] == self.spec.model_key

    def finished(self, ident: str, sums: GroupSums, files: list[Path]) -> None:
        if ident in self.trees:
            sums.left_out += self.trees[ident].left_out
        self.state.write(sums, files)
        sums.parts, sums.refinement = {}, b""  # on disk; what is kept here is for the tables
        self.out.done[ident] = sums
        self.trees.pop(ident, None)

    def tell(self) -> None:
        """Remarks on the whole."""
        seen: dict[str, str] = {}
        for sums in self.out.done.values():
            for record in sums.records:
                other = seen.setdefault(record["sha256"], record["name"])
                if other != record["name"]:
                    self.out.remarks.append(f"{record['name']}: the same content as {other}; both are counted")
        few = [ident for ident, sums in self.out.done.items() if sums.result and (sums.result["parts"] or 8) < 8]
        if few and self.spec.identification.sigma_blocks:
            self.out.remarks.append(
                f"{len(few)} groups have fewer than 8 parts and no ±: more records a group, or [identification] "
                "pieces = 8"
            )
        if other_bytes := self.state.others_bytes():
            place = self.state.folder.parent
            self.out.remarks.append(
                f"{other_bytes / 1e6:.1f} MB of sums in {place.parent.name}/{place.name} belong to other settings and "
                "may be deleted"
            )
