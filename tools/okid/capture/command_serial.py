# SPDX-License-Identifier: MIT
"""okid-capture serial: keep the bytes of a serial line and identify what they carry."""

from __future__ import annotations

import argparse
import contextlib
import threading
from typing import Any

from okid._errors import InputError
from okid.capture.outcome import (
    EXIT_DEVICE,
    EXIT_DONE,
    EXIT_USAGE,
    Tap,
    check_duration,
    check_target,
    complain,
    end,
    make_capture,
    read_config,
)
from okid.capture.output_files import check_outputs, raw_target
from okid.capture.sources import RawFile, feed_bytes


def open_port(url: str, baud: int = 115200) -> Any:
    """A pyserial port, for this program alone where the system knows that. Raises OSError that names it."""
    import serial

    exclusive = {} if "://" in url else {"exclusive": True}
    try:
        return serial.serial_for_url(url, baudrate=baud, timeout=0.1, **exclusive)
    except (OSError, ValueError, OverflowError) as refused:
        raise OSError(f"cannot open {url}: {refused}") from None


def _check(args: argparse.Namespace) -> None:
    if args.port is not None and args.recorded is not None:
        raise InputError("--from is read instead of a port: leave --port out")
    if args.recorded is not None and args.out is not None:
        raise InputError("--from is recorded already: leave --out out")
    check_duration(args.duration)
    if args.baud is not None and args.baud < 50:
        raise InputError(f"--baud is {args.baud}, expected a whole number >= 50")
    check_target(args.json)
    check_target(args.events)
    inputs = {"--from": args.recorded, "--config": args.config}
    check_outputs(inputs, {"--out": args.out, "--json": args.json, "--events": args.events})


def run_serial(args: argparse.Namespace, stop: threading.Event) -> int:
    """Exit code of `okid-capture serial`. Raises InputError."""
    _check(args)
    config = read_config(args.config)
    bus = config.bus("serial", args.bus)
    name = args.recorded or args.port or bus.device or ""
    live = args.recorded is None
    fault = None
    with contextlib.ExitStack() as kept:
        capture = kept.enter_context(make_capture(config, args, live))
        capture.use_bus(bus)
        try:
            port: Any = kept.enter_context(open_port(name, args.baud or bus.baud) if live else open(name, "rb"))  # noqa: SIM115
        except OSError as refused:
            if not live:
                raise InputError(f"{name}: {refused.strerror or refused}") from None
            complain(refused)
            return EXIT_DEVICE
        try:
            said = None if args.out is None else raw_target(args.out)
            file = None if args.out is None else kept.enter_context(RawFile(args.out))
        except OSError as full:
            raise InputError(f"{args.out}: {full.strerror or full}") from None
        if said is not None:
            complain(said)
        tap = Tap(args.out)

        def keep(data: bytes) -> None:
            if file is not None:
                tap.keep(file.add, data)

        duration = args.duration if live else None
        try:
            for _ in feed_bytes(port, capture, duration=duration, stop=stop.is_set, tap=keep):
                pass
        except OSError as failed:
            fault = f"{name}: {str(failed) or type(failed).__name__}"

        def lines() -> list[str]:
            added = [] if file is None else [f"{file.path}: {file.bytes} bytes added"]
            return [capture.counts[bus.name].text(bus.name), *added]

        code = end(capture, args, lines, fault)
    return EXIT_USAGE if code == EXIT_DONE and tap.fault is not None else code
