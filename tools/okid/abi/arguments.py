# SPDX-License-Identifier: MIT
"""Arguments of a caller, looked at before anything is done with them: InputError says what was found and expected."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from okid._errors import InputError


def choice(name: str, value: str, allowed: Sequence[str]) -> str:
    """One of the words in `allowed`."""
    if value not in allowed:
        raise InputError(f"{name} is {value!r}, expected one of {', '.join(map(repr, allowed))}")
    return value


MOST_SAMPLES = 1 << 62  # OKID_MOST_SAMPLES


def state_bytes(value: object) -> bytes:
    """What to_bytes() or snapshot() gave."""
    if not isinstance(value, bytes | bytearray | memoryview):
        raise InputError(f"the state is {type(value).__name__}, expected bytes, as to_bytes() gives them")
    return bytes(value)


def behind_head(state: bytes) -> bytes:
    """A state of a stream without the head that tells its rate and channels (okid_host/stream.h)."""
    return state[int.from_bytes(state[8:16], "little") :] if state.startswith(b"OKIDSTR\n") else state


def whole(name: str, value: object, smallest: int, largest: int | None = None) -> int:
    """A whole number >= `smallest`, at most `largest`."""
    if largest is not None and isinstance(value, int | np.integer) and int(value) > largest:
        raise InputError(f"{name} is {str(value)[:40]}, expected a whole number from {smallest} to {largest}")
    if isinstance(value, bool) or not isinstance(value, int | np.integer) or int(value) < smallest:
        raise InputError(f"{name} is {value!r}, expected a whole number >= {smallest}")
    return int(value)


def positive(name: str, value: object, what: str) -> float:
    """A finite number > 0; `what` it is: "a sample rate in Hz"."""
    known = isinstance(value, int | float | np.number) and not isinstance(value, bool)
    try:
        number = float(value) if known else math.nan  # type: ignore[arg-type]
    except (OverflowError, TypeError):  # a whole number of hundreds of digits; complex
        number = math.nan
    if not 0.0 < number < math.inf:
        raise InputError(f"{name} is {value!r:.80}, expected {what} > 0")
    return number


def names(given: Sequence[str] | None, letter: str, count: int) -> list[str]:
    """Different names for `count` channels; None: u1, u2 .."""
    if isinstance(given, str):
        raise InputError(f"names are given as {given!r}, expected a list, such as [{given!r}]")
    out = [f"{letter}{k + 1}" for k in range(count)] if given is None else [str(name) for name in given]
    if len(out) != count or len(set(out)) != count:
        raise InputError(f"{count} different names are needed for the channels of {letter}, got {out}")
    return out


def channel_names(given: Sequence[str] | None, values: Any, letter: str, count: int) -> list[str]:
    """The names given, else those of a frame, else u1, u2 ..: as many as channels. InputError when they are not."""
    found = frame_names(values) if given is None else given
    if isinstance(found, str):
        raise InputError(f"names are given as {found!r}, expected a list, such as [{found!r}]")
    out = [f"{letter}{k + 1}" for k in range(count)] if found is None else [str(name) for name in found]
    if len(out) != count:
        raise InputError(f"{count} names are needed for the channels of {letter}, got {out}")
    return out


def frame_names(values: Any) -> list[str] | None:
    """Column names of a pandas frame (or of the first of several), None where there are none that say something."""
    first = values[0] if isinstance(values, list | tuple) and values else values
    columns = getattr(first, "columns", None)
    if columns is None:
        return None
    found = list(columns)
    return found if all(isinstance(name, str) for name in found) and len(set(found)) == len(found) else None


def unmasked(values: ArrayLike) -> NDArray[Any]:
    """As an array; what a masked array hides is missing (NaN), what pandas holds as missing too."""
    if isinstance(values, np.ma.MaskedArray):
        return np.ma.filled(values.astype(np.float64), np.nan) if np.ma.is_masked(values) else values.filled()
    to_numpy = getattr(values, "to_numpy", None)
    if to_numpy is not None and not isinstance(values, np.ndarray):  # nullable columns of pandas come as objects
        plain = to_numpy()
        if plain.dtype == object:
            try:
                return np.asarray(to_numpy(dtype=np.float64, na_value=np.nan))
            except (TypeError, ValueError):
                pass
        return np.asarray(plain)
    return np.asarray(values)
