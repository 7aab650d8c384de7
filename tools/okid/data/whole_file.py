# SPDX-License-Identifier: MIT
"""Files that are there whole or not at all."""

from __future__ import annotations

import contextlib
import os
from collections.abc import Iterator
from pathlib import Path

from okid._errors import InputError


@contextlib.contextmanager
def whole_file(path: str | Path) -> Iterator[Path]:
    """A temporary name beside `path` with the same extension; renamed to `path` when the block ends well.

    Otherwise it is removed and `path` stays what it was. InputError when the system refuses, with the file's name.
    """
    target = Path(path)
    part = target.with_name(f".{os.getpid()}.part.{target.name}")
    if not target.parent.is_dir():  # some libraries would make it
        raise InputError(f"{target}: cannot be written: No such file or directory: {target.parent}")
    try:
        yield part
        part.replace(target)
    except OSError as fault:
        raise InputError(f"{target}: cannot be written: {fault.strerror or fault}") from None
    finally:
        with contextlib.suppress(OSError):
            part.unlink(missing_ok=True)
