# SPDX-License-Identifier: MIT
"""One frame of every kind, and plain ones, as python-can's messages."""

from __future__ import annotations

from can import Message

START = 1_700_000_000.0


def plain_frames(count: int = 60) -> list[Message]:
    """Classic data frames of two buses, 11 and 29 bits, 0 to 8 bytes."""
    return [
        Message(
            timestamp=START + round(k * 0.00413, 6), arbitration_id=(0x100 + k) % 0x800 if k % 3 else 0x18F02D00 + k,
            is_extended_id=k % 3 == 0, data=bytes((k + i) % 256 for i in range(k % 9)), channel=f"can{k % 2}",
        )
        for k in range(count)
    ]  # fmt: skip


def special_frames() -> list[Message]:
    """Remote, CAN FD (with each flag, without data, 64 bytes) and error frames."""
    options = [
        {"arbitration_id": 0x100, "is_extended_id": False, "is_remote_frame": True, "dlc": 8},
        {"arbitration_id": 0x12, "is_extended_id": True, "is_remote_frame": True, "dlc": 0},
        {"arbitration_id": 0x123, "is_extended_id": False, "is_fd": True, "bitrate_switch": True, "data": bytes(12)},
        {"arbitration_id": 0x7FF, "is_extended_id": False, "is_fd": True, "data": bytes(range(64))},
        {"arbitration_id": 0x124, "is_fd": True, "error_state_indicator": True, "data": b"\x01"},
        {"arbitration_id": 0x4, "is_extended_id": True, "is_error_frame": True, "data": bytes(8)},
    ]
    return [Message(timestamp=START + 1.0 + k / 8.0, channel="can0", **given) for k, given in enumerate(options)]


def empty_fd() -> Message:
    """A CAN FD frame without data."""
    return Message(timestamp=START + 3.0, arbitration_id=0x125, is_extended_id=False, is_fd=True, channel="can0")


def assert_equal_frames(found: list[Message], given: list[Message], buses: bool = True) -> None:
    """Same identifiers, kinds, data, buses; times to a microsecond after a common shift below a millisecond."""
    assert len(found) == len(given)
    shift = found[0].timestamp - given[0].timestamp
    assert abs(shift) < 1e-3
    for one, other in zip(found, given, strict=True):
        assert abs(one.timestamp - shift - other.timestamp) < 2e-6
        assert one.equals(other, timestamp_delta=None, check_direction=False, check_channel=buses), (one, other)
