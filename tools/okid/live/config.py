# SPDX-License-Identifier: MIT
"""What the page needs of a CONFIG.toml: the socket to listen to, the identification, the geometry.

`okid run` checks the whole file; here only the keys that are read are checked.
"""

from __future__ import annotations

import math
import os
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from okid._errors import InputError
from okid.data.geometry import Geometry, geometry_of
from okid.data.toml_file import read_toml

LONGEST_SOCKET = 107  # sun_path less its final zero
KINDS: dict[str, tuple[type | tuple[type, ...], str]] = {
    "text": (str, "text in quotes"),
    "flag": (bool, "true or false"),
    "number": ((int, float), "a number > 0"),
    "count": (int, "a whole number >= 1"),
    "list": (list, "a list"),
    "table": (dict, "a section"),
}


@dataclass(frozen=True)
class Identification:
    """Of [identification]: window_s and forgetting None = everything; rows 0 = the method's default."""

    method: str = "okid-era"
    p: int = 40
    rows: int = 0
    detrend: str = "mean"
    window_s: float | None = None
    forgetting: float | None = None


@dataclass(frozen=True)
class PageConfig:
    """A config file as far as the page needs it. hammer: it has a section [hammer]; hit_s, pretrigger_s of that."""

    path: Path
    socket: Path
    samples: bool
    title: str
    identification: Identification = field(default_factory=Identification)
    geometry: Geometry | None = None
    hammer: bool = False
    hit_s: float = 0.0
    hit_before_s: float = 0.0


def _refuse(path: Path, place: str, found: object, expected: str) -> InputError:
    return InputError(f"{path}: {place}: found {found!r}, expected {expected}")


class _Section:
    """One table of the file and what to call it in a message."""

    def __init__(self, path: Path, name: str, table: dict[str, Any]) -> None:
        self.path, self.name, self.table = path, name, table

    def get(self, key: str, kind: str, otherwise: Any = None) -> Any:
        """The value of a key, `otherwise` when it is not there. Raises InputError for another kind of value."""
        if key not in self.table:
            return otherwise
        value = self.table[key]
        types, expected = KINDS[kind]
        good = isinstance(value, types) and (kind == "flag" or not isinstance(value, bool))
        if good and kind in ("number", "count"):
            good = math.isfinite(value) and value > 0
        if not good:
            raise _refuse(self.path, f'[{self.name}] "{key}"', value, expected)
        return value


def read_config(path: str | Path, socket: str | None = None) -> PageConfig:
    """Read a CONFIG.toml of `okid run`; `socket` (relative to here) comes before [publish] socket (relative to the
    file). Raises InputError with the file and the key when something is wrong or no socket is named."""
    file = Path(path)
    data = read_toml(file)[0]

    def section(name: str) -> _Section:
        return _Section(file, name, _Section(file, name, data).get(name, "table", {}))

    publish, wanted, hammer = section("publish"), section("identification"), section("hammer")
    named = publish.get("socket", "text")
    if socket is None and not named:
        raise InputError(
            f'{file}: [publish] "socket" is missing: add socket = "okid.sock" (and samples = true) to [publish] '
            "and start okid again, or name the socket with --socket"
        )
    where = Path(socket) if socket is not None else file.parent / named
    if len(os.fsencode(where)) > LONGEST_SOCKET:
        raise InputError(
            f"{where}: a socket's path has at most {LONGEST_SOCKET} bytes, found {len(os.fsencode(where))}"
        )
    if where.exists() and not where.is_socket():
        raise InputError(
            f"{where}: is {'a folder' if where.is_dir() else 'a file'}, expected the socket of a running okid "
            "([publish] socket of its config), or a name that is not taken yet"
        )
    known = Identification()
    return PageConfig(
        path=file,
        socket=where,
        samples=publish.get("samples", "flag", False),
        title=section("acquisition").get("title", "text", ""),
        identification=Identification(
            method=wanted.get("method", "text", known.method),
            p=wanted.get("p", "count", known.p),
            rows=wanted.get("rows", "count", known.rows),
            detrend=wanted.get("detrend", "text", known.detrend),
            window_s=wanted.get("window_s", "number"),
            forgetting=wanted.get("forgetting", "number"),
        ),
        geometry=geometry_of(data, str(file)),
        hammer="hammer" in data,
        hit_s=float(hammer.get("length_s", "number", 2.0)),
        hit_before_s=float(hammer.get("pretrigger_s", "number", 0.1)),
    )
