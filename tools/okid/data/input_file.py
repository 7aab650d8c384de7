# SPDX-License-Identifier: MIT
"""Files that somebody else may have made: what is no file is refused unopened, sizes and nesting are bounded."""

from __future__ import annotations

import json
import math
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


_LONG = re.compile(r"\d{300}|[eE]\+?0*[1-9]\d\d")  # a number that may be beyond what is finite
_HALF = re.compile(r"\\u[dD][89a-fA-F]")  # of a letter


def _no_number(text: str) -> float:
    raise ValueError(f"found {text}, expected a number or null")


def _finite(text: str) -> float:
    value = float(text)
    return value if math.isfinite(value) else _no_number(text[:20])


def _whole_number(text: str) -> int:
    return int(text) if len(text) < 300 else int(_no_number(f"a number of {len(text)} digits"))


def parse_json(text: str) -> Any:
    """json.loads() of what may stand in a file of somebody else. json.JSONDecodeError also where the nesting is deeper
    than DEEPEST, where a number is not finite or has hundreds of digits, and where a text has half of a letter."""
    exact: dict[str, Any] = {"parse_float": _finite, "parse_int": _whole_number} if _LONG.search(text) else {}
    try:
        value = json.loads(text, parse_constant=_no_number, **exact)
        if _HALF.search(text):
            json.dumps(value, ensure_ascii=False).encode("utf-8")
    except json.JSONDecodeError:
        raise
    except RecursionError:
        value, deep = None, True
    except UnicodeEncodeError:
        raise json.JSONDecodeError("half of a letter (a lone surrogate)", text, 0) from None
    except ValueError as fault:
        raise json.JSONDecodeError(str(fault), text, 0) from None
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


_LONG_TOML = re.compile(r"[0-9a-fA-F_]{16}")  # a whole number that may need more than 64 bits


def _check_whole_numbers(value: Any) -> None:
    """As the definition of TOML has them; nesting is bounded."""
    if isinstance(value, int) and not -(2**63) <= value < 2**63:
        raise tomllib.TOMLDecodeError("a whole number of more than 64 bits")
    if isinstance(value, dict | list):
        for inner in value.values() if isinstance(value, dict) else value:
            _check_whole_numbers(inner)


def parse_toml(text: str) -> dict[str, Any]:
    """tomllib.loads() with bounded nesting. tomllib.TOMLDecodeError also where the nesting is deeper than DEEPEST, and
    where a whole number needs more than 64 bits."""
    if _toml_too_deep(text):
        raise tomllib.TOMLDecodeError(f"nested deeper than {DEEPEST} levels")
    try:
        value = tomllib.loads(text)
        if _LONG_TOML.search(text):
            _check_whole_numbers(value)
        return value
    except tomllib.TOMLDecodeError:
        raise
    except ValueError as fault:  # of int(), which has a limit
        raise tomllib.TOMLDecodeError(str(fault)) from None
