# SPDX-License-Identifier: MIT
"""What a campaign has finished, on disk: sums of records of each group, so that no record is read twice.

One folder for each choice of settings that the sums depend on; in it files GROUP-*.sums. Files of a group are merged
while it grows and are one file when it is complete: the folder is bounded by the groups, not by the records.
"""

from __future__ import annotations

import contextlib
import errno
import hashlib
import os
import secrets
import stat
import struct
import weakref
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any, BinaryIO

from okid._errors import InputError
from okid.campaign.record_list import RecordRef
from okid.campaign.sums_file import HEAD, GroupSums


class StateFolder:
    """The files of one campaign with one choice of settings. Raises InputError when the folder cannot be made.

    Somebody else may have put links into the output folder. So `state` and the folder below it are opened without
    following any, and files in it are read, made, renamed and removed by that descriptor, whatever the path becomes.
    """

    def __init__(self, folder: Path, sums_key: str) -> None:
        self.folder = folder / "state" / sums_key
        try:
            folder.mkdir(parents=True, exist_ok=True)
            with _opened(folder) as top, _below(top, "state", folder / "state") as state:
                self._fd = _open_below(state, sums_key, self.folder)
        except OSError as fault:
            raise InputError(f"{self.folder}: cannot be made: {fault.strerror or fault}") from None
        weakref.finalize(self, os.close, self._fd)
        for left in self._names(".part"):
            os.unlink(left, dir_fd=self._fd)

    def _names(self, ending: str) -> list[str]:
        """Of the plain files and links of that ending."""
        with os.scandir(self._fd) as found:
            return sorted(
                one.name for one in found if one.name.endswith(ending) and not one.is_dir(follow_symlinks=False)
            )

    def _open(self, name: str) -> BinaryIO:
        """For reading. OSError when it is a link or no file."""
        fd = os.open(name, os.O_RDONLY | os.O_NOFOLLOW | os.O_CLOEXEC | os.O_NONBLOCK, dir_fd=self._fd)
        file = os.fdopen(fd, "rb")
        if not stat.S_ISREG(os.fstat(fd).st_mode):
            file.close()
            raise OSError(errno.EINVAL, "is no plain file")
        return file

    def read(self, path: Path) -> bytes:
        """All of a file of this folder. InputError when it cannot be read."""
        try:
            with self._open(path.name) as file:
                return file.read()
        except OSError as fault:
            raise InputError(f"{path}: cannot be read: {fault.strerror or fault}") from None

    def remove(self, path: Path) -> None:
        """A file of this folder, if it is there."""
        with contextlib.suppress(FileNotFoundError):
            os.unlink(path.name, dir_fd=self._fd)

    def _write(self, name: str, data: bytes) -> None:
        """Whole or not at all; a link of that name is replaced. OSError."""
        part = f"{name}.{secrets.token_hex(8)}.part"
        flags = os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_NOFOLLOW | os.O_CLOEXEC
        try:
            with os.fdopen(os.open(part, flags, 0o666, dir_fd=self._fd), "wb") as file:
                file.write(data)
                file.flush()
                os.fsync(file.fileno())
            os.rename(part, name, src_dir_fd=self._fd, dst_dir_fd=self._fd)
        except BaseException:
            with contextlib.suppress(OSError):
                os.unlink(part, dir_fd=self._fd)
            raise

    def plan(self) -> bytes:
        """Of the sums for a refinement (refinement.py); b"": none yet."""
        try:
            os.stat("refinement", dir_fd=self._fd, follow_symlinks=False)
        except FileNotFoundError:
            return b""
        return self.read(self.folder / "refinement")

    def keep_plan(self, plan: bytes) -> None:
        """For later runs, which add to the same sums. InputError when the disk refuses."""
        try:
            self._write("refinement", plan)
        except OSError as fault:
            raise InputError(f"{self.folder}/refinement: cannot be written: {fault.strerror or fault}") from None

    def load(self) -> dict[str, list[tuple[Path, GroupSums]]]:
        """Headers (without parts) of all files by group; damaged files and those inside another one are removed."""
        found: dict[str, list[tuple[Path, GroupSums]]] = {}
        for path in (self.folder / name for name in self._names(".sums")):
            try:
                header = self.header(path)
            except InputError:
                self.remove(path)
                continue
            found.setdefault(header.group, []).append((path, header))
        for group, files in found.items():
            files.sort(key=lambda one: (-len(one[1].records), one[0].name))
            kept: list[tuple[Path, GroupSums]] = []
            inside: set[str] = set()
            for path, header in files:
                if header.names() & inside:
                    self.remove(path)  # a merge was written, and the run ended before its pieces were removed
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
            self._write(path.name, sums.to_bytes())
            for old in instead_of:
                if old != path:
                    self.remove(old)
        except OSError as fault:
            raise InputError(f"{path}: cannot be written: {fault.strerror or fault}") from None
        return path

    def header(self, path: Path) -> GroupSums:
        """Everything of a file but its parts. InputError when it is damaged or cut off."""
        try:
            with self._open(path.name) as file:
                head = file.read(HEAD.size)
                length = HEAD.unpack(head)[1]
                header = file.read(length)
                sizes = os.fstat(file.fileno()).st_size - len(head) - len(header)
            return GroupSums.from_bytes(head + header, str(path), sizes)
        except (OSError, struct.error) as fault:
            raise InputError(f"{path}: sums of a campaign are damaged: {fault}") from None

    def others_bytes(self) -> int:
        """Bytes of the state of other settings, which nothing here uses."""
        every = (path for path in self.folder.parent.glob("*/*.sums") if path.parent != self.folder)
        return sum(path.lstat().st_size for path in every)


@contextlib.contextmanager
def _opened(folder: Path) -> Iterator[int]:
    """The output folder itself, which the user named: where its name leads."""
    fd = os.open(folder, os.O_RDONLY | os.O_DIRECTORY | os.O_CLOEXEC)
    try:
        yield fd
    finally:
        os.close(fd)


def _open_below(top: int, name: str, path: Path) -> int:
    """A folder in another one, made when it is missing. InputError when it is a link."""
    with contextlib.suppress(FileExistsError):
        os.mkdir(name, dir_fd=top)
    try:
        return os.open(name, os.O_RDONLY | os.O_DIRECTORY | os.O_NOFOLLOW | os.O_CLOEXEC, dir_fd=top)
    except OSError as fault:
        if stat.S_ISLNK(os.stat(name, dir_fd=top, follow_symlinks=False).st_mode):
            raise InputError(f"{path}: is a link to another place, expected a folder: remove it") from None
        raise fault from None


@contextlib.contextmanager
def _below(top: int, name: str, path: Path) -> Iterator[int]:
    fd = _open_below(top, name, path)
    try:
        yield fd
    finally:
        os.close(fd)


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
