# SPDX-License-Identifier: MIT
"""The command okid-live."""

from __future__ import annotations

import argparse
import contextlib
import errno
import signal
import socket
import threading
import webbrowser
from collections.abc import Sequence
from types import FrameType

from okid._errors import InputError, complain, say
from okid.live.config import read_config
from okid.live.server import PageServer, is_loopback
from okid.live.session import Session

EXIT_DONE, EXIT_USAGE, EXIT_DEVICE = 0, 2, 4


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="okid-live",
        description="Show a running `okid run CONFIG.toml` (or `okid replay`) as a web page: signals, spectra, "
        "response functions, modes, stabilization diagram, mode shapes, bus health, result. It is read-only.",
        epilog="example: okid-live frame.toml --open      with socket = \"okid.sock\" and samples = true in [publish] "
        "of frame.toml; from another computer: ssh -L 8765:127.0.0.1:8765 HOST, then http://127.0.0.1:8765/",
    )  # fmt: skip
    parser.add_argument("config", metavar="CONFIG.toml", help="the config okid runs with")
    parser.add_argument("--socket", metavar="PATH", help="okid's socket, in place of [publish] socket")
    parser.add_argument("--host", default="127.0.0.1", metavar="ADDRESS", help="address to listen on (127.0.0.1)")
    parser.add_argument("--port", type=int, default=8765, metavar="N", help="port, 0 = any that is free (8765)")
    parser.add_argument("--open", action="store_true", help="open the page in the default browser")
    return parser


def _fail(text: str, code: int) -> int:
    complain("okid-live", text)
    return code


def _serve(server: PageServer, session: Session, stop: threading.Event, browse: bool) -> None:
    """Until `stop` is set."""
    threading.Thread(target=server.serve_forever, kwargs={"poll_interval": 0.5}, daemon=True).start()
    session.start()
    say(f"okid-live: {server.url}   (Ctrl-C ends it)", flush=True)
    if browse:
        threading.Thread(target=webbrowser.open, args=(server.url,), daemon=True).start()
    stop.wait()
    server.shutdown()
    session.stop()


def _why_not(args: argparse.Namespace, fault: OSError | UnicodeError) -> str:
    """Why there is no address to listen on, and what to do."""
    own = "127.0.0.1 (this computer alone), 0.0.0.0 or an address of this computer"
    if isinstance(fault, socket.gaierror | UnicodeError):
        return f"--host {args.host}: no such address: {getattr(fault, 'strerror', None) or fault}; expected {own}"
    why = fault.strerror or str(fault)
    if fault.errno in (errno.EADDRINUSE, errno.EACCES):
        return f"{args.host} port {args.port}: {why}; choose another with --port N"
    return f"--host {args.host}: {why}; expected {own}"


def _run(args: argparse.Namespace, stop: threading.Event) -> int:
    if not 0 <= args.port <= 65535:
        return _fail(f"--port is {args.port}, expected a number from 0 to 65535", EXIT_USAGE)
    try:
        session = Session(read_config(args.config, args.socket))
    except InputError as fault:
        return _fail(str(fault), EXIT_USAGE)
    try:
        server = PageServer(session, args.host, args.port)
    except (OSError, UnicodeError) as fault:  # a name that is none, as a..b, is a UnicodeError
        return _fail(_why_not(args, fault), EXIT_DEVICE)
    if not is_loopback(args.host):
        _fail(f"listens on {server.url}: anyone who reaches that address can watch, unencrypted", 0)
    with server:
        _serve(server, session, stop, args.open)
    return EXIT_DONE


def main(arguments: Sequence[str] | None = None) -> int:
    """Entry point of okid-live; exit codes: 0 ended by Ctrl-C or SIGTERM, 2 wrong usage, 4 address not available."""
    args = _parser().parse_args(arguments)
    stop = threading.Event()

    def ask_to_stop(_number: int, _frame: FrameType | None) -> None:
        stop.set()

    before = {number: signal.signal(number, ask_to_stop) for number in (signal.SIGINT, signal.SIGTERM)}
    try:
        with contextlib.suppress(BrokenPipeError):  # nobody reads what is said
            return _run(args, stop)
        return EXIT_DONE
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
