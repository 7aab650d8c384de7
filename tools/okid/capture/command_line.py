# SPDX-License-Identifier: MIT
"""The command line of okid-capture; no part of it needs python-can, which takes a second to load."""

from __future__ import annotations

import argparse
from typing import Any

from okid.capture.sync import LARGEST_COUNTER


def make_parser() -> argparse.ArgumentParser:
    """The command with its sub-commands; `command` of what is parsed: "module:function" of the one chosen."""
    parser = argparse.ArgumentParser(
        prog="okid-capture",
        description="Acquisition by python-can and pyserial: record, identify, synchronise, emulate.",
        epilog="example: okid-capture can --interface socketcan --channel can0 --out run.log --duration 20. "
        "Exit codes: 0 done, 2 wrong usage or input, 3 no model, 4 device or bus, 130 interrupted before it began.",
    )
    kinds = parser.add_subparsers(dest="kind", required=True, metavar="can|serial|sync|emulate")
    _add_can(kinds)
    _add_serial(kinds)
    _add_sync(kinds)
    _add_emulate(kinds)
    return parser


def _add_can(kinds: Any) -> None:
    bus = kinds.add_parser(
        "can",
        help="record and identify a CAN bus through python-can",
        description="Read a CAN bus with python-can: record it to a `candump -L` log (--out), identify it while it "
        "runs (--config), or both; ends on Ctrl-C, --duration, --frames or the end of a log.",
        epilog="examples: okid-capture can --interface slcan --channel /dev/ttyACM0 --bitrate 500000 --out run.log "
        "--dbc frame.dbc --csv run.csv; okid-capture can --interface socketcan --channel can0 --config frame.toml "
        "--json result.json; okid-capture can --log run.blf --config frame.toml",
    )
    bus.add_argument("--interface", metavar="NAME", help="of python-can: socketcan, slcan, virtual, udp_multicast .., "
                     "or file with a log as channel; default: what the config says")  # fmt: skip
    bus.add_argument("--channel", metavar="NAME", help="can0, vcan0, /dev/ttyACM0, 239.74.163.2 .., run.blf")
    bus.add_argument("--log", metavar="FILE", help="read this log instead of a bus: .log .okj .blf .asc .trc .mf4 ..")
    bus.add_argument("--out", metavar="FILE.log", help="log file; an existing one is appended to")
    bus.add_argument("--config", metavar="CONFIG.toml", help="identify: what the frames mean, and how")
    bus.add_argument("--bus", metavar="NAME", help="the [[bus]] of the config that this is, when it has several")
    _add_outputs(bus)
    bus.add_argument("--quiet", action="store_true", help="no modes and no table on stdout")
    bus.add_argument("--bitrate", type=int, metavar="BIT/S", help="where the adapter sets it")
    bus.add_argument("--fd", action="store_true", help="receive CAN FD frames too")
    bus.add_argument(
        "--duration", type=float, metavar="S", help="end after this many seconds (with --config: of samples)"
    )
    bus.add_argument("--frames", type=int, metavar="N", help="end after this many frames")
    bus.add_argument("--dbc", metavar="FILE", help="decode with this DBC (cantools) ..")
    bus.add_argument("--csv", metavar="FILE", help=".. into this table, one row a frame")
    bus.set_defaults(command="command_can:run_can")


def _add_serial(kinds: Any) -> None:
    line = kinds.add_parser(
        "serial",
        help="record and identify a serial line through pyserial",
        description="Read a serial line with pyserial: keep its bytes as they come (--out), decode and identify them "
        "(any framing of the config); ends on Ctrl-C or --duration, and when the line is unplugged.",
        epilog="examples: okid-capture serial --port /dev/ttyUSB0 --config node.toml --out run.bin --json result.json; "
        "okid-capture serial --port socket://192.168.0.7:5000 --config node.toml; "
        "okid-capture serial --from run.bin --config node.toml",
    )
    line.add_argument("--port", metavar="URL", help="device, socket://HOST:PORT, loop:// ..; default: the config's")
    line.add_argument("--from", dest="recorded", metavar="FILE", help="bytes that were recorded, instead of a port")
    line.add_argument("--config", required=True, metavar="CONFIG.toml", help="framing, channels, identification")
    line.add_argument("--bus", metavar="NAME", help="the [[bus]] of the config that this is, when it has several")
    line.add_argument("--baud", type=int, metavar="N", help="default: the config's")
    line.add_argument("--out", metavar="FILE", help="every byte as it came; an existing file is appended to")
    _add_outputs(line)
    line.add_argument("--quiet", action="store_true", help="no modes and no table on stdout")
    line.add_argument("--duration", type=float, metavar="S", help="end after this many seconds of samples")
    line.set_defaults(command="command_serial:run_serial")


