# SPDX-License-Identifier: MIT
"""The command okid-live."""

from __future__ import annotations

import argparse
import contextlib
import errno
import signal
import socket
import sys
import tempfile
import threading
import webbrowser
from collections.abc import Callable, Sequence
from pathlib import Path
from types import FrameType
from typing import NamedTuple

from okid._errors import InputError, complain, say
from okid.abi.program import run_program
from okid.live.config import PageConfig, ReportFiles, read_config
from okid.live.desk import Desk, page_of_log
from okid.live.finished import Identified, Worker, page_of_result
from okid.live.replayed import Replayed
from okid.live.server import PageServer, is_loopback
from okid.live.session import Session
from okid.report.other_kinds import check_kind, kind_of

EXIT_DONE, EXIT_USAGE, EXIT_DEVICE = 0, 2, 4


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="okid-live",
        usage="okid-live [FILE ...] [OPTIONS] [-- OPTIONS OF okid identify OR okid replay]",
        description="One page for a running `okid run CONFIG.toml`, a log or journal to replay, records to identify, "
        "or a result: signals, spectra, response functions, modes, stabilization diagram, mode shapes, bus health, "
        "result. Without a file: a page to drop or name files on.",
        epilog='example: okid-live frame.toml --open      with socket = "okid.sock" and samples = true in [publish] of '
        "frame.toml; from another computer: ssh -L 8765:127.0.0.1:8765 HOST, then the same address there. Others: "
        "okid-live run.okj; okid-live run.csv --inputs force --outputs a1,a2; okid-live result.json --record run.csv",
    )  # fmt: skip
    parser.add_argument(
        "files", metavar="FILE", nargs="*", help="CONFIG.toml of a run, a log or journal, records of one structure, or "
        "a result (.json)",
    )  # fmt: skip
    parser.add_argument("-c", "--config", metavar="CONFIG.toml", help="of a log: what its frames mean")
    parser.add_argument("--inputs", metavar="NAMES", help="of records: force columns, with commas between")
    parser.add_argument("--outputs", metavar="NAMES", help="of records: response columns, with commas between")
    parser.add_argument(
        "--record", metavar="FILE", nargs="+", action="extend", default=[], help="of a result: the record it is from"
    )
    parser.add_argument("--geometry", metavar="FILE", help="of records and results: as okid-report takes it")
    parser.add_argument("--socket", metavar="PATH", help="of a run: okid's socket, in place of [publish] socket")
    parser.add_argument("--host", default="127.0.0.1", metavar="ADDRESS", help="address to listen on (127.0.0.1)")
    parser.add_argument("--port", type=int, default=8765, metavar="N", help="port, 0 = any that is free (8765)")
    parser.add_argument("--open", action="store_true", help="open the page in the default browser")
    return parser


def _fail(text: str, code: int) -> int:
    complain("okid-live", text)
    return code


def _browse(address: str, folder: Path) -> None:
    """Open the page by a private file: arguments of a program, where the key would stand, are seen by everybody."""
    page = folder / "open.html"
    page.write_text(f'<!DOCTYPE html><meta http-equiv="refresh" content="0;url={address}">', encoding="utf-8")
    webbrowser.open(page.as_uri())


def _serve(server: PageServer, desk: Desk, stop: threading.Event, browse: bool) -> None:
    """Until `stop` is set."""
    threading.Thread(target=server.serve_forever, kwargs={"poll_interval": 0.5}, daemon=True).start()
    server.session.start()
    address = f"{server.url}#{desk.token}"
    say(f"okid-live: {address}   (Ctrl-C ends it)", flush=True)
    if browse:
        threading.Thread(target=_browse, args=(address, desk.folder), daemon=True).start()
    stop.wait()
    desk.stop()
    server.session.stop()
    server.shutdown()


def _why_not(args: argparse.Namespace, fault: OSError | UnicodeError) -> str:
    """Why there is no address to listen on, and what to do."""
    own = "127.0.0.1 (this computer alone), 0.0.0.0 or an address of this computer"
    if isinstance(fault, socket.gaierror | UnicodeError):
        return f"--host {args.host}: no such address: {getattr(fault, 'strerror', None) or fault}; expected {own}"
    why = fault.strerror or str(fault)
    if fault.errno in (errno.EADDRINUSE, errno.EACCES):
        return f"{args.host} port {args.port}: {why}; choose another with --port N"
    return f"--host {args.host}: {why}; expected {own}"


class _Wanted(NamedTuple):
    """What the page begins with."""

    config: PageConfig
    source: Callable[[Session], Worker] | None = None


def _only(args: argparse.Namespace, kind: str, *allowed: str) -> None:
    """InputError for an option of something else than what was named."""
    for name in ("config", "inputs", "outputs", "record", "geometry", "socket", "rest"):
        if getattr(args, name) and name not in allowed:
            option = {"config": "-c", "rest": f"-- {' '.join(args.rest)}"}.get(name, f"--{name}")
            takes = ", ".join(f"--{one}" for one in allowed if one != "rest") or "no option of a file"
            raise InputError(f"{option} is not an option of {kind}, expected {takes}")


