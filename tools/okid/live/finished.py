# SPDX-License-Identifier: MIT
"""What is over, shown as a run that has ended: a result with its records, or records that are identified first."""

from __future__ import annotations

import threading
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from okid._errors import Error
from okid.abi.program import needed_program
from okid.data.geometry import Geometry
from okid.data.records import Record
from okid.formats.geometry_file import read_geometry
from okid.live.child import Child
from okid.live.config import Identification, PageConfig, ReportFiles
from okid.live.session import Session
from okid.report.loaded import Loaded, load_result
from okid.report.measured import channels_of, open_record
from okid.report.other_kinds import check_kind
from okid.result.shape_places import places_of_shapes, struck_at

Real = NDArray[np.float64]
CHUNK = 1 << 18  # numbers that go to the session at once: pages are served in between
LARGE_BYTES = 64 << 20  # of records: above it the page is there before they are
NO_RECORD = "no record was given: okid-live RESULT.json --record FILE shows its signals"
OTHERS = {"responses": "frequency responses", "set_ups": "set-ups"}


class Over(NamedTuple):
    """A result with what belongs to it; `channels` None: no signals, and `absent` says why."""

    result: Loaded
    config: PageConfig
    channels: Record | None


def feed_samples(session: Session, samples: Real) -> None:
    """All rows (N, m) of a record, from sample 0 on."""
    step = max(1, CHUNK // samples.shape[1])
    for first in range(0, len(samples), step):
        session.samples(first, np.array(samples[first : first + step].T))


def _forces(raw: dict[str, Any]) -> list[str]:
    """The columns of the forces; of a roving hammer "force@1", "force@2" are one."""
    struck = [struck_at(name) if raw.get("shape_dofs") else None for name in raw["inputs"]]
    return list(dict.fromkeys(name if at is None else at[0] for name, at in zip(raw["inputs"], struck, strict=True)))


def _joined(result: Loaded, files: Sequence[Path]) -> Record:
    """The channels of the result in all records, one missing sample between two of them."""
    names = _forces(result.raw) + result.outputs
    parts = [channels_of(result, open_record(file), str(file), names) for file in files]
    first = parts[0]
    gap = np.full((1, len(first.names)), np.nan)
    rows = first.samples
    if len(parts) > 1:
        rows = np.vstack([block for part in parts for block in (part.samples, gap)][:-1])
    return Record(first.names, rows, result.fs, first.units, first.title, first.start_time, first.roles, first.dofs)


def _placed(geometry: Geometry, raw: dict[str, Any]) -> Geometry:
    """With a degree of freedom for each output, in their order; of a roving hammer its own numbers stay."""
    if raw.get("shape_dofs"):
        return geometry
    places: list[Any] = places_of_shapes(geometry, raw)
    return replace(geometry, dofs=places)


def over(path: Path, files: ReportFiles) -> Over:
    """A result file and the records beside it, read and checked. InputError names the file and what is wrong.

    Cost: memory of the records, as `max_memory_mb` bounds it.
    """
    result = load_result(path)
    raw = result.raw
    other = next((words for key, words in OTHERS.items() if raw.get(key)), None)
    record = None
    for file in files.record:
        check_kind(file, "record")
    if files.record and other is None:
        record = _joined(result, files.record)
    place = files.geometry or files.config
    geometry = None if place is None else _placed(read_geometry(place), raw)
    absent = f"the result is of {other}: its signals are in the report" if other else NO_RECORD
    wanted = Identification(str(raw.get("method", "okid-era")), int(raw.get("p") or Identification.p),
                            int(raw.get("rows") or 0), str(raw.get("detrend", "mean")))  # fmt: skip
    if wanted.method in ("plscf", "poser"):
        wanted = replace(wanted, method="auto")
    length = (len(record.samples) if record is not None else int(raw["samples"])) / result.fs
    config = PageConfig(
        path, None, record is not None, "" if record is None else record.title, wanted, geometry, absent=absent,
        length_s=length, report=replace(files, result=path),
    )  # fmt: skip
    return Over(result, config, record)


def _channels(found: Over) -> list[dict[str, Any]]:
    raw, record = found.result.raw, found.channels
    forces, roves, out = _forces(raw), bool(raw.get("shape_dofs")), []
    for k, name in enumerate([*forces, *raw["outputs"]]):
        place, unit = k - len(forces) + 1, "" if record is None else record.units[k]
        role = "aux" if roves else "force"  # there is no response to a force that moves about
        if place > 0:
            role = (record.roles[k] if record is not None else None) or "response"
        out.append({"name": name, "role": role, "unit": unit, "dof": None if place < 1 or roves else place})
    return out


def show_over(session: Session, found: Over) -> None:
    """The result, and the signals where there is a record, into the session."""
    result, config, record = found
    session.describe(config)
    when = None if record is None or record.start_time is None else record.start_time.isoformat()
    session.event({"type": "start", "t": 0.0, "config": config.path.name, "wall_time": when or "", "rate_hz": result.fs,
                   "channels": _channels(found), "notes": {"title": config.title}})  # fmt: skip
    if record is not None:
        feed_samples(session, record.samples)
    session.event({"type": "result", "t": config.length_s or 0.0, "result": result.raw})


def _names(files: ReportFiles) -> str:
    return ", ".join(file.name for file in files.record[:3])


def _nothing(_text: str) -> None:
    pass


class Worker:
    """A source that works in a thread of its own: work() of what inherits it. What it cannot do is said on the pages,
    and `on_failure(text)` is called."""

    def __init__(self, session: Session) -> None:
        self.session, self.child = session, Child()
        self.on_failure: Callable[[str], None] = _nothing
        self._thread = threading.Thread(target=self._run, name="okid-live worker", daemon=True)

    def start(self) -> None:
        """Begin."""
        self._thread.start()

    def stop(self) -> None:
        """End the program that runs, and the thread."""
        self.child.stop()
        if self._thread.is_alive():
            self._thread.join()

    def work(self) -> None:
        """What there is to do; Error or OSError say why it cannot be done."""

    def _run(self) -> None:
        try:
            self.work()
        except (Error, OSError, MemoryError) as fault:
            if self.child.stopped:
                return
            text = str(fault) or type(fault).__name__
            self.session.failed(text)
            self.on_failure(text)


class Finished(Worker):
    """A result that was read before."""

    def __init__(self, session: Session, found: Over) -> None:
        super().__init__(session)
        self._found = found

    def work(self) -> None:
        show_over(self.session, self._found)


class Opened(Worker):
    """A result and its records, read while the page is there."""

    def __init__(self, session: Session, path: Path, files: ReportFiles) -> None:
        super().__init__(session)
        self._path, self._files = path, files

    def work(self) -> None:
        self.session.working(f"reading {_names(self._files)}")
        show_over(self.session, over(self._path, self._files))


def page_of_result(path: Path, files: ReportFiles) -> tuple[PageConfig, Callable[[Session], Worker]]:
    """What the page of a result begins with, and its source. InputError as over() has it; of records above 64 MB the
    source says what is wrong, they are read while the page is there."""
    if sum(one.stat().st_size for one in files.record if one.is_file()) > LARGE_BYTES:
        return PageConfig(path, None, True, "", length_s=0.0), lambda session: Opened(session, path, files)
    ready = over(path, files)
    return ready.config, lambda session: Finished(session, ready)


class Identified(Worker):
    """Records that `okid identify` works on: files, its options, and the folder for the result."""

    def __init__(self, session: Session, files: ReportFiles, options: Sequence[str], folder: Path) -> None:
        super().__init__(session)
        self._files, self._options, self._folder = files, list(options), folder

    def work(self) -> None:
        names = _names(self._files)
        self.session.working(f"identifying {names}")
        target = self._folder / "result.json"
        command = [needed_program(), "identify", *map(str, self._files.record), *self._options, f"--json={target}"]
        self.child.run(command, self.session.working)
        self.session.working(f"reading {names}")
        try:
            found = over(target, self._files)
        except Error as fault:  # a file that the program alone reads: its result is there all the same
            found = over(target, replace(self._files, record=()))
            found = found._replace(config=replace(found.config, absent=f"no signals: {fault}"))
        shown = replace(found.config, path=self._files.record[0])
        show_over(self.session, found._replace(config=shown))
