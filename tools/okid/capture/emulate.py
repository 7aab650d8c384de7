# SPDX-License-Identifier: MIT
"""A node that is not there: frames of a log onto a bus, or its samples as packets onto a line, at their times."""

from __future__ import annotations

import ctypes
import time
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field
from typing import Any

import can
import numpy as np
from numpy.typing import NDArray

from okid._errors import InputError
from okid.abi import host
from okid.capture.config import CaptureConfig
from okid.capture.pacing import Pacer
from okid.capture.sources import feed_messages
from okid.capture.stream import Capture

_FULL_S = 5.0  # a full queue is waited for this long
_PACKET_S = 5e-3
_LONGEST = 1024 + 1024 // 254 + 2  # bytes of a packet on the wire


@dataclass
class Playback:
    """`retries`: how often a full queue of the adapter was waited for; `fault` tells why it ended early."""

    sent: int = 0
    bytes: int = 0
    seconds: float = 0.0
    retries: int = 0
    fault: str | None = None
    pacer: Pacer = field(default_factory=Pacer)

    def text(self, what: str = "frames") -> str:
        """One line for a person."""
        rate = f", {self.sent / self.seconds:.0f} a second" if self.seconds > 0 else ""
        paced = f"; {self.pacer.text()}" if self.pacer.count else ""
        waits = f"; a full queue was waited for {self.retries} times" if self.retries else ""
        return f"{self.sent} {what} in {self.seconds:.3f} s{rate}{paced}{waits}"


def play(
    messages: Iterable[can.Message],
    bus: can.BusABC,
    *,
    speed: float | None = 1.0,
    stop: Callable[[], bool] | None = None,
    pacer: Pacer | None = None,
) -> Playback:
    """Send frames at the distances of their time stamps, `speed` times as fast, None = as fast as the bus takes them.

    Deadlines are absolute, and every frame is sent, late or not. Ends early when the bus fails (Playback.fault) or
    `stop()` says so. Raises InputError for a speed that is not above 0, or what the iterator of messages raises.
    """
    if speed is not None and not speed > 0:
        raise InputError(f"speed is {speed}, expected a number above 0, or None for as fast as possible")
    out = Playback(pacer=pacer or Pacer())
    out.pacer.begin()
    first: float | None = None
    for message in messages:
        if message.is_error_frame:
            continue
        first = message.timestamp if first is None else first
        if speed is None:
            if stop is not None and stop():
                break
        elif not out.pacer.wait((message.timestamp - first) / speed, stop):
            break
        try:
            out.retries += _send(bus, message, stop)
        except (can.CanError, OSError) as fault:
            out.fault = str(fault) or type(fault).__name__
            break
        out.sent += 1
        out.bytes += len(message.data)
    out.seconds = out.pacer.now()
    return out


def _send(bus: can.BusABC, message: can.Message, stop: Callable[[], bool] | None) -> int:
    """A full queue is waited for. Returns how often."""
    retries = 0
    until = time.monotonic() + _FULL_S
    while True:
        try:
            bus.send(message)
            return retries
        except (can.CanOperationError, OSError) as fault:
            full = getattr(fault, "error_code", None) or getattr(fault, "errno", None)
            if full not in (11, 105) or time.monotonic() > until or (stop is not None and stop()):  # EAGAIN, ENOBUFS
                raise
            retries += 1
            time.sleep(0.001)


def packets_of(messages: Iterable[can.Message], config: CaptureConfig) -> Iterator[tuple[float, bytes]]:
    """The samples of a log as packets of the project's own stream: (s from the first sample to the last of the packet,
    its bytes). Channel k of the config (forces, responses) is field k; a packet holds about 5 ms. Samples that the log
    lacks are left out, which their numbers tell. Raises InputError when the channels do not fit a packet.
    """
    number_format = _number_format(config)
    most = max(1, round(_PACKET_S * config.rate_hz))
    while most > 1 and not _packet(number_format, np.zeros((most, len(config.wanted))), 0, config):
        most -= 1
    number = 0
    for block in _raw_blocks(messages, config):
        whole = ~np.isnan(block).any(axis=1)
        at = 0
        while at < len(block):
            count = 0
            while at + count < len(block) and count < most and whole[at + count]:
                count += 1
            if count > 0:
                last = number + at + count - 1
                yield last / config.rate_hz, _packet(number_format, block[at : at + count], number + at, config)
            at += max(count, 1)
        number += len(block)


def _packet(number_format: int, rows: NDArray[Any], first: int, config: CaptureConfig) -> bytes:
    """b"" when the rows do not fit."""
    samples, channels = rows.shape
    out, values = (ctypes.c_uint8 * _LONGEST)(), np.ascontiguousarray(rows, np.float64)
    time_us = round(first / config.rate_hz * 1e6)
    used = host.library().okid_host_packet_encode(
        number_format, channels, samples, first & 0xFFFFFFFF, time_us & 0xFFFFFFFF, values.ctypes.data, out, _LONGEST
    )
    if used == 0 and samples == 1:
        raise InputError(f"{config.path}: {channels} channels do not fit a packet: play it on a CAN bus")
    return bytes(out[:used])


def _raw_blocks(messages: Iterable[can.Message], config: CaptureConfig) -> Iterator[Any]:
    """Rows of numbers as they stand in the frames."""
    with Capture(config, identify=False, keep_events=False) as capture:
        for _ in feed_messages(messages, capture):
            yield from capture.take(raw=True)
        capture.finish()
        yield from capture.take(raw=True)


def _number_format(config: CaptureConfig) -> int:
    """The shortest that holds the numbers of every channel: 0 int16, 1 int24, 2 float32."""
    if any(channel.number != "integer" for channel in config.wanted):
        return 2
    most = max(channel.length + (not channel.signed) for channel in config.wanted)
    return 0 if most <= 16 else 1 if most <= 24 else 2


def play_serial(
    packets: Iterable[tuple[float, bytes]],
    port: Any,
    *,
    speed: float | None = 1.0,
    stop: Callable[[], bool] | None = None,
    pacer: Pacer | None = None,
) -> Playback:
    """The same for packets_of() on an open pyserial port: each is written when its last sample is there."""
    if speed is not None and not speed > 0:
        raise InputError(f"speed is {speed}, expected a number above 0, or None for as fast as possible")
    out = Playback(pacer=pacer or Pacer())
    out.pacer.begin()
    for due_s, data in packets:
        if speed is None:
            if stop is not None and stop():
                break
        elif not out.pacer.wait(due_s / speed, stop):
            break
        try:
            port.write(data)
        except OSError as fault:
            out.fault = str(fault) or type(fault).__name__
            break
        out.sent += 1
        out.bytes += len(data)
    out.seconds = out.pacer.now()
    return out
