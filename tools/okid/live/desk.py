# SPDX-License-Identifier: MIT
"""What a page may ask for: a report, and on the start page files, channels and identifications.

Only who knows the token may ask: it is in the address that okid-live prints, and a page sends it as a header.
"""

from __future__ import annotations

import glob
import hmac
import itertools
import json
import re
import secrets
import shlex
import sys
import threading
import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace
from io import BufferedIOBase
from pathlib import Path
from typing import Any

from okid._errors import InputError
from okid.abi.host import side_of_column
from okid.abi.program import needed_program
from okid.data.geometry import geometry_toml
from okid.data.memory import max_memory_mb
from okid.data.records import Record
from okid.formats.geometry_file import read_geometry
from okid.live.child import Child
from okid.live.config import PageConfig, ReportFiles, config_of_log, read_config
from okid.live.finished import Finished, Identified, over, page_of_result
from okid.live.replayed import Replayed
from okid.live.running import Running
from okid.live.session import Session
from okid.report.measured import open_record
from okid.report.other_kinds import kind_of

MOST_NAMES, MOST_FILES, MOST_UPLOADS, MOST_TEXT = 4096, 1000, 100, 4096
UPLOAD_SHARE = 0.25  # of max_memory_mb, for all files together: what reading a record may take
PIECE = 1 << 20
LIVE_BUS = re.compile(r"(?:v|sl)?can\d{1,3}|/dev/tty[\w.-]+|/dev/serial/by-id/[\w.:+-]+")
LISTEN_S = 5  # to a bus, for the messages and the rate there are
OF_A_BUS = {"fields": "--fields", "baud": "--baud", "dbc": "--dbc", "rate": "--rate"}
CHOICES = {"fs": "--fs", "method": "--method", "input_dofs": "--input-dofs", "output_dofs": "--output-dofs",
           "sensing": "--sensing"}  # fmt: skip


class Busy(InputError):
    """The same work goes on already."""


def _text(fields: Mapping[str, Any], key: str) -> str:
    found = fields.get(key) or ""
    if not isinstance(found, str) or len(found) > MOST_TEXT or "\0" in found:
        raise InputError(f"{key} is {found!r:.60}, expected a text of at most {MOST_TEXT} characters")
    return found.strip()


def _texts(fields: Mapping[str, Any], key: str, most: int) -> list[str]:
    found = fields.get(key) or []
    if not isinstance(found, list) or len(found) > most:
        raise InputError(f"{key} is {found!r:.60}, expected a list of at most {most} texts")
    return [_text({key: one}, key) for one in found]


def named_file(text: str) -> Path:
    """A file or folder that was typed, absolute. InputError when there is none."""
    if not text:
        raise InputError("no file was named, expected a record, a log, a journal or a result")
    try:
        path = Path(text).expanduser().absolute()
        there = path.exists()
    except (OSError, RuntimeError, ValueError):
        there = False
    if not there:
        raise InputError(f"{text}: no such file or folder")
    return path


def is_bus(text: str) -> bool:
    """Is it a CAN interface or a serial line, by its name or by what is there?"""
    return bool(LIVE_BUS.fullmatch(text)) or (text.startswith("/") and Path(text).is_char_device())


def init_options(fields: Mapping[str, Any]) -> list[str]:
    """The options of `okid init` for the bus that was named and what was said of it. InputError for no bus."""
    bus = _text(fields, "path")
    if not is_bus(bus):
        raise InputError(f"{bus}: is no bus, expected a CAN interface (can0) or a serial line (/dev/ttyACM0)")
    where = [f"--device={bus}"] if bus.startswith("/") else [f"--interface={bus}", f"--listen={LISTEN_S}"]
    return where + [f"{option}={_text(fields, key)}" for key, option in OF_A_BUS.items() if _text(fields, key)]


def _listed(names: Sequence[str]) -> str:
    """Names as `okid identify` takes them."""
    return ",".join(f'"{name}"' if "," in name else name for name in names)