def _add_outputs(command: Any) -> None:
    command.add_argument("--json", metavar="FILE|-", help="the result, okid.result/1")
    command.add_argument("--events", metavar="FILE|-", help="events as JSON lines, as `okid run` writes them")
    command.add_argument(
        "--trigger-at", type=float, metavar="S", help="when the GPIO edge came, in the time of the log"
    )


def _add_sync(kinds: Any) -> None:
    sync = kinds.add_parser(
        "sync",
        help="send SYNC or trigger frames at absolute times",
        description="Send a frame at a fixed rate, with absolute deadlines, and report how late they were.",
        epilog="example: okid-capture sync --interface socketcan --channel can0 --rate 100 --counter",
    )
    sync.add_argument("--interface", required=True, metavar="NAME", help="of python-can")
    sync.add_argument("--channel", required=True, metavar="NAME", help="can0, vcan0, /dev/ttyACM0 ..")
    sync.add_argument("--rate", required=True, type=float, metavar="HZ", help="frames a second")
    sync.add_argument("--id", default="0x80", metavar="ID", help="identifier, default 0x80 (CANopen SYNC)")
    sync.add_argument("--count", type=int, metavar="N", help="this many frames; default: until Ctrl-C")
    sync.add_argument("--duration", type=float, metavar="S", help="for this long")
    sync.add_argument("--data", default="", metavar="HEX", help="up to 8 bytes")
    sync.add_argument("--counter", nargs="?", type=int, const=LARGEST_COUNTER, metavar="LAST",
                      help="one byte that counts 1, 2 .. LAST, 1 ..; default 240")  # fmt: skip
    sync.add_argument("--bitrate", type=int, metavar="BIT/S", help="where the adapter sets it")
    sync.set_defaults(command="command_nodes:run_sync")


def _add_emulate(kinds: Any) -> None:
    node = kinds.add_parser(
        "emulate",
        help="play a virtual rig or a log onto a bus or a serial line",
        description="A virtual node: a RIG.toml (by `okid simulate`) or a log, frame by frame at its times, "
        "so that a script can be written without hardware.",
        epilog="examples: okid-capture emulate rig.toml --interface udp_multicast --channel 239.74.163.2 "
        "--write-config rig-config.toml; okid-capture emulate run.log --interface socketcan --channel vcan0 --speed 2; "
        "okid-capture emulate rig.toml --serial /dev/pts/5 --write-config line.toml",
    )
    node.add_argument("source", metavar="RIG.toml|LOG", help="a rig, or a log of any kind that python-can reads")
    node.add_argument("--interface", metavar="NAME", help="of python-can ..")
    node.add_argument("--channel", metavar="NAME", help=".. and its channel")
    node.add_argument("--bitrate", type=int, metavar="BIT/S", help="where the adapter sets it")
    node.add_argument("--serial", metavar="URL", help="a serial line instead: the project's own stream (COBS)")
    node.add_argument("--baud", type=int, default=921600, metavar="N", help="of the serial line, default 921600")
    node.add_argument("--speed", default="1", metavar="N|max", help="times real time, default 1")
    node.add_argument("--config", metavar="CONFIG.toml", help="what the frames of a LOG mean; --serial needs it")
    node.add_argument("--write-config", metavar="FILE", help="the config for the other end (CAN: its DBC beside it)")
    node.add_argument("--truth", metavar="FILE", help="true modes and matrices of a rig, okid.truth/1")
    node.set_defaults(command="command_nodes:run_emulate")