def _of_records(args: argparse.Namespace, files: list[Path], folder: Path) -> _Wanted:
    _only(args, "records", "inputs", "outputs", "geometry", "rest")
    if not args.outputs and "--frf" not in args.rest:
        run_program("identify", *files)  # says which columns there are
    named = [f"--{name}={getattr(args, name)}" for name in ("inputs", "outputs") if getattr(args, name)]
    given = ReportFiles(record=tuple(files), geometry=_absolute(args.geometry))
    page = PageConfig(files[0], None, True, "", length_s=0.0)
    return _Wanted(page, lambda session: Identified(session, given, [*named, *args.rest], folder))


def _absolute(path: str | None) -> Path | None:
    return None if path is None else Path(path).absolute()


def _wanted(args: argparse.Namespace, folder: Path) -> _Wanted:
    """By what the first file is. InputError says what does not go together."""
    if not args.files:
        _only(args, "the start page")
        if not is_loopback(args.host):
            raise InputError(
                f"--host {args.host}: the start page reads files by their names, expected the loopback (127.0.0.1) "
                "and a tunnel (ssh -L)"
            )
        return _Wanted(PageConfig(Path(""), None, False, "", absent="no file yet", length_s=0.0))
    files = [Path(one).absolute() for one in args.files]
    found = kind_of(files[0])
    key = found.key if found is not None else ""
    if key in ("config", "toml", "rig") or files[0].suffix == ".toml":
        _single(args, "config of a run")
        _only(args, "a run", "socket")
        return _Wanted(read_config(args.files[0], args.socket))
    if not files[0].exists():
        raise InputError(f"{args.files[0]}: No such file or directory")
    if key == "result":
        _single(args, "result")
        _only(args, "a result", "record", "geometry", "config")
        record = tuple(Path(one).absolute() for one in args.record)
        config, geometry = _absolute(args.config), _absolute(args.geometry)
        return _Wanted(*page_of_result(files[0], ReportFiles(record=record, config=config, geometry=geometry)))
    if key in ("journal", "log") or files[0].suffix in (".okj", ".log"):
        _single(args, "log")
        _only(args, "a log", "config", "rest")
        place = _absolute(args.config)
        return _Wanted(
            page_of_log(files[0], place), lambda session: Replayed(session, files[0], place, args.rest, folder)
        )
    for file in files:
        check_kind(file, "record")
    return _of_records(args, files, folder)


def _single(args: argparse.Namespace, what: str) -> None:
    if len(args.files) > 1:
        raise InputError(f"{args.files[1]}: found a second file, expected one {what}; only records may be several")


def _run(args: argparse.Namespace, stop: threading.Event, folder: Path) -> int:
    if not 0 <= args.port <= 65535:
        return _fail(f"--port is {args.port}, expected a number from 0 to 65535", EXIT_USAGE)
    faults: list[str] = []

    def give_up(text: str) -> None:
        faults.append(text)
        stop.set()

    try:
        wanted = _wanted(args, folder)
    except InputError as fault:
        return _fail(str(fault), EXIT_USAGE)

    def source(session: Session) -> Worker:
        assert wanted.source is not None
        worker = wanted.source(session)
        worker.on_failure = give_up
        return worker

    session = Session(wanted.config, source if wanted.source is not None else None)
    desk = Desk(session, folder, start=not args.files)
    try:
        server = PageServer(session, args.host, args.port, desk)
    except (OSError, UnicodeError) as fault:  # a name that is none, as a..b, is a UnicodeError
        return _fail(_why_not(args, fault), EXIT_DEVICE)
    if not is_loopback(args.host):
        _fail(f"listens on {server.url}: anyone who reaches that address can watch, unencrypted", 0)
    with server:
        _serve(server, desk, stop, args.open)
    return _fail(faults[0], EXIT_USAGE) if faults else EXIT_DONE


def _split(given: Sequence[str]) -> tuple[list[str], list[str]]:
    """Own arguments, and those behind a lone "--", which go on to okid."""
    own = list(given)
    at = own.index("--") if "--" in own else len(own)
    return own[:at], own[at + 1 :]


def main(arguments: Sequence[str] | None = None) -> int:
    """Entry point of okid-live; exit codes: 0 ended by Ctrl-C or SIGTERM, 2 wrong usage or input, 4 address not
    available."""
    given, rest = _split(sys.argv[1:] if arguments is None else arguments)
    args = _parser().parse_args(given)
    args.rest = rest
    stop = threading.Event()

    def ask_to_stop(_number: int, _frame: FrameType | None) -> None:
        stop.set()

    before = {number: signal.signal(number, ask_to_stop) for number in (signal.SIGINT, signal.SIGTERM)}
    try:
        folder = tempfile.TemporaryDirectory(prefix="okid-live-")
        with contextlib.suppress(BrokenPipeError), folder:  # the reader of the messages is gone
            return _run(args, stop, Path(folder.name))
        return EXIT_DONE
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