def proposed(record: Record) -> list[str]:
    """ "inputs", "outputs" or "" for each channel: what the file says of it, else the rule of `okid identify`."""
    sides = {"force": "inputs", "aux": ""}
    return [
        sides.get(role, "outputs") if role else side_of_column(name)
        for name, role in zip(record.names, record.roles, strict=True)
    ]


def identify_options(fields: Mapping[str, Any]) -> list[str]:
    """The options of `okid identify` that were chosen on the page, each in one word."""
    options = []
    for option, names in (("--inputs", _texts(fields, "inputs", MOST_NAMES)),
                          ("--outputs", _texts(fields, "outputs", MOST_NAMES))):  # fmt: skip
        if names:
            options.append(f"{option}={_listed(names)}")
    return options + [f"{option}={_text(fields, key)}" for key, option in CHOICES.items() if _text(fields, key)]


def _quoted(names: Iterable[str]) -> str:
    return json.dumps(list(names), ensure_ascii=False)


def spec_of(fields: Mapping[str, Any], files: Sequence[Path], fs_hz: float | None) -> str:
    """SPEC.toml of `okid-campaign` that identifies the same: several files as one."""
    rate = _text(fields, "fs") or ("" if fs_hz is None else repr(fs_hz))
    lines = ["[records]", f"files = {_quoted(glob.escape(str(file)) for file in files)}", "[channels]",
             f"inputs = {_quoted(_texts(fields, 'inputs', MOST_NAMES))}",
             f"outputs = {_quoted(_texts(fields, 'outputs', MOST_NAMES))}", f"fs_hz = {rate}"]  # fmt: skip
    if method := _text(fields, "method"):
        lines += ["[identification]", f"method = {_quoted([method])[1:-1]}"]
    return "\n".join([*lines, *(["[group]", "by = []"] if len(files) > 1 else []), ""])


