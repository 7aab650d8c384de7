# SPDX-License-Identifier: MIT
"""Acquisition scripts on python-can and pyserial: `okid-capture`, and its parts for scripts of your own.

    config = okid.capture.load_config("frame.toml")
    session = okid.Session.from_config("frame.toml")
    for block in okid.capture.can_blocks(okid.capture.open_bus("socketcan", "can0"), config, duration=20):
        session.feed(block)
    print(session.identify().table())

docs/howto/acquisition-scripts.md has more.
"""

from collections.abc import Sequence
from importlib import import_module
from typing import TYPE_CHECKING, Any

from okid.data.interrupt import early_end

if TYPE_CHECKING:
    from okid.capture.can_samples import CanSamples, can_blocks
    from okid.capture.cobs_packets import Packet, decode_packet, encode_packet
    from okid.capture.command_can import open_bus
    from okid.capture.command_serial import open_port
    from okid.capture.config import BusConfig, CaptureConfig, ChannelConfig, load_config
    from okid.capture.emulate import Playback, packets_of, play, play_serial
    from okid.capture.frame_log import log_messages, messages_for
    from okid.capture.lane import BusCounts
    from okid.capture.mode_watch import ModeWatch
    from okid.capture.pacing import Pacer
    from okid.capture.program import check_config
    from okid.capture.recording import LineFile, Recorder, Summary, identifier_text, log_line, record_bus
    from okid.capture.serial_samples import RawFile, SerialSamples, serial_blocks
    from okid.capture.sync import SyncReport, send_sync
    from okid.capture.virtual_rig import VirtualRig, line_config, simulate_rig

__all__ = [
    "BusConfig",
    "BusCounts",
    "CanSamples",
    "CaptureConfig",
    "ChannelConfig",
    "LineFile",
    "ModeWatch",
    "Pacer",
    "Packet",
    "Playback",
    "RawFile",
    "Recorder",
    "SerialSamples",
    "Summary",
    "SyncReport",
    "VirtualRig",
    "can_blocks",
    "check_config",
    "decode_packet",
    "encode_packet",
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
    "send_sync",
    "serial_blocks",
    "simulate_rig",
]

_NAMES = {
    "can_samples": "CanSamples, can_blocks",
    "cobs_packets": "Packet, decode_packet, encode_packet",
    "command_can": "open_bus",
    "command_serial": "open_port",
    "config": "BusConfig, CaptureConfig, ChannelConfig, load_config",
    "emulate": "Playback, packets_of, play, play_serial",
    "lane": "BusCounts",
    "frame_log": "log_messages, messages_for",
    "mode_watch": "ModeWatch",
    "pacing": "Pacer",
    "program": "check_config",
    "recording": "LineFile, Recorder, Summary, identifier_text, log_line, record_bus",
    "serial_samples": "RawFile, SerialSamples, serial_blocks",
    "sync": "SyncReport, send_sync",
    "virtual_rig": "VirtualRig, line_config, simulate_rig",
}  # of the modules; they load when they are first used: they bring python-can with them


def __getattr__(name: str) -> Any:
    for module, names in _NAMES.items():
        if name in names.split(", "):
            return getattr(import_module(f"okid.capture.{module}"), name)
        if name == module:
            return import_module(f"okid.capture.{module}")
    raise AttributeError(f"module 'okid.capture' has no attribute {name!r}")


def main(arguments: Sequence[str] | None = None) -> int:
    """Entry point of okid-capture; exit codes: 0, 2 usage or input, 3 no model, 4 device, 130 before it began."""
    with early_end("okid-capture"):
        from okid.capture.command import main as command
    return command(arguments)
