# SPDX-License-Identifier: MIT
"""An okid.result/1 file, parsed: what of it must be there is said by those who need it."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from okid._errors import InputError
from okid.data.input_file import parse_json, read_input


def read_result(path: str | Path) -> dict[str, Any]:
    """The object an okid.result/1 file holds. InputError of one line names the file, and line and column of a fault."""
    try:
        raw = parse_json(read_input(path).decode("utf-8"))
    except UnicodeDecodeError:
        raise InputError(f"{path}: not UTF-8 text, expected an okid.result/1 JSON file") from None
    except json.JSONDecodeError as fault:
        raise InputError(f"{path}:{fault.lineno}:{fault.colno}: not JSON: {fault.msg}") from None
    schema = raw.get("schema") if isinstance(raw, dict) else None
    if schema != "okid.result/1":
        raise InputError(f"{path}: schema is {schema!r}, expected 'okid.result/1'")
    return dict(raw)
