# SPDX-License-Identifier: MIT
"""What a command may write: never a file that is read or another output, and what it appends to is a log, and said."""

from __future__ import annotations

import os
import re
from collections.abc import Mapping
from pathlib import Path

from okid._errors import InputError

_OTHER_LOGS = (".asc", ".blf", ".trc", ".db", ".mf4", ".csv")
_CANDUMP = re.compile(rb"\(\d+(\.\d+)?\)[ \t]+\S")
_CHUNK = 1 << 20

Name = str | os.PathLike[str] | None


def _same(one: Path, other: Path) -> bool:
    """The same file by whatever names; what is no file (a pipe, /dev/null) may be named twice."""
    try:
        return one.samefile(other) and one.is_file()
    except OSError:  # one of them is not there yet
        return one.resolve() == other.resolve() and not (one.exists() and other.exists())


def check_outputs(inputs: Mapping[str, Name], outputs: Mapping[str, Name]) -> None:
    """Both by the option that names them; None, "-" and addresses are passed over. Before anything is opened.

    Raises InputError when an output is a file that is read, or two outputs are the same file.
    """
    named = [(option, Path(path)) for option, path in outputs.items() if path is not None and str(path) != "-"]
    for index, (option, path) in enumerate(named):
        for role, other in inputs.items():
            if other is not None and _same(path, Path(other)):
                raise InputError(f"{path}: is {role}, a file to be read; {option} does not overwrite it: name another")
        for before, other in named[:index]:
            if _same(path, other):
                raise InputError(f"{path}: {before} and {option} are the same file: name two")


def check_log_target(path: str | os.PathLike[str]) -> str | None:
    """A log that frames are appended to: how much it holds already, in words; None when it is new or empty. O(size).

    Raises InputError when it is named as, or holds, something else than `candump -L` text.
    """
    log = Path(path)
    if log.suffix.lower() in _OTHER_LOGS:
        text = log.with_suffix(".log")
        raise InputError(f"{log}: --out is `candump -L` text: name it {text}, then okid-convert {text} {log}")
    try:
        if not log.is_file() or log.stat().st_size == 0:
            return None
        with log.open("rb") as file:
            if not _CANDUMP.match(file.read(200).lstrip()):
                raise InputError(f"{log}: is there and is no `candump -L` log: nothing is appended to it, name another")
            file.seek(0)
            lines = sum(chunk.count(b"\n") for chunk in iter(lambda: file.read(_CHUNK), b""))
    except OSError as fault:
        raise InputError(f"{log}: {fault.strerror or fault}") from None
    return f"{log}: holds {lines} frames already: appended"


def raw_target(path: str | os.PathLike[str]) -> str | None:
    """The same of a file of bytes."""
    raw = Path(path)
    size = raw.stat().st_size if raw.is_file() else 0
    return f"{raw}: holds {size} bytes already: appended" if size else None
