# SPDX-License-Identifier: MIT
"""TOML files of a user, parsed, with one kind of message for everything that can be wrong with one."""

from __future__ import annotations

import tomllib
from pathlib import Path
from typing import Any

from okid._errors import InputError
from okid.data.input_file import parse_toml, read_input


def read_toml(path: str | Path) -> tuple[dict[str, Any], str]:
    """What a TOML file says, and its text. InputError of one line names the file, and the place of a fault."""
    try:
        text = read_input(path).decode("utf-8-sig")
        return parse_toml(text), text
    except UnicodeDecodeError as fault:
        raise InputError(f"{path}: byte {fault.start} is not UTF-8 text, expected a TOML file") from None
    except tomllib.TOMLDecodeError as fault:
        raise InputError(f"{path}: not TOML: {fault}") from None
