# SPDX-License-Identifier: MIT
"""Frames and bytes in; samples, gaps, events and the result out: a capture of the host library, as in `okid run`."""

from __future__ import annotations

import ctypes
import json as text_of_json
import os
from collections.abc import Iterable
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self

import numpy as np
from numpy.typing import NDArray

from okid._errors import InputError
from okid.abi import host
from okid.abi.turns import Turn, in_turn
from okid.capture.config import BusConfig, CaptureConfig, load_config

if TYPE_CHECKING:
    import can

Real = NDArray[np.float64]

# drv_frame_t of drv/frame.h
FRAME = np.dtype([
    ("time_ns", "<i8"), ("device_time_ns", "<i8"), ("id", "<u4"), ("flags", "u1"), ("loss", "u1"), ("bus", "u1"),
    ("length", "u1"), ("data", "S64"),
])  # fmt: skip
EXTENDED, REMOTE, ERROR, FD, BRS, ESI = 1, 2, 4, 8, 16, 32  # flags


class _Options(ctypes.Structure):
    """okid_host_capture_options_t."""

    _fields_ = [
        ("size", ctypes.c_uint32), ("identify", ctypes.c_int32), ("live", ctypes.c_int32), ("record", ctypes.c_int32),
        ("table", ctypes.c_int32), ("keep_samples", ctypes.c_int32), ("keep_events", ctypes.c_int32),
        ("reserved", ctypes.c_int32), ("events", ctypes.c_char_p), ("json", ctypes.c_char_p),
        ("duration_s", ctypes.c_double), ("trigger_ns", ctypes.c_int64),
    ]  # fmt: skip


class _Rows(ctypes.Structure):
    _fields_ = [("first", ctypes.c_int64), ("count", ctypes.c_int64), ("rows", ctypes.POINTER(ctypes.c_double))]


@dataclass
class BusCounts:
    """What came over a bus and what did not. lost: frames missing on the grid by cause (sequence, crc, stall ..)."""

    received: int = 0
    out_of_order: int = 0
    duplicate: int = 0
    decode_errors: int = 0
    lost: dict[str, int] = field(default_factory=dict)
    more: dict[str, int] = field(default_factory=dict)  # damaged, skipped_bytes of a line; errors of a controller

    @property
    def lost_in_all(self) -> int:
        """Frames lost, whatever the cause."""
        return sum(self.lost.values())

    def text(self, name: str) -> str:
        """One line for a person."""
        causes = ", ".join(f"{cause} {number}" for cause, number in sorted(self.lost.items()))
        text = f"{name}: {self.received} received, {self.lost_in_all} lost" + (f" ({causes})" if causes else "")
        rest = {"out of order": self.out_of_order, "duplicate": self.duplicate, "not decodable": self.decode_errors}
        named = (rest | self.more).items()
        return ", ".join([text, *(f"{number} {what.replace('_', ' ')}" for what, number in named if number)])


def _counts(bus: dict[str, Any]) -> BusCounts:
    more = {key: bus[key] for key in ("damaged", "skipped_bytes", "refused") if key in bus}
    errors = bus.get("errors", {}).get("messages", 0)
    return BusCounts(
        bus["received"], bus["out_of_order"], bus["duplicate"], bus["decode_errors"],
        {cause: number for cause, number in bus["lost_by"].items() if number},
        more | ({"error_frames": errors} if errors else {}),
    )  # fmt: skip


def frames_of(messages: Iterable[can.Message], bus: int) -> NDArray[Any]:
    """Messages of python-can as an array of FRAME, all of one bus. About 2 us a frame."""
    rows = []
    for one in messages:
        flags = EXTENDED * one.is_extended_id
        if one.is_error_frame:
            flags |= ERROR
        elif one.is_remote_frame:
            flags |= REMOTE
        elif one.is_fd:
            flags |= FD | BRS * one.bitrate_switch | ESI * one.error_state_indicator
        data = bytes(one.data)
        rows.append((round(one.timestamp * 1e6) * 1000, 0, one.arbitration_id, flags, 0, bus, len(data), data))
    return np.array(rows, FRAME)


