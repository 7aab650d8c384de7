# SPDX-License-Identifier: MIT
"""Frames as `candump -L` writes them."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import can


def identifier_text(message: can.Message) -> str:
    """The id as candump writes it: 3 hex digits, 8 for 29-bit ids and for error frames (which carry 0x20000000)."""
    if message.is_error_frame:
        return f"{message.arbitration_id | 0x20000000:08X}"
    return f"{message.arbitration_id:08X}" if message.is_extended_id else f"{message.arbitration_id:03X}"


def log_line(message: can.Message, channel: str) -> str:
    """One line of a `candump -L` log, with its line end."""
    data = bytes(message.data).hex().upper()
    if message.is_fd:
        flags = (1 if message.bitrate_switch else 0) | (2 if message.error_state_indicator else 0)
        body = f"##{flags:X}{data}"
    elif message.is_remote_frame:
        body = f"#R{message.dlc:X}" if message.dlc else "#R"
    else:
        body = f"#{data}"
    return f"({message.timestamp:.6f}) {channel} {identifier_text(message)}{body}\n"
