# SPDX-License-Identifier: MIT
"""The end of a run, whatever ended it: what is printed, the exit code."""

from __future__ import annotations

import os
import threading
from collections.abc import Callable
from pathlib import Path
from typing import Any

from okid import _errors
from okid._errors import Error, IdentificationError, InputError
from okid.capture.config import CaptureConfig, load_config
from okid.capture.stream import Capture

EXIT_DONE, EXIT_USAGE, EXIT_NO_MODEL, EXIT_DEVICE = 0, 2, 3, 4


def complain(text: object) -> None:
    """One line on stderr."""
    _errors.complain("okid-capture", text)


class Tap:
    """What is written on the way of a measurement: when the disk is full the measurement goes on without."""

    def __init__(self, path: str | None) -> None:
        self._path = path
        self.fault: str | None = None

    def keep(self, write: Callable[..., None], *given: Any, last: bool = False) -> None:
        """write(*given), until it fails; `last`: in any case, for it closes the file."""
        if self.fault is not None and not last:
            return
        try:
            write(*given)
        except OSError as full:
            if self.fault is None:
                self.fault = f"{self._path}: {full.strerror or full}" + ("" if last else ": no longer recorded")
                complain(self.fault)


def check_target(path: str | None) -> None:
    """Where a result is to go, before anything is opened. Raises InputError."""
    if path is None or path == "-":
        return
    folder = Path(path).absolute().parent
    if not folder.is_dir():
        raise InputError(f"{path}: no folder {folder}")
    if Path(path).is_dir() or not os.access(folder, os.W_OK):
        raise InputError(f"{path}: cannot be written")


def check_duration(seconds: float | None) -> None:
    """Raises InputError."""
    if seconds is not None and not 0.0 < seconds < float("inf"):
        raise InputError(f"--duration is {seconds}, expected seconds > 0")


def read_config(path: str) -> CaptureConfig:
    """Read and checked. Remarks go to stderr."""
    config = load_config(path)
    for remark in config.remarks:
        complain(f"{config.path}: {remark}")
    return config


def make_capture(config: CaptureConfig, args: Any, live: bool) -> Capture:
    """As the command line asks for it. Raises InputError."""
    if args.events == "-" and args.json == "-":
        raise InputError("--events - and --json - both want stdout, expected a file for one of them")
    if config.trigger == "gpio" and not live and args.trigger_at is None:
        raise InputError(
            f"{config.path}: waits for an edge of a GPIO line, which no log holds: say --trigger-at SECONDS"
        )
    return Capture(
        config, duration=args.duration, trigger_at=args.trigger_at, events=args.events, json=args.json, live=live,
        record=live, table=not args.quiet, keep_events=False,
    )  # fmt: skip


def end(capture: Capture, args: Any, lines: Callable[[], list[str]], fault: str | None) -> int:
    """The result of what came; `fault` of the device is printed last and decides the exit code. `lines`: the counts."""
    code = EXIT_DONE
    try:
        capture.finish()
    except IdentificationError as why:
        complain(why)
        code = EXIT_NO_MODEL
    except InputError as why:  # a file that cannot be written
        complain(why)
        code = EXIT_USAGE
    except Error as why:
        complain(why)
        code = EXIT_DEVICE
    if not args.quiet and "-" not in (args.json, args.events):
        try:
            _errors.say("\n".join(lines()), flush=True)
        except OSError:  # the reader of our lines has gone
            args.quiet = True
    if fault is not None:
        kept = "what came before is in the result" if code == EXIT_DONE else "what came before gives no model"
        complain(f"{fault}; {kept}")
        return EXIT_DEVICE
    return code


def guarded(command: Any, args: Any, stop: threading.Event) -> int:
    """Run a command; whatever is wrong with what it was given becomes one line and the exit code."""
    try:
        return int(command(args, stop))
    except InputError as wrong:
        complain(wrong)
        return EXIT_USAGE
    except IdentificationError as wrong:
        complain(wrong)
        return EXIT_NO_MODEL
    except Error as wrong:
        complain(wrong)
        return EXIT_DEVICE
