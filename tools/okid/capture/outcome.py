# SPDX-License-Identifier: MIT
"""The end of a run, whatever ended it: the last model, the file, the counts, the exit code."""

from __future__ import annotations

import json
import os
import sys
import threading
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from okid._errors import Error, IdentificationError, InputError
from okid.capture.config import CaptureConfig, load_config
from okid.capture.lane import BusCounts
from okid.capture.mode_watch import ModeWatch
from okid.capture.program import check_config
from okid.session import Session

EXIT_DONE, EXIT_USAGE, EXIT_NO_MODEL, EXIT_DEVICE = 0, 2, 3, 4


def complain(text: object) -> None:
    """One line on stderr."""
    print(f"okid-capture: {text}", file=sys.stderr, flush=True)


def count_lines(name: str, counts: BusCounts, more: dict[str, int]) -> list[str]:
    """What was received and what was not, for a person."""
    causes = ", ".join(f"{cause} {number}" for cause, number in sorted(counts.lost.items()))
    text = f"{name}: {counts.received} received, {counts.lost_in_all} lost" + (f" ({causes})" if causes else "")
    rest = {"out of order": counts.out_of_order, "duplicate": counts.duplicate, "not decodable": counts.decode_errors}
    said = [f"{number} {what}" for what, number in (rest | more).items() if number]
    return [", ".join([text, *said])]


def check_target(path: str | None) -> None:
    """Where a result is to go, before anything is opened. Raises InputError."""
    if path is None or path == "-":
        return
    folder = Path(path).absolute().parent
    if not folder.is_dir():
        raise InputError(f"{path}: no folder {folder}")
    if Path(path).is_dir() or not os.access(folder, os.W_OK):
        raise InputError(f"{path}: cannot be written")


def read_config(path: str) -> CaptureConfig:
    """Checked by the program where there is one, then read. Remarks go to stderr."""
    check_config(path)
    config = load_config(path)
    for remark in config.remarks:
        complain(f"{config.path}: {remark}")
    return config


@dataclass
class Run:
    """One identification of a stream by a command. `json_path` "-": the result alone goes to stdout."""

    config: CaptureConfig
    json_path: str | None = None
    quiet: bool = False
    session: Session = field(init=False)
    watch: ModeWatch = field(init=False)

    def __post_init__(self) -> None:
        self.session = Session.from_config(self.config.path)
        self.watch = ModeWatch(self.session, self.config.update_s, self.say)

    def say(self, text: str) -> None:
        """To stdout, unless only the result belongs there."""
        if self.quiet or self.json_path == "-":
            return
        try:
            print(text, flush=True)
        except OSError:  # whoever read our lines has gone: the measurement goes on
            self.quiet = True

    def end(self, lines: list[str], silent: list[str], fault: str | None, others: str = "") -> int:
        """The result of what came; `fault` of the device is told last and decides the exit code.

        `others`: what came that no channel of the config asks for.
        """
        for line in lines:
            self.say(line)
        code = self._result(silent, others)
        if fault is not None:
            kept = "what came before is in the result" if code == EXIT_DONE else "what came before gives no model"
            complain(f"{fault}; {kept}")
            return EXIT_DEVICE
        return code

    def _result(self, silent: list[str], others: str) -> int:
        if silent:
            complain(
                f"no usable frame of channel {', '.join(silent)} was received: "
                + (f"the bus carries {others}; " if others else "")
                + f"is the sensor on, and are bus and identifier right in {self.config.path}?"
            )
            return EXIT_NO_MODEL
        try:
            result = self.session.identify()
        except IdentificationError as why:
            complain(why)
            return EXIT_NO_MODEL
        if self.json_path == "-":
            json.dump(result.to_dict(), sys.stdout, allow_nan=False)
            sys.stdout.write("\n")
            return EXIT_DONE
        if self.json_path is not None:
            try:
                result.save(self.json_path)
            except OSError as fault:
                complain(f"{self.json_path}: {fault.strerror or fault}")
                return EXIT_USAGE
        self.say(str(result.table()))
        return EXIT_DONE


def guarded(command: Any, args: Any, stop: threading.Event) -> int:
    """Run a command; whatever is wrong with what it was given becomes one line and the exit code."""
    try:
        return int(command(args, stop))
    except InputError as wrong:
        complain(wrong)
        return EXIT_USAGE
    except Error as wrong:
        complain(wrong)
        return EXIT_NO_MODEL
