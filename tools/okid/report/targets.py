# SPDX-License-Identifier: MIT
"""Where a report may be written: never over what it is made of, nor over a file of another kind."""

from __future__ import annotations

import errno
import os
from collections.abc import Mapping, Sequence
from pathlib import Path

from okid._errors import InputError
from okid.data.interrupt import halt_if_interrupted
from okid.data.whole_file import safe_part

Place = str | Path
_READ = {
    "result": "is a result to be read",
    "record": "is a record to be read",
    "events": "is an events file to be read",
    "geometry": "is a geometry to be read",
    "config": "is a configuration to be read",
    "report": "is to be the report",
}
_KINDS = {".html": ("HTML", (b"<!doctype html", b"<html")), ".pdf": ("PDF", (b"%pdf-",))}


def _same(one: Path, other: Path) -> bool:
    try:
        return one.samefile(other)  # links too
    except OSError:
        return one.resolve() == other.resolve()


def check_place(target: Place, option: str, kind: str = ".html") -> None:
    """OSError when `target` is a folder, or its own is absent or shut: before any work, with what to do.

    `option`: by what the user names another place; `kind` as in check_target().
    """
    goal, other = Path(target), f"or name another file by {option}"
    folder = goal.parent
    if goal.is_dir():
        text = f"is a folder, expected the name of a file, say {goal / 'report'}{kind}"
        raise IsADirectoryError(errno.EISDIR, text, str(target))
    if not folder.is_dir():
        text = f"{os.strerror(errno.ENOENT)}: the folder {folder} is not there: make it (mkdir -p), {other}"
        if folder.exists():
            text = f"{os.strerror(errno.ENOTDIR)}: {folder} is a file: {other.removeprefix('or ')}"
        raise FileNotFoundError(errno.ENOENT, text, str(target))
    if not goal.exists() and not os.access(folder, os.W_OK | os.X_OK):
        text = f"{os.strerror(errno.EACCES)}: the folder {folder} takes no new files: open it (chmod u+w), {other}"
        raise PermissionError(errno.EACCES, text, str(target))


def folder_for(path: Place | None) -> Path | None:
    """The folder of the figures, made when it is not there; InputError when it cannot be."""
    if path is None:
        return None
    try:
        Path(path).mkdir(parents=True, exist_ok=True)
    except OSError as fault:
        raise InputError(f"{path}: {fault.strerror or fault}: expected a folder for the figures") from None
    return Path(path)


def check_target(target: Place, inputs: Mapping[str, Place | Sequence[Place] | None], kind: str = ".html") -> None:
    """InputError when `target` is one of the files `inputs` (what for -> name), has the name of the other kind, or
    exists and is not of this kind.

    `kind`: ".html" or ".pdf". An existing file may always be replaced when its name ends so (HTML: .htm too).
    """
    goal = Path(target)
    for what, given in inputs.items():
        for path in [given] if isinstance(given, str | Path) else given or ():
            if _same(goal, Path(path)):
                raise InputError(f"{target}: {_READ[what]}, a report does not overwrite it: give another name")
    if kind == ".html" and goal.suffix.lower() == ".pdf":
        raise InputError(
            f"{target}: the page is HTML, expected a name that ends in .html; --pdf {target} prints it too"
        )
    if kind == ".pdf" and goal.suffix.lower() in (".html", ".htm"):
        raise InputError(f"{target}: would be a PDF, expected a name that ends in .pdf; --out {target} names the page")
    if goal.suffix.lower() in (kind, kind.removesuffix("l")) or not goal.is_file():
        return
    name, begins = _KINDS[kind]
    try:
        with goal.open("rb") as file:
            head = file.read(256).removeprefix(b"\xef\xbb\xbf").lstrip().lower()
    except OSError as fault:
        raise InputError(f"{target}: {fault.strerror or fault}") from None
    if head and not head.startswith(begins):
        raise InputError(
            f"{target}: exists and is not {name}, a report does not overwrite it: give a name that ends in {kind}"
        )


def write_whole(path: Place, text: str) -> None:
    """Write a text file whole or not at all (temporary file, then rename). OSError names no temporary.

    A device or pipe (/dev/stdout) is written to as it is. After Ctrl-C: KeyboardInterrupt, and no file.
    """
    target = Path(path)
    halt_if_interrupted()
    try:
        if target.exists() and not target.is_file() and not target.is_dir():
            target.write_text(text, encoding="utf-8")
            return
        with safe_part(target) as part:
            part.write_text(text, encoding="utf-8")
            halt_if_interrupted()
    except OSError as fault:
        raise OSError(fault.errno, fault.strerror, str(target)) from None
