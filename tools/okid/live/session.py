# SPDX-License-Identifier: MIT
"""One run, replay or record watched for all pages: events and samples in, frames for the browsers out."""

from __future__ import annotations

import json
import threading
import time
from collections import deque
from collections.abc import Callable
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from okid._errors import Error
from okid.frf import synthesise
from okid.live.config import PageConfig
from okid.live.diagram import DiagramMaker, Material
from okid.live.encoding import packed
from okid.live.feed import Feed
from okid.live.hub import Frame, Hub, Outbox, frame
from okid.live.measured import Measured
from okid.live.run_state import RunState

Real = NDArray[np.float64]

TICK_S, SLOW_TICKS, SPECTRA_TICKS = 0.1, 5, 10  # lanes ten times a second, tables twice, spectra once
ASLEEP_BYTES = 32 << 20
LOG_AT_A_TIME, WAKE_LINES = 100, 20
SAMPLES = b'{"type":"samples"'


def _no_number(text: str) -> float:
    raise ValueError(f"found {text}, expected a number or null")


class Source(Protocol):
    """Where events and samples come from, in a thread of its own between start() and stop()."""

    def start(self) -> None:
        """Begin."""

    def stop(self) -> None:
        """End; returns when nothing more comes and no process that it started is left."""


class Session:
    """Takes what a source gives, keeps what a page shows, and sends it to every open page.

    `source`: makes the source for this session, None = okid's socket ([publish] socket of the config), or nothing where
    there is none. While no page is open the samples of a socket are only kept as text, at most 32 MB, and nothing is
    computed.
    """

    def __init__(self, config: PageConfig, source: Callable[[Session], Source] | None = None) -> None:
        self.config = config
        self.takes_files = False  # a start page: it may be asked for another subject
        self.hub = Hub(self._pages_changed)
        self.run = RunState()
        self.measured: Measured | None = None
        self.diagram: dict[str, Any] | None = None
        self.faults = 0
        self._lock = threading.RLock()
        self._runs = self._drawn_run = 0
        self._born = int(time.time())
        self._asleep: deque[bytes] = deque()
        self._asleep_bytes = 0
        self._samples_seen = False
        self._awake, self._stop = threading.Event(), threading.Event()
        self._sent: dict[str, Any] = {}
        self._source: Source | None = None
        if source is not None:
            self._source = source(self)
        elif config.socket is not None:
            self._source = Feed(config.socket, self.line, self.linked)
        self._maker = DiagramMaker(self._material, config.identification, self._show_diagram)
        self._pace = threading.Thread(target=self._run_pace, name="okid-live pace", daemon=True)

    def start(self) -> None:
        """Begin to listen."""
        if self._source is not None:
            self._source.start()
        self._maker.start()
        self._pace.start()

    def stop(self) -> None:
        """End all threads and pages, which get what is new first."""
        self._stop.set()
        self._awake.set()
        with self._lock:
            for one in self._frames(0) if len(self.hub) else ():
                self.hub.send(one)
        self.hub.close()
        self._maker.stop()
        if self._source is not None:
            self._source.stop()
        if self._pace.is_alive():
            self._pace.join(5.0)

    def show(self, config: PageConfig, source: Callable[[Session], Source]) -> None:
        """Another subject from here on: the source before is stopped, and nothing of it is shown any more."""
        if self._source is not None:
            self._source.stop()
        with self._lock:
            self.config, self.run = config, RunState()
            self._maker.identification = config.identification
            self._begin()
        self._source = source(self)
        self._source.start()

    def describe(self, config: PageConfig) -> None:
        """What became known of the subject since; a `start` event that follows brings it to the pages."""
        with self._lock:
            self.config = config
            self._maker.identification = config.identification

    # -- from okid ------------------------------------------------------------------------------------------------

    def linked(self, there: bool) -> None:
        """okid came or went."""
        with self._lock:
            self.run.linked(there)

    def working(self, text: str) -> None:
        """What is being done now, for the badge."""
        with self._lock:
            self.run.working(text)

    def failed(self, text: str) -> None:
        """It came to nothing, and why."""
        with self._lock:
            self.run.failed(text)

    def ended(self, text: str) -> None:
        """Nothing more comes."""
        with self._lock:
            self.run.ended(text)

    def event(self, event: dict[str, Any]) -> None:
        """An event built as docs/reference/events.md has it; else KeyError or TypeError."""
        with self._lock:
            self._take_event(event)

    def samples(self, first: int, values: Real) -> None:
        """Samples first .. of all channels (m, count), NaN = missing; a `start` event named the channels before.
        InputError for another m."""
        with self._lock:
            if self.measured is not None:
                self._place(first, values, (first + values.shape[1]) / self.measured.rate_hz)

    def line(self, line: bytes) -> None:
        """One line of okid's socket. A damaged one is counted and left out."""
        with self._lock:
            waits = len(self.hub) == 0 or len(self._asleep) > 0  # behind those that are not taken in yet
            if line.startswith(SAMPLES) and waits and not self.config.hammer:
                self._keep_asleep(line)
            else:
                self._take_line(line)

    def _keep_asleep(self, line: bytes) -> None:
        self._asleep.append(line)
        self._asleep_bytes += len(line)
        while self._asleep_bytes > ASLEEP_BYTES:
            self._asleep_bytes -= len(self._asleep.popleft())

    def _take_line(self, line: bytes) -> None:
        try:
            event = json.loads(line, parse_constant=_no_number)
            if not isinstance(event, dict) or not isinstance(event["type"], str):
                raise TypeError("not an event")
            if event["type"] == "samples":
                self._take_samples(event)
            else:
                self._take_event(event)
        except (ValueError, KeyError, TypeError, AttributeError, RecursionError, ArithmeticError, MemoryError) as fault:
            self.faults += 1
            if self.faults <= 3:
                self.run.note(f"a line of okid could not be read ({type(fault).__name__}: {str(fault)[:120]})")

    def _take_samples(self, event: dict[str, Any]) -> None:
        if self.measured is None:
            return  # joined before a `start` that names the channels
        values = np.array(event["values"], dtype=np.float64)
        first = event["first"]
        if not isinstance(first, int) or first < 0:
            raise TypeError(f"first is {first!r}")
        self._place(first, values, float(event["t"]))

    def _place(self, first: int, values: Real, t: float) -> None:
        assert self.measured is not None
        values[~np.isfinite(values)] = np.nan
        self.measured.add(first, values)
        self._samples_seen = True
        self.run.t = max(self.run.t, t)

    def _take_event(self, event: dict[str, Any]) -> None:
        if self.run.take(event):
            self._begin()
        measured, sample = self.measured, event.get("sample")
        if measured is None or not isinstance(sample, int):
            return
        if event["type"] == "trigger" or (event["type"] == "change" and event.get("restarted")):
            measured.restart(sample)
        elif event["type"] == "hit" and event.get("accepted"):
            measured.hit(sample)

    def _begin(self) -> None:
        """Another run: nothing of the one before is shown any more."""
        self._runs += 1
        self._asleep.clear()
        self._asleep_bytes = 0
        self._samples_seen = False
        self.diagram, self._sent = None, {}
        run, self.measured = self.run, None  # where the channels are refused there is no picture of them
        self.measured = Measured(run.channels, run.rate_hz, self.config) if run.channels and run.rate_hz else None
        if len(self.hub):
            self.hub.send(self._snapshot())

    # -- to the pages ---------------------------------------------------------------------------------------------

    def open_page(self) -> Outbox | None:
        """What a new page is to be sent, beginning with all that is known; None when there are too many pages.

        What was kept as text is taken in first, a little at a time: okid's socket is read all the while.
        """
        outbox = Outbox(self._snapshot)
        left = len(self._asleep) + WAKE_LINES
        while True:
            time.sleep(0)  # the reader's turn
            with self._lock:
                self._wake(WAKE_LINES if left > 0 else len(self._asleep))
                left -= WAKE_LINES
                if self._asleep:
                    continue
                if not self.hub.open(outbox):
                    return None
                outbox.put(self._snapshot())
                lanes = self._lanes(0)
                if lanes is not None:
                    outbox.put(lanes)
                return outbox

    def _wake(self, lines: int) -> None:
        """Take in so many of the oldest lines that were kept as text."""
        for _ in range(min(lines, len(self._asleep))):
            line = self._asleep.popleft()
            self._asleep_bytes -= len(line)
            self._take_line(line)

    def _pages_changed(self, count: int) -> None:
        self._maker.wanted(count > 0)
        if count > 0:
            self._awake.set()
        else:
            self._awake.clear()

    def _state(self) -> dict[str, Any]:
        run, alarm = self.run, self.run.alarm
        return {
            "link": run.link,
            "text": run.link_text,
            "t": run.t,
            "alarm": alarm is not None,
            "samples": "live" if self._samples_seen else ("awaited" if self.config.samples else "off"),
            "faults": self.faults,
            "marks": list(run.marks),
            "measured": self.measured.facts() if self.measured is not None else None,
        }

    def _facts(self) -> dict[str, Any]:
        """What does not change during a run."""
        start, geometry = self.run.start, self.config.geometry
        wanted = self.config.identification
        notes = start.get("notes")
        title = (notes.get("title") if isinstance(notes, dict) else None) or self.config.title
        return {
            "title": str(title or ""),
            "config": self.config.path.name,
            "wall_time": start.get("wall_time"),
            "rate_hz": self.run.rate_hz,
            "channels": [each.__dict__ for each in self.run.channels],
            "start": self.takes_files,
            "absent": self.config.absent,
            "finished": self.config.report.result is not None,
            "length_s": self.config.length_s,
            "geometry": None
            if geometry is None
            else {
                **{key: getattr(geometry, key) for key in ("nodes", "lines", "surfaces", "dofs")},
                "fixed": geometry.at_rest(geometry.dofs),
            },
            "hammer": self.config.hammer,
            "method": wanted.method,
            "window_s": wanted.window_s,
            "forgetting": wanted.forgetting,
        }

    def _snapshot(self) -> Frame:
        """All but the lanes."""
        with self._lock:
            run = self.run
            return frame("hello", {
                "run": f"{self._born}.{self._runs}",
                "facts": self._facts(),
                "state": self._state(),
                "modes": run.modes,
                "stats": run.stats,
                "tracks": self._tracks(0),
                "log": {"entries": list(run.log)},
                "hits": list(run.hits),
                "diagram": self.diagram,
                "result": run.result,
            })  # fmt: skip

    def _tracks(self, number: int) -> dict[str, Any]:
        tracks = self.run.tracks
        return {"generation": tracks.generation, "updates": tracks.since(number)}

    def _lanes(self, first: int) -> Frame | None:
        """Columns first .. of every channel."""
        if self.measured is None:
            return None
        start, low, high, marks = self.measured.envelope.since(first)
        if low.shape[1] == 0:
            return None
        return frame("lanes", {"first": start, "count": low.shape[1], "low": packed(low), "high": packed(high),
                               "marks": packed(marks)}, passing=True)  # fmt: skip

    def _changed(self, key: str, value: Any) -> bool:
        """True once for each new value."""
        if self._sent.get(key) == value:
            return False
        self._sent[key] = value
        return True

    def _run_pace(self) -> None:
        count = 0
        while True:
            self._awake.wait()
            if self._stop.wait(TICK_S):
                return
            count += 1
            with self._lock:
                for one in self._frames(count):
                    self.hub.send(one)

    def _frames(self, count: int) -> list[Frame]:
        """What is new since the last tick."""
        run, out = self.run, []
        lanes = self._lanes(self._sent.get("lanes", 0))
        if lanes is not None and self.measured is not None:
            self._sent["lanes"] = self.measured.envelope.end
            out.append(lanes)
        if self._changed("log", run.logged):
            newest = [entry for entry in run.log if entry["n"] > self._sent.get("log_n", 0)][-LOG_AT_A_TIME:]
            self._sent["log_n"] = run.logged
            out.append(frame("log", {"entries": newest}))
        ended = self._changed("link", run.link_text)
        if ended or (count % SLOW_TICKS == 0 and self._changed("state", json.dumps(self._state()))):
            out.append(frame("state", self._state()))
        if count % SLOW_TICKS == 0 or ended:
            out += self._slow_frames()
        if count % SPECTRA_TICKS == 0 and self.measured is not None:
            averages = self.measured.averages
            if self._changed("spectra", (averages.tried, averages.length, run.result is None)):
                out.append(frame("spectra", self.measured.facts()))
        return out

    def _slow_frames(self) -> list[Frame]:
        run, out = self.run, []
        for kind, value in (("modes", run.modes), ("stats", run.stats), ("result", run.result)):
            if value is not None and self._changed(kind, value):
                out.append(frame(kind, value))
        tracks = run.tracks
        last = tracks.updates[-1]["n"] if tracks.updates else 0
        before = self._sent.get("tracks", (tracks.generation, 0))
        if self._changed("tracks", (tracks.generation, last)):
            out.append(frame("tracks", self._tracks(before[1] if before[0] == tracks.generation else 0)))
        if run.hits and self._changed("hits", run.hits[-1].get("number")):
            out.append(frame("hits", list(run.hits)))
        return out

    # -- computed for pages ---------------------------------------------------------------------------------------

    def _material(self) -> Material | None:
        with self._lock:
            measured = self.measured
            if measured is None or not self._changed("material", (self._runs, measured.recent.end)):
                return None
            self._drawn_run = self._runs
            return measured.material()

    def _show_diagram(self, diagram: dict[str, Any]) -> None:
        with self._lock:
            if self._drawn_run == self._runs:
                self.diagram = diagram
                self.hub.send(frame("diagram", diagram))

    def modes_at(self, t: float) -> dict[str, Any] | None:
        """The `modes` event at stream time t in s, or the last one that is kept before it; None before the first."""
        with self._lock:
            return self.run.tracks.at(t)

    def result(self) -> dict[str, Any] | None:
        """The whole okid.result/1, None while there is none."""
        with self._lock:
            return self.run.whole

    def spectra(self, channels: list[int], output: int, given: int) -> dict[str, Any]:
        """Spectra of those channels and the response of an output to an input (all counted from 0), with the model's
        when there is a result. Raises InputError for numbers that are not there."""
        with self._lock:
            measured, model, result = self.measured, self.run.model, self.run.result
            if measured is None:
                return {"text": "no samples yet"}
            if any(not 0 <= k < len(measured.channels) for k in channels):
                raise Error(f"channels from 0 to {len(measured.channels) - 1}")
            averages = measured.averages
            line = averages.frequency_hz
            out: dict[str, Any] = {
                **measured.facts(),
                "frequency": packed(line),
                "channels": channels,
                "spectra": [packed(averages.spectrum(k)) for k in channels],
            }
            if measured.n_u == 0 or measured.n_y == 0:
                return {**out, "response": None}
            if not (0 <= output < measured.n_y and 0 <= given < measured.n_u):
                raise Error(f"output 0 to {measured.n_y - 1}, input 0 to {measured.n_u - 1}")
            found = averages.response(output, given)
        out["response"] = None if found is None else {
            "output": output, "input": given, "averages": found.averages, "magnitude": packed(np.abs(found.response)),
            "phase": packed(np.degrees(np.angle(found.response))), "coherence": packed(found.coherence),
        }  # fmt: skip
        if model is not None and result is not None and found is not None:
            parts = (model["A"], np.array(model["B"])[:, [given]], np.array(model["C"])[[output]],
                     np.array(model["D"])[[output]][:, [given]])  # fmt: skip
            own = synthesise(*parts, model["dt"], line)[:, 0, 0]
            out["response"].update(model=packed(np.abs(own)), model_phase=packed(np.degrees(np.angle(own))))
        return out