class Capture:
    """Put in what a device gives, take out samples (n, inputs + outputs) in SI units, NaN where one is missing; or have
    them identified on the way, as `okid run` does, with its events, table and result.

    identify=False: samples, gaps and counts only. duration: seconds of samples. trigger_at: when the edge of a GPIO
    line came, s since 1970 (for logs). events, json: files as of `okid run`, "-" = stdout. table: modes and result on
    stdout. live: from a device; record: journals as [record] of the config asks. keep_samples (default: without
    identification) and keep_events: they wait for take() and events().
    A context manager. Raises InputError for a config or an argument that is wrong.
    """

    def __init__(
        self,
        config: CaptureConfig | str | Path,
        *,
        identify: bool = True,
        duration: float | None = None,
        trigger_at: float | None = None,
        events: str | None = None,
        json: str | None = None,
        table: bool = False,
        live: bool = False,
        record: bool = False,
        keep_samples: bool | None = None,
        keep_events: bool = True,
    ) -> None:
        self.config = config if isinstance(config, CaptureConfig) else load_config(config)
        options = _Options()
        host.library().okid_host_capture_defaults(ctypes.byref(options))
        options.identify, options.live, options.record, options.table = identify, live, record, table
        options.keep_samples = (not identify) if keep_samples is None else keep_samples
        options.keep_events = keep_events
        options.events = None if events is None else os.fsencode(events)
        options.json = None if json is None else os.fsencode(json)
        options.duration_s = duration or 0.0
        options.trigger_ns = 0 if trigger_at is None else round(trigger_at * 1e6) * 1000
        self._handle: ctypes.c_void_p | None = None
        self._turn = Turn()
        self._kept: list[dict[str, Any]] = []
        read, made = ctypes.c_void_p(), ctypes.c_void_p()
        host.call("config_load", os.fsencode(self.config.path), None, ctypes.byref(read))
        try:
            host.call("capture_create", read, ctypes.byref(options), ctypes.byref(made))
        finally:
            host.library().okid_host_config_delete(read)
        self._handle = made
        self._of_interface = {bus.interface: n for n, bus in enumerate(self.config.buses) if not bus.serial}
        self._only = next(iter(self._of_interface.values())) if len(self._of_interface) == 1 else None
        self._serial = next((n for n, bus in enumerate(self.config.buses) if bus.serial or bus.type == "slcan"), 0)

    @in_turn
    def close(self) -> None:
        """Give the memory back; without finish() there is no result."""
        if self._handle is not None:
            host.library().okid_host_capture_delete(self._handle)
            self._handle = None

    def _open(self) -> ctypes.c_void_p:
        if self._handle is None:
            raise InputError("this capture is closed: make another one")
        return self._handle

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def __del__(self) -> None:
        if getattr(self, "_handle", None) is not None:  # without its turn: no other reference to it is left
            host.library().okid_host_capture_delete(self._handle)

    def use_bus(self, bus: BusConfig) -> None:
        """All that comes is of this one; else a message tells by its `channel` whose it is."""
        self._only = self._serial = self.config.buses.index(bus)

    def push(self, messages: Iterable[can.Message]) -> None:
        """Messages of python-can: one call of the library a batch. Those of no bus are left out."""
        if self._only is not None:
            return self.push_frames(frames_of(messages, self._only))
        parts = [
            frames_of([message], number)
            for message in messages
            if (number := self._of_interface.get(str(message.channel))) is not None
        ]
        return self.push_frames(np.concatenate(parts)) if parts else None

    @in_turn
    def push_frames(self, frames: NDArray[Any]) -> None:
        """An array of FRAME, in the order in which they came; `bus` is the place of the [[bus]] in the config."""
        given = np.ascontiguousarray(frames, FRAME)
        host.call("capture_frames", self._open(), given.ctypes.data, given.size)

    @in_turn
    def push_bytes(self, data: bytes, time_s: float | None = None) -> None:
        """Bytes of a serial line, in any pieces, and when they came; None = out of a file: by the node's clock, else
        one sample after the other."""
        stamp = 0 if time_s is None else round(time_s * 1e6) * 1000
        host.call("capture_bytes", self._open(), self._serial, data, len(data), stamp)

    @in_turn
    def link(self, up: bool, bus: int = 0) -> None:
        """The bus went away, or is back: what is lost between has the cause link_down."""
        host.call("capture_link", self._open(), bus, up)

    @in_turn
    def lost(self, socket_overflow: int = 0, driver: int = 0, bus: int = 0) -> None:
        """Frames that the source itself counted as lost, since the beginning."""
        host.call("capture_lost", self._open(), bus, socket_overflow, driver)

    @in_turn
    def trigger(self, time_s: float) -> None:
        """The edge of a trigger line, s since 1970."""
        host.call("capture_edge", self._open(), round(time_s * 1e9))

    @in_turn
    def serve(self) -> None:
        """While nothing comes: trigger lines, lamps and journals are looked after. Ten times a second."""
        host.call("capture_serve", self._open())

    @in_turn
    def open(self, log: str | Path) -> None:
        """A `candump -L` log or a journal, for play()."""
        host.call("capture_open", self._open(), os.fsencode(log))

    @in_turn
    def play(self, frames: int) -> int:
        """The next frames of the log; fewer than asked for = its end, or done. Returns how many."""
        played = ctypes.c_size_t()
        host.call("capture_play", self._open(), frames, ctypes.byref(played))
        return played.value

    @property
    @in_turn
    def done(self) -> bool:
        """As many samples or hits as were asked for have come."""
        return bool(host.library().okid_host_capture_done(self._open()))

    @in_turn
    def take(self, *, raw: bool = False, every: bool = False) -> list[Real]:
        """Blocks of samples that wait, in order. raw: numbers as they stand in the frames; every: channels of role aux
        too. A long silence is one block of NaN that takes no memory."""
        out: list[Real] = []
        rows = _Rows()
        width = len(self.config.channels)
        shown = width if every else len(self.config.wanted)
        while True:
            host.call("capture_rows", self._open(), raw, ctypes.byref(rows))
            if rows.count == 0:
                return out
            if not rows.rows:
                out.append(np.broadcast_to(np.full((1, shown), np.nan), (rows.count, shown)))
            else:
                block = np.ctypeslib.as_array(rows.rows, (rows.count, width))
                out.append(block[:, :shown].copy())

    @in_turn
    def events(self) -> list[dict[str, Any]]:
        """Events since the last call, as `okid run --events` writes them."""
        lines = host.library().okid_host_capture_events(self._open()).decode()
        kept, self._kept = self._kept, []
        return kept + [text_of_json.loads(line) for line in lines.splitlines()]

    @in_turn
    def stats(self) -> dict[str, Any]:
        """The counts by now, as a stats event."""
        text = host.library().okid_host_capture_stats(self._open())
        out: dict[str, Any] = text_of_json.loads(text)
        return out

    @property
    def counts(self) -> dict[str, BusCounts]:
        """Of each bus by name."""
        return {name: _counts(bus) for name, bus in self.stats()["bus"].items()}

    @property
    def silent(self) -> list[str]:
        """Channels of which nothing came."""
        return [name for name, one in self.stats()["channel"].items() if one["received"] == 0]

    @in_turn
    def finish(self) -> dict[str, Any] | None:
        """The stream ends: the last samples can be taken. Returns okid.result/1, None without identification.

        Raises IdentificationError when no model is possible.
        """
        host.call("capture_finish", self._open())
        self._kept = self.events()
        return next((event["result"] for event in self._kept[-1:] if event["type"] == "result"), None)
