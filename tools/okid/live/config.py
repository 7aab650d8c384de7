# SPDX-License-Identifier: MIT
"""What the page needs to know beforehand: socket, identification, geometry, files given."""

from __future__ import annotations

import os
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from okid._errors import InputError
from okid.abi import host
from okid.data.geometry import Geometry, geometry_of

LONGEST_SOCKET = 107  # sun_path less its final zero


@dataclass(frozen=True)
class Identification:
    """Of [identification], for the diagram: window_s and forgetting None = everything; rows 0 = the method's default.
    Method auto has no diagram of its own: okid-era draws it, as in the report."""

    method: str = "okid-era"
    p: int = 40
    rows: int = 0
    detrend: str = "mean"
    window_s: float | None = None
    forgetting: float | None = None

    @property
    def drawn(self) -> str:
        return "okid-era" if self.method == "auto" else self.method


@dataclass(frozen=True)
class ReportFiles:
    """What `okid-report` is given: files by option; `record` may be several; `result` None = it is in no file yet."""

    result: Path | None = None
    record: tuple[Path, ...] = ()
    events: Path | None = None
    config: Path | None = None
    geometry: Path | None = None

    def options(self) -> list[str]:
        """As arguments; every path is absolute, so none begins with a dash."""
        out = ["--record", *map(str, self.record)] if self.record else []
        for name in ("events", "config", "geometry"):
            if (file := getattr(self, name)) is not None:
                out += [f"--{name}", str(file)]
        return out


ADD_SAMPLES = "okid does not send the signals: add samples = true to [publish] of the config and start okid again"


@dataclass(frozen=True)
class PageConfig:
    """A config file as far as the page needs it. hammer: it has a section [hammer]; hit_s, pretrigger_s of that.

    `path`: what the page is of, a config, a record or a result. socket: None where nothing is listened to. `absent`:
    why there are no signals when `samples` is false. `length_s`: how much of the signals is kept, None = that of a run.
    """

    path: Path
    socket: Path | None
    samples: bool
    title: str
    identification: Identification = field(default_factory=Identification)
    geometry: Geometry | None = None
    hammer: bool = False
    hit_s: float = 0.0
    hit_before_s: float = 0.0
    absent: str = ADD_SAMPLES
    length_s: float | None = None
    report: ReportFiles = field(default_factory=ReportFiles)


def _socket_of(file: Path, named: str | None, socket: str | None) -> Path:
    if socket is None and not named:
        raise InputError(
            f'{file}: [publish] "socket" is missing: add socket = "okid.sock" (and samples = true) to [publish] '
            "and start okid again, or name the socket with --socket"
        )
    where = Path(str(named) if socket is None else socket)
    if len(os.fsencode(where)) > LONGEST_SOCKET:
        raise InputError(
            f"{where}: a socket's path has at most {LONGEST_SOCKET} bytes, found {len(os.fsencode(where))}"
        )
    if where.exists() and not where.is_socket():
        raise InputError(
            f"{where}: is {'a folder' if where.is_dir() else 'a file'}, expected the socket of a running okid "
            "([publish] socket of its config), or a name that is not taken yet"
        )
    return where


def read_config(path: str | Path, socket: str | None = None) -> PageConfig:
    """Read a CONFIG.toml of `okid run`; `socket` (relative to here) comes before [publish] socket (relative to the
    file). Raises InputError with the file and the key when something is wrong or no socket is named."""
    file, found = Path(path), host.config(path)
    return _page_config(file, found, _socket_of(file, found["publish"]["socket"], socket))


def config_of_log(log: Path, config: str | Path) -> PageConfig:
    """The same of the config that a log is replayed with: no socket, and the page is of the log. Raises InputError."""
    file = Path(config)
    return replace(_page_config(file, host.config(file), None), path=log, samples=True, length_s=0.0)


def _page_config(file: Path, found: dict[str, Any], where: Path | None) -> PageConfig:
    wanted, hammer = found["identification"], found["hammer"]
    return PageConfig(
        path=file,
        socket=where,
        samples=found["publish"]["samples"],
        title=found["notes"].get("title", ""),
        identification=Identification(
            wanted["method"], wanted["p"] or Identification.p,
            wanted["rows"] or 0, wanted["detrend"], wanted["window_s"], wanted["forgetting"],
        ),
        geometry=geometry_of({"geometry": found["geometry"], "channel": found["channels"]}, str(file)),
        hammer=hammer is not None,
        hit_s=hammer["length_s"] if hammer else 0.0,
        hit_before_s=hammer["pretrigger_s"] if hammer else 0.0,
        report=ReportFiles(config=file.absolute()),
    )  # fmt: skip
