# SPDX-License-Identifier: MIT
"""A DBC through cantools, with one kind of error."""

from __future__ import annotations

from typing import Any

from okid._errors import InputError


def read_dbc(path: str) -> Any:
    """The cantools database of a file. Raises InputError that names it."""
    import cantools

    try:
        return cantools.database.load_file(path)
    except OSError as fault:
        raise InputError(f"{path}: {fault.strerror or fault}") from None
    except Exception as fault:  # cantools has many parse errors without a common base
        raise InputError(f"{path}: not a readable DBC: {fault}") from None
