# SPDX-License-Identifier: MIT
"""okid-capture can: record a CAN bus, identify it, or both."""

from __future__ import annotations

import argparse
import contextlib
import errno
import socket
import threading
from collections.abc import Iterable
from importlib import import_module
from itertools import chain
from typing import TYPE_CHECKING, Any

from okid._errors import InputError, say
from okid.capture.config import BusConfig, CaptureConfig
from okid.capture.dbc import read_dbc
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
from okid.capture.output_files import check_log_target, check_outputs
from okid.capture.recording import Recorder, record_bus
from okid.capture.sources import feed_messages
from okid.capture.stream import Capture

if TYPE_CHECKING:
    import can

_SO_RCVBUFFORCE = 33
_ROOM = 8 << 20  # bytes of a socket: some 13,000 frames
_PIECE = 20_000  # frames of a log between two looks at Ctrl-C


def _by_library(args: argparse.Namespace) -> bool:
    """A log that the library reads by itself."""
    return bool(args.config and args.log and not args.out and args.log.lower().endswith((".log", ".okj")))


def load(args: argparse.Namespace) -> None:
    """What a run needs and takes long to load, while Ctrl-C still just ends the program."""
    if not _by_library(args):
        import_module("can")


def open_bus(interface: str, channel: str, *, fd: bool = False, bitrate: int | None = None) -> can.BusABC:
    """A python-can bus; a socket gets room for seconds of frames. Raises OSError that names the bus.

    InputError for an interface that python-can does not have.
    """
    import can

    if interface not in can.VALID_INTERFACES:
        raise InputError(
            f"no python-can interface {interface!r}; there are {', '.join(sorted(can.VALID_INTERFACES))}, and file"
        )
    options: dict[str, Any] = {"fd": True} if fd else {}
    if bitrate is not None:
        options["bitrate"] = bitrate
    try:
        bus = can.Bus(interface=interface, channel=channel, **options)
    except (can.CanError, OSError, ImportError, ValueError, TypeError) as refused:
        raise OSError(f"cannot open {interface} {channel}: {refused}{_without_socketcan(interface, refused)}") from None
    line = getattr(bus, "socket", None)
    if isinstance(line, socket.socket):
        try:
            line.setsockopt(socket.SOL_SOCKET, _SO_RCVBUFFORCE, _ROOM)
        except OSError:  # without rights: as much as the system lets
            with contextlib.suppress(OSError):
                line.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, _ROOM)
    return bus


def _without_socketcan(interface: str, refused: Exception) -> str:
    """What to do where the kernel has no CAN sockets; else nothing."""
    none = (errno.EAFNOSUPPORT, errno.EPROTONOSUPPORT)
    if interface != "socketcan" or getattr(refused, "errno", None) not in none:
        return ""
    return "; this kernel has no SocketCAN (see `okid doctor`): the interfaces udp_multicast and virtual need none"


def _check(args: argparse.Namespace) -> None:
    if args.interface == "file":
        args.log, args.interface = args.log or args.channel, None
    if args.log is not None and args.interface is not None:
        raise InputError("--log is read instead of a bus: leave --interface out")
    if args.interface is not None and args.channel is None:
        raise InputError(f"--interface {args.interface} needs --channel beside it")
    if args.log is None and args.config is None and args.interface is None:
        raise InputError("--interface and --channel are needed, or --log FILE")
    if args.interface is not None:
        from can import VALID_INTERFACES

        if args.interface not in VALID_INTERFACES:
            known = ", ".join(sorted(VALID_INTERFACES))
            raise InputError(f"no python-can interface {args.interface!r}; there are {known}, and file")
    if args.out is None and args.config is None:
        raise InputError("nothing to do: give --out FILE.log, --config CONFIG.toml, or both")
    check_duration(args.duration)
    if args.frames is not None and args.frames < 1:
        raise InputError(f"--frames is {args.frames}, expected a whole number >= 1")
    if (args.dbc is None) != (args.csv is None):
        raise InputError("--dbc and --csv belong together")
    if args.csv is not None and args.out is None:
        raise InputError("--csv is written beside --out FILE.log")
    for option in ("json", "events"):
        if getattr(args, option) is not None and args.config is None:
            raise InputError(f"--{option} needs --config CONFIG.toml")
        check_target(getattr(args, option))
    check_outputs({"--log": args.log, "--config": args.config, "--dbc": args.dbc}, _outputs(args))


def _outputs(args: argparse.Namespace) -> dict[str, str | None]:
    return {"--out": args.out, "--csv": args.csv, "--json": args.json, "--events": args.events}


def _tell_appended(path: str | None) -> None:
    said = None if path is None else check_log_target(path)
    if said is not None:
        complain(said)


