# SPDX-License-Identifier: MIT
"""Acquisition scripts on python-can and pyserial: `okid-capture`, and its parts for scripts of your own.

    with okid.capture.Capture("frame.toml", duration=20, table=True) as capture:
        for _ in okid.capture.feed_messages(okid.capture.open_bus("socketcan", "can0"), capture):
            pass
        result = capture.finish()

docs/howto/acquisition-scripts.md has more.
"""

from collections.abc import Sequence
from importlib import import_module
from typing import TYPE_CHECKING, Any

from okid.data.interrupt import early_end

if TYPE_CHECKING:
    from okid.abi.program import find_program, run_program
    from okid.capture.command_can import open_bus
    from okid.capture.command_serial import open_port
    from okid.capture.config import BusConfig, CaptureConfig, ChannelConfig, load_config
    from okid.capture.emulate import Playback, packets_of, play, play_serial
    from okid.capture.frame_log import log_messages, messages_for
    from okid.capture.pacing import Pacer
    from okid.capture.recording import LineFile, Recorder, Summary, record_bus
    from okid.capture.sources import RawFile, can_blocks, feed_bytes, feed_messages, serial_blocks
    from okid.capture.stream import BusCounts, Capture, frames_of
    from okid.capture.sync import SyncReport, send_sync
    from okid.capture.virtual_rig import VirtualRig, line_config, simulate_rig
    from okid.formats.candump_text import identifier_text, log_line

__all__ = [
    "BusConfig",
    "BusCounts",
    "Capture",
    "CaptureConfig",
    "ChannelConfig",
    "LineFile",
    "Pacer",
    "Playback",
    "RawFile",
    "Recorder",
    "Summary",
    "SyncReport",
    "VirtualRig",
    "can_blocks",
    "feed_bytes",
    "feed_messages",
    "find_program",
    "frames_of",
    "identifier_text",
    "line_config",
    "load_config",
    "log_line",
    "log_messages",
    "main",
    "messages_for",
    "open_bus",
    "open_port",
    "packets_of",
    "play",
    "play_serial",
    "record_bus",
    "run_program",
    "send_sync",
    "serial_blocks",
    "simulate_rig",
]

_NAMES = {
    "capture.command_can": "open_bus",
    "capture.command_serial": "open_port",
    "capture.config": "BusConfig, CaptureConfig, ChannelConfig, load_config",
    "capture.emulate": "Playback, packets_of, play, play_serial",
    "capture.frame_log": "log_messages, messages_for",
    "capture.pacing": "Pacer",
    "abi.program": "find_program, run_program",
    "capture.recording": "LineFile, Recorder, Summary, record_bus",
    "capture.sources": "RawFile, can_blocks, feed_bytes, feed_messages, serial_blocks",
    "capture.stream": "BusCounts, Capture, frames_of",
    "capture.sync": "SyncReport, send_sync",
    "capture.virtual_rig": "VirtualRig, line_config, simulate_rig",
    "formats.candump_text": "identifier_text, log_line",
}  # of the modules; they load when they are first used: they bring python-can with them


def __getattr__(name: str) -> Any:
    for module, names in _NAMES.items():
        if name in names.split(", "):
            return getattr(import_module(f"okid.{module}"), name)
        if module == f"capture.{name}":
            return import_module(f"okid.{module}")
    raise AttributeError(f"module 'okid.capture' has no attribute {name!r}")


def main(arguments: Sequence[str] | None = None) -> int:
    """Entry point of okid-capture; exit codes: 0, 2 usage or input, 3 no model, 4 device, 130 before it began."""
    with early_end("okid-capture"):
        from okid.capture.command import main as command
    return command(arguments)
