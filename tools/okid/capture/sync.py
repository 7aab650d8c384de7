# SPDX-License-Identifier: MIT
"""SYNC and trigger frames at absolute times, so that nodes sample together."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from okid._errors import InputError
from okid.capture.pacing import Pacer

if TYPE_CHECKING:
    import can

LARGEST_COUNTER = 240  # of a CANopen SYNC, CiA 301


@dataclass
class SyncReport:
    """`missed`: deadlines that had passed by more than a period when their turn came; nothing was sent for them."""

    sent: int = 0
    missed: int = 0
    fault: str | None = None
    pacer: Pacer = field(default_factory=Pacer)

    def text(self) -> str:
        """One line for a person."""
        return f"{self.sent} sent, {self.missed} missed; {self.pacer.text()}"


def send_sync(
    bus: can.BusABC,
    rate_hz: float,
    *,
    can_id: int = 0x80,
    count: int | None = None,
    duration: float | None = None,
    data: bytes = b"",
    counter: int | None = None,
    stop: Callable[[], bool] | None = None,
    pacer: Pacer | None = None,
) -> SyncReport:
    """Send a frame at every multiple of 1 / rate_hz s from now on: `count` of them, for `duration` s, or until stop().

    `counter`: its largest value, 2 to 240; then a frame carries one byte 1, 2 .. counter, 1 .. as a CANopen SYNC.
    A deadline that is missed by a period is left out and counted: a burst would trigger nodes at wrong times. The
    counter goes on with the deadlines, so a node sees it. Ends early when the bus fails: SyncReport.fault says why.
    Raises InputError for arguments out of range.
    """
    if not 0.0 < rate_hz <= 1e4:
        raise InputError(f"rate is {rate_hz} Hz, expected a number above 0 up to 10000")
    if not 0 <= can_id <= 0x1FFFFFFF:
        raise InputError(f"identifier is {can_id:#x}, expected at most 0x1fffffff")
    if len(data) > 8 or (counter is not None and (data or not 2 <= counter <= LARGEST_COUNTER)):
        raise InputError(
            f"data has {len(data)} bytes, counter is {counter}; expected at most 8 bytes, or a counter of 2 to 240"
        )
    import can  # a second

    report = SyncReport(pacer=pacer or Pacer())
    most = count if duration is None else min(round(duration * rate_hz), count or 1 << 62)
    tick = 0
    while most is None or tick < most:
        behind = int(report.pacer.now() * rate_hz)
        if behind > tick:
            skipped = min(behind, most or behind) - tick
            report.missed += skipped
            tick += skipped
            continue
        if not report.pacer.wait(tick / rate_hz, stop):
            break
        body = data if counter is None else bytes([tick % counter + 1])
        try:
            bus.send(can.Message(arbitration_id=can_id, is_extended_id=can_id > 0x7FF, data=body))
        except (can.CanError, OSError) as fault:
            report.fault = str(fault) or type(fault).__name__
            break
        report.sent += 1
        tick += 1
    return report