class Desk:
    """Takes the wishes of pages for one session. `folder`: private, for uploads, results and reports. `start`: a start
    page, which may name files; otherwise a page may only ask for a report."""

    def __init__(self, session: Session, folder: Path, start: bool) -> None:
        self.session, self.folder, self.start = session, folder, start
        session.takes_files = start
        if start:
            session.ended("ready")
        self.token = secrets.token_urlsafe(24)
        self._works: dict[str, Callable[[Mapping[str, Any]], Any]] = {
            "/report": self.report,
            "/geometry": self.geometry,
        }
        if start:
            self._works |= {"/look": self.look, "/identify": self.identify, "/open": self.open,
                            "/propose": self.propose, "/run": self.run, "/end": self.end}  # fmt: skip
        self._reporter, self._reporting, self._changing = Child(), threading.Lock(), threading.Lock()
        self._uploaded = self._uploads = 0
        self._jobs = itertools.count(1)
        self._proposed: set[Path] = set()  # configs that were written here and may still be changed
        self._running: Running | None = None

    def knows(self, token: str) -> bool:
        """Is it the token of this session?"""
        return hmac.compare_digest(token.encode(), self.token.encode())

    def takes(self, path: str) -> bool:
        """Is there something to ask for under this path?"""
        return path in self._works or (self.start and path == "/upload")

    def do(self, path: str, fields: Any) -> Any:
        """What was asked for: bytes of a page, or content for JSON. InputError says why not, Busy to come later."""
        if not isinstance(fields, dict):
            raise InputError(f"found {fields!r:.60}, expected an object")
        return self._works[path](fields)

    def stop(self) -> None:
        """End the report that is being written."""
        self._reporter.stop()

    def _job(self) -> Path:
        """A folder for one work."""
        place = self.folder / f"job-{next(self._jobs)}"
        place.mkdir(mode=0o700)
        return place

    def report(self, _fields: Mapping[str, Any]) -> bytes:
        """The report of the result on the page, by `okid-report` with the files that belong to it."""
        raw, files = self.session.result(), self.session.config.report
        if raw is None:
            raise InputError("there is no result yet, expected a run that has ended")
        if not self._reporting.acquire(blocking=False):
            raise Busy("a report is being written, try again when it is there")
        try:
            place = self._job()
            result, page = files.result or place / "result.json", place / "report.html"
            if files.result is None:
                result.write_text(json.dumps(raw), encoding="utf-8")
            command = [sys.executable, "-P", "-m", "okid.report", str(result), *files.options(), "--out", str(page)]
            self._reporter.run(command)
            return page.read_bytes()
        finally:
            self._reporting.release()

    def geometry(self, fields: Mapping[str, Any]) -> dict[str, str]:
        """Show the finished result on the structure of a table that was typed; its [geometry] as TOML."""
        files, table = self.session.config.report, fields.get("table")
        if files.result is None or self.session.result() is None:
            raise InputError("there is no finished result, expected a result or records that were identified")
        if not isinstance(table, str) or not table.strip():
            raise InputError("the table is empty, expected rows such as node,1,0,0,3 and sensor,acc1,1,x")
        with self._changing:
            place = self._job() / "geometry.csv"
            place.write_text(table, encoding="utf-8")
            try:
                toml = geometry_toml(read_geometry(place))
                ready = over(files.result, replace(files, geometry=place))
            except InputError as fault:
                raise InputError(str(fault).replace(str(place), "the table")) from None
            self.session.show(replace(ready.config, path=self.session.config.path), lambda own: Finished(own, ready))
        return {"toml": toml}

    def upload(self, name: str, length: int, source: BufferedIOBase) -> dict[str, str]:
        """Keep `length` bytes of `source` under that name in the private folder. InputError above the bound."""
        shown = re.sub(r"[^\w.() +-]", "_", name.replace("\\", "/").rpartition("/")[2]).lstrip("-. ")[-120:]
        bound = int(max_memory_mb() * 1e6 * UPLOAD_SHARE)
        with self._changing:
            self._uploads += 1
            if self._uploads > MOST_UPLOADS or self._uploaded + length > bound:
                raise InputError(
                    f"{shown}: {length} bytes; dropped files may have {bound} bytes together and be {MOST_UPLOADS}: "
                    "name the file instead, it is then read where it is"
                )
            self._uploaded += length
            place = self._job() / (shown or "record.csv")
        with place.open("xb") as target:
            left = length
            while left:
                piece = source.read(min(left, PIECE))
                if not piece:
                    raise InputError(f"{shown}: {length - left} of {length} bytes came")
                target.write(piece)
                left -= len(piece)
        return {"path": str(place)}

    def look(self, fields: Mapping[str, Any]) -> dict[str, Any]:
        """What a name that was typed is: `kind` and what a page needs to go on."""
        text = _text(fields, "path")
        if is_bus(text):
            return {"kind": "bus", "path": text, "serial": text.startswith("/")}
        path = named_file(text)
        found = kind_of(path)
        kind = "record" if found is None or found.key in ("table", "binary") else found.key
        if kind == "folder":
            names = sorted(one.name for one in path.iterdir() if one.is_file() and not one.name.startswith("."))
            return {"kind": kind, "path": str(path), "files": names[:MOST_FILES]}
        if kind == "config":
            return {"kind": kind, "path": str(path)}
        if kind in ("journal", "log", "result"):
            return {"kind": kind, "path": str(path)}
        if kind != "record":
            raise InputError(f"{path}: is {found and found.words}, expected a record, a log, a journal or a result")
        record = open_record(path)
        channels = [
            {"name": name, "unit": unit, "side": side}
            for name, unit, side in zip(record.names, record.units, proposed(record), strict=True)
        ]
        return {"kind": kind, "path": str(path), "channels": channels, "fs_hz": record.fs_hz,
                "samples": len(record.samples)}  # fmt: skip

    def propose(self, fields: Mapping[str, Any]) -> dict[str, str]:
        """Write the config that `okid init` proposes for a bus; its text, and the command that does the same."""
        options, name = init_options(fields), _text(fields, "config")
        if not name.endswith(".toml"):
            raise InputError(f"the config file is {name!r}, expected a new name that ends with .toml")
        config = Path(name).expanduser().absolute()
        Child().run([needed_program(), "init", str(config), *options])
        self._proposed.add(config)
        return {"path": str(config), "toml": config.read_text(encoding="utf-8"),
                "command": shlex.join(["okid", "init", str(config), *options])}  # fmt: skip

    def run(self, fields: Mapping[str, Any]) -> dict[str, str]:
        """Begin `okid run` of a config; `toml`: how one that was proposed here reads by now."""
        config, toml = named_file(_text(fields, "path")), fields.get("toml")
        with self._changing:
            self._require_rest()
            if config in self._proposed and isinstance(toml, str):
                config.write_text(toml, encoding="utf-8")
            page = read_config(config)
            result = config.with_name(f"{config.stem}-{time.strftime('%Y%m%d-%H%M%S')}.json")

            def begin(session: Session) -> Running:
                self._running = Running(session, config, result)
                return self._running

            self.session.show(page, begin)
        watch = shlex.join(["okid-live", str(config), "--open"])
        return {"command": f"{watch}\n{shlex.join(['okid', 'run', str(config), f'--json={result}'])}"}

    def end(self, _fields: Mapping[str, Any]) -> dict[str, str]:
        """Ask the run to end with its result."""
        if self._running is None or not self._running.goes_on:
            raise InputError("no run goes on")
        self._running.finish()
        return {}

    def _require_rest(self) -> None:
        if self._running is not None and self._running.goes_on:
            raise Busy("a run goes on: end it first")

    def identify(self, fields: Mapping[str, Any]) -> dict[str, str]:
        """Begin to identify the files that are named; the command and the TOML that do the same."""
        files = [named_file(one) for one in _texts(fields, "files", MOST_FILES)]
        if not files:
            raise InputError("no record was named, expected one file or several")
        options = identify_options(fields)
        if not _texts(fields, "outputs", MOST_NAMES):
            raise InputError("no outputs were chosen, expected the responses that were measured")
        fs_hz = fields.get("fs_hz")
        toml = spec_of(fields, files, fs_hz if isinstance(fs_hz, int | float) else None)
        given = ReportFiles(record=tuple(files))
        begin = PageConfig(files[0], None, True, "", length_s=0.0)
        with self._changing:
            self._require_rest()
            place = self._job()
            self.session.show(begin, lambda session: Identified(session, given, options, place))
        words = ["okid", "identify", *map(str, files), *options, "--json=result.json"]
        return {"command": shlex.join(words), "toml": toml}

    def open(self, fields: Mapping[str, Any]) -> dict[str, str]:
        """Show a result, or replay a journal, or a log with its config."""
        path = named_file(_text(fields, "path"))
        found = kind_of(path)
        with self._changing:
            self._require_rest()
            place = self._job()
            if found is not None and found.key == "result":
                records = tuple(named_file(one) for one in _texts(fields, "records", MOST_FILES))
                self.session.show(*page_of_result(path, ReportFiles(record=records)))
                more = ["--record", *map(str, records)] if records else []
                return {"command": shlex.join(["okid-live", str(path), *more])}
            config = _text(fields, "config")
            show_log(self.session, path, named_file(config) if config else None, [], place)
        return {"command": shlex.join(["okid-live", str(path), *(["-c", config] if config else [])])}


def page_of_log(path: Path, config: Path | None) -> PageConfig:
    """What the page of a log or a journal knows before it is read. InputError where the config is missing or wrong."""
    found = kind_of(path)
    if found is not None and found.key == "journal":
        if config is not None:
            raise InputError(f"{path}: a journal holds its own config, found -c {config}: leave it out")
        return PageConfig(path, None, True, "", length_s=0.0)
    if config is None:
        raise InputError(f"{path}: a log needs the config it was measured with: -c CONFIG.toml")
    return config_of_log(path, config)


def show_log(session: Session, path: Path, config: Path | None, options: Sequence[str], folder: Path) -> None:
    """Replay it in the session."""
    page = page_of_log(path, config)
    session.show(page, lambda own: Replayed(own, path, config, options, folder))
