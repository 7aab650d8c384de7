# SPDX-License-Identifier: MIT
"""The table `messages` of python-can's SqliteWriter (.db), read-only and row by row.

A database holds programs too: a view of that name may be an endless recursion, a generated column may compute anything.
Only a plain table is read.
"""

from __future__ import annotations

import contextlib
import sqlite3
from collections.abc import Iterator
from pathlib import Path
from typing import Any
from urllib.parse import quote

import can

from okid._errors import InputError

_COLUMNS = ("ts", "arbitration_id", "extended", "remote", "error", "dlc", "data")
_LONGEST = 1 << 16  # bytes of a value, of SQL too
_TYPES: tuple[tuple[type, ...], ...] = ((int, float), (int,), (int,), (int,), (int,), (int,), (bytes, type(None)))


def _check_table(base: sqlite3.Connection) -> None:
    found = base.execute("SELECT type, sql FROM sqlite_master WHERE name = 'messages'").fetchall()
    if not found:
        raise InputError("has no table messages, expected a log of python-can")
    if len(found) != 1 or found[0][0] != "table" or str(found[0][1]).upper().startswith("CREATE VIRTUAL"):
        raise InputError(f"messages is a {found[0][0]} of something else, expected a table of frames")
    columns = base.execute("PRAGMA table_xinfo(messages)").fetchall()
    computed = next((one[1] for one in columns if one[6]), None)
    if computed is not None:
        raise InputError(f"the column {computed[:20]} of messages is computed, expected a table of frames")
    if tuple(one[1] for one in columns) != _COLUMNS:
        names = ", ".join(str(one[1])[:20] for one in columns[:10])
        raise InputError(f"messages has the columns {names}, expected {', '.join(_COLUMNS)}")


def _frame(number: int, row: tuple[Any, ...]) -> can.Message:
    for name, value, types in zip(_COLUMNS, row, _TYPES, strict=True):
        if not isinstance(value, types):
            raise InputError(f"frame {number}: {name} is {str(value)[:40]!r}, expected a {types[0].__name__}")
    stamp, number_on_bus, extended, remote, error, length, data = row
    return can.Message(
        timestamp=stamp, arbitration_id=number_on_bus, is_extended_id=bool(extended), is_remote_frame=bool(remote),
        is_error_frame=bool(error), dlc=length, data=data,
    )  # fmt: skip


def sqlite_frames(path: str | Path) -> Iterator[can.Message]:
    """The frames in the order of the table. InputError names what is no frame; sqlite3.Error."""
    size = Path(path).stat().st_size
    place = f"file:{quote(str(Path(path).absolute()))}?mode=ro&immutable=1"
    with contextlib.closing(sqlite3.connect(place, uri=True)) as base:
        base.setlimit(sqlite3.SQLITE_LIMIT_LENGTH, _LONGEST)
        base.execute("PRAGMA trusted_schema = OFF")
        base.execute("PRAGMA cell_size_check = ON")
        _check_table(base)
        rows = base.execute(f"SELECT {', '.join(_COLUMNS)} FROM main.messages NOT INDEXED")
        for number, row in enumerate(rows, 1):
            if number > size:  # a row takes some bytes
                raise InputError(f"holds more rows than bytes ({size}): it is damaged")
            yield _frame(number, row)