def run_can(args: argparse.Namespace, stop: threading.Event) -> int:
    """Exit code of `okid-capture can`. Raises InputError."""
    _check(args)
    database = None if args.dbc is None else read_dbc(args.dbc)
    config = None if args.config is None else read_config(args.config)
    for dbc in () if config is None else config.dbcs:
        check_outputs({"the DBC of --config": dbc}, _outputs(args))
    source = None if config is None or args.log is not None else config.bus("can", args.bus)
    _tell_appended(args.out)
    if args.log is not None:
        remarks: list[str] = []
        code = _from_log(args, config, remarks, database, stop)
        for remark in remarks:
            complain(f"{args.log}: {remark}")
        return code
    _place_of(args, source)
    try:
        bus = open_bus(args.interface, args.channel, fd=args.fd or bool(source and source.fd), bitrate=args.bitrate)
    except OSError as refused:
        complain(refused)
        return EXIT_DEVICE
    try:
        if config is None:
            return _record(args, bus, database, stop)
        return _identify(args, config, bus, source, database, stop)
    finally:
        bus.shutdown()


def _from_log(
    args: argparse.Namespace, config: CaptureConfig | None, remarks: list[str], database: Any, stop: threading.Event
) -> int:
    if config is not None and _by_library(args):
        return _replay(args, config, stop)
    from okid.capture.frame_log import log_messages, messages_for

    if config is None:
        rest = iter(log_messages(args.log, remarks))
        first = next(rest)  # no copy is made when it cannot be read
        return _record(args, chain([first], rest), database, stop)
    return _identify(args, config, messages_for(args.log, config, remarks), None, database, stop)


def _replay(args: argparse.Namespace, config: CaptureConfig, stop: threading.Event) -> int:
    with make_capture(config, args, live=False) as capture:
        capture.open(args.log)
        left = 1 << 62 if args.frames is None else args.frames
        while left > 0 and not stop.is_set():
            asked = min(left, _PIECE)
            left -= asked
            if capture.play(asked) < asked:
                break
        return end(capture, args, lambda: _count_lines(capture), None)


def _count_lines(capture: Capture) -> list[str]:
    return [counts.text(name) for name, counts in capture.counts.items()]


def _place_of(args: argparse.Namespace, source: BusConfig | None) -> None:
    """Interface and channel out of the config where the command line has none."""
    if args.interface is not None or source is None:
        return
    slcan = source.type == "slcan"
    if source.adapter is not None and args.channel is None:
        raise InputError(
            f"bus {source.name!r} of the config is the USB adapter {source.adapter}: name its interface of today with "
            "--channel (`okid doctor` lists them)"
        )
    args.interface = "slcan" if slcan else "socketcan"
    args.channel = args.channel or (source.device if slcan else source.interface)
    args.bitrate = args.bitrate or (source.bitrate if slcan else None)
    if source.type == "replay":
        raise InputError(f"bus {source.name!r} of the config is a log: name it with --log FILE")


def _channel_name(args: argparse.Namespace, source: BusConfig | None = None) -> str:
    """What a log calls the bus: as the config does, so that `okid replay` finds it."""
    if source is not None:
        return source.interface
    return str(args.channel or "can0").rsplit("/", 1)[-1]


def _record(
    args: argparse.Namespace, source: can.BusABC | Iterable[can.Message], database: Any, stop: threading.Event
) -> int:
    try:
        summary = record_bus(
            source, args.out, channel=_channel_name(args), duration=None if args.log else args.duration,
            frames=args.frames, database=database, csv_path=args.csv, stop=stop.is_set,
        )  # fmt: skip
    except OSError as full:
        complain(f"{full.filename or args.out}: {full.strerror or full}")
        return EXIT_USAGE
    say(summary.text())
    if summary.fault is not None:
        complain(f"{args.channel}: {summary.fault}; what came before is in {args.out}")
        return EXIT_DEVICE
    return EXIT_DONE


def _identify(
    args: argparse.Namespace,
    config: CaptureConfig,
    source: Any,
    bus: BusConfig | None,
    database: Any,
    stop: threading.Event,
) -> int:
    from can import CanError

    fault, live = None, args.log is None
    with contextlib.ExitStack() as kept:
        capture = kept.enter_context(make_capture(config, args, live))
        if bus is not None:
            capture.use_bus(bus)
        recorder = None
        if args.out is not None:
            try:
                recorder = Recorder(args.out, channel=_channel_name(args, bus), database=database, csv_path=args.csv)
            except OSError as full:
                raise InputError(f"{full.filename or args.out}: {full.strerror or full}") from None
        tap, seen = Tap(args.out), 0

        def keep(message: can.Message) -> None:
            nonlocal seen
            seen += 1
            if recorder is not None:
                tap.keep(recorder.add, message)

        def idle() -> None:
            if recorder is not None:
                tap.keep(recorder.tick)
            capture.serve()

        try:
            for _ in feed_messages(
                source, capture, duration=args.duration if live else None,
                stop=lambda: stop.is_set() or seen == args.frames, tap=keep, idle=idle,
            ):  # fmt: skip
                pass
        except (CanError, OSError) as failed:
            fault = f"{args.channel}: {str(failed) or type(failed).__name__}"
        finally:
            if recorder is not None:
                tap.keep(recorder.close, last=True)

        def lines() -> list[str]:
            return [*([] if recorder is None else [recorder.summary.text()]), *_count_lines(capture)]

        code = end(capture, args, lines, fault)
    return EXIT_USAGE if code == EXIT_DONE and tap.fault is not None else code
