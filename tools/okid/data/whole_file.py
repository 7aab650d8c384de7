# SPDX-License-Identifier: MIT
"""Files that are there whole or not at all, and that no other user can touch while they are made."""

from __future__ import annotations

import contextlib
import os
import shutil
import stat
import tempfile
from collections.abc import Iterator
from pathlib import Path

from okid._errors import InputError


def _mode_of(target: Path) -> int:
    """Of the file that is there, else what the user's mask leaves of 0666."""
    with contextlib.suppress(OSError):
        there = target.lstat().st_mode
        if stat.S_ISREG(there):
            return stat.S_IMODE(there)
    mask = os.umask(0o077)
    os.umask(mask)
    return 0o666 & ~mask


@contextlib.contextmanager
def safe_part(path: str | Path) -> Iterator[Path]:
    """The name of `path` in a folder beside it that was made for this alone (random name, mode 0700).

    A library may open it as it likes: no other user can have put a link or a file there. When the block ends well it is
    on the disk under `path`; a link of that name is replaced, not followed. Otherwise `path` stays what it was. OSError
    when the system refuses.
    """
    target = Path(path)
    folder = Path(tempfile.mkdtemp(prefix=".okid-", dir=target.parent))
    part = folder / target.name
    try:
        yield part
        descriptor = os.open(part, os.O_RDONLY | os.O_NOFOLLOW | os.O_CLOEXEC)
        try:
            os.fchmod(descriptor, _mode_of(target))
            os.fsync(descriptor)
        finally:
            os.close(descriptor)
        part.replace(target)
    finally:
        shutil.rmtree(folder, ignore_errors=True)


@contextlib.contextmanager
def whole_file(path: str | Path) -> Iterator[Path]:
    """safe_part() with InputError, which names the file, in the place of OSError."""
    target = Path(path)
    if not target.parent.is_dir():  # some libraries would make it
        raise InputError(f"{target}: cannot be written: No such file or directory: {target.parent}")
    try:
        with safe_part(target) as part:
            yield part
    except OSError as fault:
        raise InputError(f"{target}: cannot be written: {fault.strerror or fault}") from None
