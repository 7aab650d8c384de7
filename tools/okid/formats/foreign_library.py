# SPDX-License-Identifier: MIT
"""Libraries of a format: loaded when they are needed, and what they raise over a file as one line."""

from __future__ import annotations

import contextlib
import importlib
import logging
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from okid._errors import Error, InputError
from okid.data.input_file import check_input
from okid.data.whole_file import whole_file


def library(name: str, purpose: str) -> Any:
    """Import an optional library when it is needed. InputError says how to install it."""
    try:
        return importlib.import_module(name)
    except ImportError:
        package = name.partition(".")[0]
        raise InputError(
            f"{purpose} needs {package}, which is not installed: pip install './tools[formats]' in a checkout of okid"
        ) from None


@contextlib.contextmanager
def reading(path: str | Path, kind: str) -> Iterator[None]:
    """Everything that goes wrong while `path` is read becomes an InputError of one line that names the file."""
    try:
        check_input(path)
        if Path(path).stat().st_size == 0:
            raise InputError(f"is empty, expected {kind}")
        yield
    except InputError as fault:
        text = str(fault)
        raise InputError(text if text.startswith(f"{path}") else f"{path}: {text}") from None
    except Error:
        raise
    except OSError as fault:
        if fault.errno is None:
            raise InputError(f"{path}: not {kind}: {_one_line(fault)}") from None
        raise InputError(f"{path}: {fault.strerror or fault}") from None
    except Exception as fault:  # the libraries share no base class, and damaged files raise almost anything
        raise InputError(f"{path}: not {kind}, or damaged: {_one_line(fault)}") from None


@contextlib.contextmanager
def writing(path: str | Path) -> Iterator[Path]:
    """whole_file() for the work of a foreign library: what it refuses becomes an InputError of one line."""
    with whole_file(path) as part:
        try:
            yield part
        except (Error, OSError):
            raise
        except Exception as fault:  # as in reading()
            raise InputError(f"{path}: cannot be written: {_one_line(fault)}") from None


def _one_line(fault: BaseException) -> str:
    text = " ".join(str(fault).split())
    return f"{type(fault).__name__}: {text[:160]}" if text else type(fault).__name__


class Complaints(logging.Handler):
    """How many warnings a library gave, and the first of them."""

    def __init__(self) -> None:
        super().__init__(logging.WARNING)
        self.first = ""
        self.count = 0

    def emit(self, record: logging.LogRecord) -> None:
        self.count += 1
        self.first = self.first or " ".join(record.getMessage().split())[:120]


@contextlib.contextmanager
def listening(name: str) -> Iterator[Complaints]:
    """What goes to the log `name` meanwhile; it reaches no other handler."""
    log, ear = logging.getLogger(name), Complaints()
    spread = log.propagate
    log.addHandler(ear)
    log.propagate = False
    try:
        yield ear
    finally:
        log.removeHandler(ear)
        log.propagate = spread
