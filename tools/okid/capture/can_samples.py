# SPDX-License-Identifier: MIT
"""Frames of a python-can bus or log to blocks of samples: decoded, on the sample grid, in SI units."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path

import can
import numpy as np
from numpy.typing import NDArray

from okid.capture.channel_bits import FrameFilter, Selector
from okid.capture.config import BusConfig, CaptureConfig, ChannelConfig, load_config
from okid.capture.grid import Grid
from okid.capture.lane import BusCounts, Frame, Lane
from okid.capture.reader_thread import ReaderThread
from okid.capture.signal_bits import SignalBits

Real = NDArray[np.float64]

MOST_OTHERS, MOST_NAMED = 32, 8  # identifiers of no channel that are counted, and that are told


class _Reader:
    """The channels that come in the same frames: data to numbers and counter."""

    def __init__(self, channels: list[ChannelConfig]) -> None:
        self.bits = [channel.bits for channel in channels if channel.bits is not None]
        self.sequence = channels[0].sequence
        self.selectors = channels[0].selectors
        self.lane: Lane | None = None
        self._ends = max(bits.end for bits in [*self.bits, *([self.sequence] if self.sequence else [])])
        self._plain = all(bits.value == "integer" for bits in self.bits)

    def holds(self, data: bytes | bytearray) -> bool:
        """Do its multiplexors say that these channels are in the frame?"""
        return all(selector.bits.raw(data) in selector.values for selector in self.selectors)

    def read(self, time_us: int, data: bytes | bytearray) -> Frame | None:
        """None when the frame is too short, or a float in it is no number."""
        if self._ends > len(data):
            return None
        values: list[float] = [bits.number(data) for bits in self.bits]  # type: ignore[misc]
        if not self._plain and not np.isfinite(values).all():
            return None
        return Frame(time_us, values, self.sequence.raw(data) if self.sequence else None)


class CanSamples:
    """Push frames, take blocks (n, inputs + outputs) in SI units; NaN where a sample is missing.

    `counts`, by the name of the bus, say what was received and lost. `limit`: no sample from there on. With one CAN bus
    in the config all frames are its own, with several the `channel` of a frame says whose it is. O(signals of the
    frame) a frame; memory bounded by two seconds of samples.
    """

    def __init__(self, config: CaptureConfig, *, limit: int | None = None) -> None:
        self.config = config
        wanted = config.wanted
        self.grid = Grid(config.rate_hz, len(wanted), limit)
        self.counts = {bus.name: BusCounts() for bus in config.buses}
        self.error_frames = 0
        self.silent: list[str] = []  # channels without a frame, after finish()
        self.others: dict[tuple[int, bool], int] = {}  # identifier, extended: frames that no channel asks for
        self._scale = np.array([channel.scale for channel in wanted])
        self._offset = np.array([channel.offset for channel in wanted])
        self._readers: dict[tuple[str, int, bool], list[_Reader]] = {}
        self._masks: list[int] = []
        self._columns: list[tuple[_Reader, list[ChannelConfig]]] = []
        self._make_readers(wanted)
        can_buses = [bus for bus in config.buses if not bus.serial]
        self._only = can_buses[0].name if len(can_buses) == 1 else None  # else by the channel of the message
        self._of_interface = {bus.interface: bus.name for bus in can_buses}

    def _make_readers(self, wanted: tuple[ChannelConfig, ...]) -> None:
        groups: dict[tuple[str, FrameFilter, tuple[Selector, ...]], list[int]] = {}
        for column, channel in enumerate(wanted):
            if channel.frame is not None:
                groups.setdefault((channel.bus, channel.frame, channel.selectors), []).append(column)
        for (bus, frame, _), columns in groups.items():
            channels = [wanted[column] for column in columns]
            reader = _Reader(channels)
            bits: SignalBits | None = reader.sequence
            reader.lane = self.grid.add_lane(columns, self.counts[bus], bits.length if bits else None)
            self._readers.setdefault((bus, frame.can_id, frame.extended), []).append(reader)
            self._columns.append((reader, channels))
            if frame.mask and frame.mask not in self._masks:
                self._masks.append(frame.mask)
        self._masks.sort(key=lambda mask: -mask.bit_count())  # the strictest first

    def use_bus(self, bus: BusConfig) -> None:
        """All frames come from this one."""
        self._only = bus.name

    def push(self, message: can.Message) -> None:
        """Decode a frame and place it. Frames of no channel, remote and error frames are no samples."""
        if message.is_error_frame:
            self.error_frames += 1
            return
        if message.is_remote_frame or self.grid.full:
            return
        bus = self._only or self._of_interface.get(str(message.channel))
        if bus is None:
            return
        readers = self._readers.get((bus, message.arbitration_id, message.is_extended_id))
        if readers is None:
            for mask in self._masks if message.is_extended_id else ():
                readers = self._readers.get((bus, message.arbitration_id & mask, True))
                if readers is not None:
                    break
            else:
                self._note_other(message)
                return
        self._push_to(readers, bus, round(message.timestamp * 1e6), message.data)

    def _note_other(self, message: can.Message) -> None:
        key = (message.arbitration_id, message.is_extended_id)
        if key in self.others or len(self.others) < MOST_OTHERS:
            self.others[key] = self.others.get(key, 0) + 1

    def others_text(self) -> str:
        """Identifiers that came and that no channel asks for, the most frequent first; "" when there are none."""
        ranked = sorted(self.others.items(), key=lambda item: (-item[1], item[0]))
        named = [
            f"{can_id:#x}{' extended' if extended else ''} ({count} frame{'' if count == 1 else 's'})"
            for (can_id, extended), count in ranked[:MOST_NAMED]
        ]
        return ", ".join(named) + (" and more" if len(ranked) > MOST_NAMED else "")

    def _push_to(self, readers: list[_Reader], bus: str, time_us: int, data: bytes | bytearray) -> None:
        counts, received = self.counts[bus], False
        for reader in readers:
            if reader.selectors and not reader.holds(data):
                continue
            counts.received += not received
            received = True
            frame = reader.read(time_us, data)
            if frame is None:
                counts.decode_errors += 1
            elif reader.lane is not None:
                self.grid.push(reader.lane, frame)

    def take(self) -> list[Real]:
        """Blocks that are complete, in order."""
        return [block * self._scale + self._offset for block in self.grid.take()]

    def finish(self) -> list[Real]:
        """The stream ends: the last blocks."""
        self.grid.finish()
        self.silent = [
            c.name for reader, group in self._columns if not (reader.lane and reader.lane.heard) for c in group
        ]
        return self.take()


def can_blocks(
    bus: can.BusABC | Iterable[can.Message],
    config: CaptureConfig | str | Path,
    *,
    samples: CanSamples | None = None,
    block: int = 256,
    latency_s: float = 0.1,
    duration: float | None = None,
    stop: Callable[[], bool] | None = None,
    tap: Callable[[can.Message], None] | None = None,
    idle: Callable[[], None] | None = None,
) -> Iterator[Real]:
    """Blocks (n, inputs + outputs) in SI units as they come, for Session.feed(); NaN where a sample is missing.

    `bus`: an open python-can bus, or messages that end by themselves, such as messages_for() a log. A block comes after
    `block` samples or `latency_s`, whichever is sooner. A bus is read in a thread of its own for `duration` s of
    samples (by the clock: a second more), or until `stop()` says so; what it still holds then is taken.
    `tap` sees every frame, `idle` is called while there is none. `samples` keeps the counts: make one to look at them.
    Raises InputError (config), can.CanError or OSError (the bus failed: what came before has been given out).
    """
    if isinstance(config, str | Path):
        config = load_config(config)
    samples = samples or CanSamples(config)
    samples.grid.end_after(duration)
    live = hasattr(bus, "recv")
    feed = _live_messages(bus, duration, stop) if live else _given(bus, stop)  # type: ignore[arg-type]
    given_at = time.monotonic()
    fault: Exception | None = None
    try:
        for message in feed:
            if message is not None:
                if tap is not None:
                    tap(message)
                samples.push(message)
            elif idle is not None:
                idle()
            if samples.grid.full:
                break
            if samples.grid.waiting >= block or (message is None and time.monotonic() - given_at >= latency_s):
                given_at = time.monotonic()
                yield from samples.take()
    except (can.CanError, OSError) as failed:
        fault = failed
    yield from samples.finish()
    if fault is not None:
        raise fault


def _given(messages: Iterable[can.Message], stop: Callable[[], bool] | None) -> Iterator[can.Message | None]:
    for message in messages:
        if stop is not None and stop():
            return
        yield message


def _live_messages(
    bus: can.BusABC, duration: float | None, stop: Callable[[], bool] | None
) -> Iterator[can.Message | None]:
    reader = ReaderThread(lambda timeout: bus.recv(timeout=timeout))
    try:
        yield from reader.items(stop, duration)
    finally:
        reader.close()
