# SPDX-License-Identifier: MIT
"""okid-capture sync and emulate: the other end of the bus."""

from __future__ import annotations

import argparse
import tempfile
import threading
from collections.abc import Iterable
from pathlib import Path

import can

from okid._errors import InputError, say
from okid.capture.command_can import open_bus
from okid.capture.command_serial import open_port
from okid.capture.config import CaptureConfig, load_config
from okid.capture.emulate import Playback, packets_of, play, play_serial
from okid.capture.frame_log import log_messages, messages_for
from okid.capture.outcome import EXIT_DEVICE, EXIT_DONE, check_target, complain
from okid.capture.output_files import check_outputs
from okid.capture.sync import send_sync
from okid.capture.virtual_rig import hand_over, line_config, simulate_rig, write_whole


def _identifier(text: str) -> int:
    try:
        return int(text, 0)
    except ValueError:
        raise InputError(f"--id {text}: expected a number such as 0x80 or 128, at most 0x1fffffff") from None


def _bytes(text: str) -> bytes:
    try:
        return bytes.fromhex(text)
    except ValueError:
        raise InputError(f"--data {text}: expected up to 8 bytes, two hex digits each, such as 01A0") from None


def run_sync(args: argparse.Namespace, stop: threading.Event) -> int:
    """Exit code of `okid-capture sync`. Raises InputError."""
    can_id, data = _identifier(args.id), _bytes(args.data)
    for name in ("count", "duration"):
        value = getattr(args, name)
        if value is not None and not 0 < value < float("inf"):
            raise InputError(f"--{name} is {value}, expected a number > 0")
    if not 0.0 < args.rate <= 1e4:
        raise InputError(f"--rate is {args.rate}, expected a number above 0 up to 10000")
    try:
        bus = open_bus(args.interface, args.channel, bitrate=args.bitrate)
    except OSError as refused:
        complain(refused)
        return EXIT_DEVICE
    try:
        report = send_sync(
            bus, args.rate, can_id=can_id, count=args.count, duration=args.duration, data=data, counter=args.counter,
            stop=stop.is_set,
        )  # fmt: skip
    finally:
        bus.shutdown()
    say(report.text())
    return _ended(args.channel, report.fault)


def _ended(where: str, fault: str | None) -> int:
    if fault is None:
        return EXIT_DONE
    complain(f"{where}: {fault}")
    return EXIT_DEVICE


def _speed(text: str) -> float | None:
    if text == "max":
        return None
    try:
        speed = float(text)
    except ValueError:
        speed = 0.0
    if not 0.0 < speed < float("inf"):
        raise InputError(f"--speed is {text!r}, expected a number above 0, or max")
    return speed


def run_emulate(args: argparse.Namespace, stop: threading.Event) -> int:
    """Exit code of `okid-capture emulate`. Raises InputError."""
    speed = _speed(args.speed)
    if (args.serial is None) == (args.interface is None or args.channel is None):
        raise InputError("give either --interface and --channel, or --serial URL")
    for target in (args.write_config, args.truth):
        check_target(target)
    written = {"--write-config": args.write_config, "--truth": args.truth}
    if args.write_config is not None and args.serial is None:
        written["the DBC of --write-config"] = str(Path(args.write_config).with_suffix(".dbc"))
    rig = Path(args.source).suffix == ".toml"
    check_outputs({"the RIG.toml" if rig else "the LOG": args.source, "--config": args.config}, written)
    if rig and args.config is not None:
        raise InputError("--config is for a LOG: that of a rig is made, and --write-config writes it")
    if not rig and (args.truth is not None or (args.write_config is not None and args.serial is None)):
        raise InputError("--truth and --write-config are for a RIG.toml: a log has neither")
    if not rig and args.serial is not None and args.config is None:
        raise InputError("--serial needs --config CONFIG.toml: it says which bits of the frames are samples")
    with tempfile.TemporaryDirectory(prefix="okid-emulate-") as folder:
        made = simulate_rig(args.source, folder) if rig else None
        log = args.source if made is None else made.log
        path = args.config if made is None else made.config
        config = None if path is None else load_config(path)
        if made is not None:
            hand_over(made, None if args.serial else args.write_config, args.truth)
        if args.serial is not None and config is not None:
            if args.write_config is not None:
                write_whole(args.write_config, line_config(config, args.serial, args.baud).encode())
            return _on_line(args, log, config, speed, stop)
        return _on_bus(args, log_messages(log), speed, stop)


def _on_line(
    args: argparse.Namespace, log: str | Path, config: CaptureConfig, speed: float | None, stop: threading.Event
) -> int:
    packets = packets_of(messages_for(log, config), config)
    try:
        port = open_port(args.serial, args.baud)
    except OSError as refused:
        complain(refused)
        return EXIT_DEVICE
    with port:
        return _tell(args.serial, play_serial(packets, port, speed=speed, stop=stop.is_set), "packets")


def _on_bus(
    args: argparse.Namespace, messages: Iterable[can.Message], speed: float | None, stop: threading.Event
) -> int:
    try:
        bus = open_bus(args.interface, args.channel, bitrate=args.bitrate)
    except OSError as refused:
        complain(refused)
        return EXIT_DEVICE
    try:
        return _tell(args.channel, play(messages, bus, speed=speed, stop=stop.is_set), "frames")
    finally:
        bus.shutdown()


def _tell(where: str, done: Playback, what: str) -> int:
    say(done.text(what))
    return _ended(where, done.fault)
