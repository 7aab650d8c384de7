# SPDX-License-Identifier: MIT
"""Files that somebody else may have made: what is no file is refused unopened, sizes and nesting are bounded."""

from __future__ import annotations

import json
import os
import re
import stat
import tomllib
from pathlib import Path
from typing import Any, BinaryIO

from okid._errors import InputError

LARGEST = 256 << 20  # bytes of a file that is read whole
LONGEST_LINE = 64 << 20  # bytes of an event
DEEPEST = 32  # lists and objects within one another
_OPEN_ALREADY = ("/dev/stdin", "/dev/fd/", "/proc/self/fd/")


def check_input(path: str | Path) -> None:
    """InputError when `path` is a folder, a device, a socket or a named pipe; a pipe that is open already
    (/dev/stdin) may be read. Also for libraries that open a file themselves."""
    try:
        mode = os.stat(path).st_mode
    except OSError as fault:
        raise InputError(f"{path}: {fault.strerror or fault}") from None
    except ValueError as fault:  # a NUL in the name
        raise InputError(f"{str(path)!r}: {fault}") from None
    if stat.S_ISDIR(mode):
        raise InputError(f"{path}: is a folder, expected a file")
    passed = stat.S_ISFIFO(mode) and str(path).startswith(_OPEN_ALREADY)
    if not stat.S_ISREG(mode) and not passed:
        raise InputError(f"{path}: is a device or a named pipe, expected a file (a pipe can be given as /dev/stdin)")


def open_input(path: str | Path) -> BinaryIO:
    """Open for reading. InputError as check_input(), or when the system refuses."""
    check_input(path)
    try:
        file = Path(path).open("rb")  # noqa: SIM115
    except OSError as fault:
        raise InputError(f"{path}: {fault.strerror or fault}") from None
    if stat.S_ISCHR(mode := os.fstat(file.fileno()).st_mode) or stat.S_ISBLK(mode):  # changed meanwhile
        file.close()
        raise InputError(f"{path}: is a device, expected a file")
    return file


def read_input(path: str | Path, most: int = LARGEST) -> bytes:
    """All of a file of at most `most` bytes. InputError as open_input(), or when it is larger."""
    with open_input(path) as file:
        try:
            data = file.read(most + 1)
        except OSError as fault:
            raise InputError(f"{path}: {fault.strerror or fault}") from None
    if len(data) > most:
        raise InputError(f"{path}: larger than {most} bytes")
    return data


def _too_deep(value: Any) -> bool:
    """Are lists and objects nested deeper than DEEPEST? No recursion."""
    level = [value]
    for _ in range(DEEPEST):
        level = [
            inner
            for outer in level
            for inner in (outer.values() if isinstance(outer, dict) else outer)
            if isinstance(inner, dict | list)
        ]
        if not level:
            return False
    return True


def parse_json(text: str, **options: Any) -> Any:
    """json.loads() with bounded nesting. json.JSONDecodeError also where the nesting is deeper than DEEPEST."""
    try:
        value = json.loads(text, **options)
    except RecursionError:
        value, deep = None, True
    else:
        deep = isinstance(value, dict | list) and _too_deep(value)
    if deep:
        raise json.JSONDecodeError(f"nested deeper than {DEEPEST} levels", text, 0)
    return value


# Strings and comments whole, then what nests and what ends a key.
_TOML = re.compile(
    r'"""(?:[^\\]|\\.)*?"{3,5}' r"|'''.*?'{3,5}" r'|"(?:[^"\\\n]|\\[^\n])*"?' r"|'[^'\n]*'?" r"|#[^\n]*|[\[\]{}.,=\n]",
    re.DOTALL,
)


def _toml_too_deep(text: str) -> bool:
    """By the text: the parser's own memory grows with the square of the length of a dotted key."""
    brackets = dots = 0
    for found in _TOML.finditer(text):
        mark = found[0]
        if mark in "[{":
            brackets += 1
        elif mark in "]}":
            brackets -= 1
        dots = dots + 1 if mark == "." else 0 if mark in "[]{},=\n" else dots
        if brackets > DEEPEST or dots >= DEEPEST:
            return True
    return False


def parse_toml(text: str) -> dict[str, Any]:
    """tomllib.loads() with bounded nesting. tomllib.TOMLDecodeError also where the nesting is deeper than DEEPEST."""
    if _toml_too_deep(text):
        raise tomllib.TOMLDecodeError(f"nested deeper than {DEEPEST} levels")
    return tomllib.loads(text)
