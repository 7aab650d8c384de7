# SPDX-License-Identifier: MIT
"""What a campaign has finished, on disk: sums of records of each group, so that no record is read twice.

One folder for each choice of settings that the sums depend on; in it files GROUP-*.sums. Files of a group are merged
while it grows and are one file when it is complete: the folder is bounded by the groups, not by the records.
"""

from __future__ import annotations

import hashlib
import struct
import zlib
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from okid._errors import InputError
from okid.campaign.record_list import RecordRef
from okid.campaign.sums_file import HEAD, GroupSums, write_sums
from okid.data.whole_file import whole_file


class StateFolder:
    """The files of one campaign with one choice of settings. Raises InputError when the folder cannot be made."""

    def __init__(self, folder: Path, sums_key: str) -> None:
        self.folder = folder / "state" / sums_key
        try:
            self.folder.mkdir(parents=True, exist_ok=True)
        except OSError as fault:
            raise InputError(f"{self.folder}: cannot be made: {fault.strerror or fault}") from None
        for left in self.folder.glob("*.part"):
            left.unlink()

    def plan(self) -> bytes:
        """Of the sums for a refinement (refinement.py); b"": none yet."""
        path = self.folder / "refinement"
        return path.read_bytes() if path.exists() else b""

    def keep_plan(self, plan: bytes) -> None:
        """For later runs, which add to the same sums."""
        with whole_file(self.folder / "refinement") as part:
            part.write_bytes(plan)

    def load(self) -> dict[str, list[tuple[Path, GroupSums]]]:
        """Headers (without parts) of all files by group; damaged files and those inside another one are removed."""
        found: dict[str, list[tuple[Path, GroupSums]]] = {}
        for path in sorted(self.folder.glob("*.sums")):
            try:
                header = read_header(path)
            except InputError:
                path.unlink()
                continue
            found.setdefault(header.group, []).append((path, header))
        for group, files in found.items():
            files.sort(key=lambda one: (-len(one[1].records), one[0].name))
            kept: list[tuple[Path, GroupSums]] = []
            inside: set[str] = set()
            for path, header in files:
                if header.names() & inside:
                    path.unlink()  # a merge was written, and the run ended before its pieces were removed
                else:
                    inside |= header.names()
                    kept.append((path, header))
            found[group] = sorted(kept, key=lambda one: one[0].name)
        return found

    def write(self, sums: GroupSums, instead_of: Sequence[Path] = ()) -> Path:
        """Keep sums; the files they were merged from go. InputError when the disk refuses."""
        names = "\n".join(sorted(sums.names()))
        path = self.folder / f"{sums.group}-{hashlib.sha256(names.encode('utf-8')).hexdigest()[:16]}.sums"
        try:
            write_sums(path, sums)
            for old in instead_of:
                if old != path:
                    old.unlink(missing_ok=True)
        except OSError as fault:
            raise InputError(f"{path}: cannot be written: {fault.strerror or fault}") from None
        return path

    def others_bytes(self) -> int:
        """Bytes of the state of other settings, which nothing here uses."""
        every = (path for path in self.folder.parent.rglob("*.sums") if path.parent != self.folder)
        return sum(path.stat().st_size for path in every)


def read_header(path: Path) -> GroupSums:
    """Everything of a file but its parts. InputError when it is damaged or cut off."""
    try:
        with path.open("rb") as file:
            head = file.read(HEAD.size)
            length = HEAD.unpack(head)[1]
            header = file.read(length)
        sizes = path.stat().st_size - len(head) - len(header)
        sums = GroupSums.from_bytes(head + header, str(path), sizes)
    except (OSError, struct.error, zlib.error) as fault:
        raise InputError(f"{path}: sums of a campaign are damaged: {fault}") from None
    return sums


def still_valid(header: GroupSums, records: dict[str, RecordRef], changed: set[str]) -> bool:
    """Do the sums hold only records that are still there, with the content they had?"""
    names = header.names()
    if names & changed or not names <= records.keys():
        return False
    known = names | {str(one["name"]) for one in same_faults(header, records)}
    return not header.merged or known == records.keys()


def same_faults(header: GroupSums, records: dict[str, RecordRef]) -> list[dict[str, Any]]:
    """Records that could not be used, and have not changed since: they are not read again."""
    return [one for one in header.left_out if one["name"] in records and records[one["name"]].stamp == one["stamp"]]
