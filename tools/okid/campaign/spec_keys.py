# SPDX-License-Identifier: MIT
"""Every key of a SPEC.toml, what it may be, and messages that name file, section, key and the nearest known key."""

from __future__ import annotations

import difflib
import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple, NoReturn

from okid._errors import InputError


class Number(NamedTuple):
    """A number in low .. high; `whole` without a fraction; `above` without the lower end itself."""

    low: float
    high: float = math.inf
    whole: bool = False
    above: bool = False


TEXT, FLAG, TABLE = "text", "true or false", "a table"
NAMES, TEXTS, NUMBERS = "a list of names", "a list of texts", "a list of numbers"
METHODS = ("auto", "okid-era", "okid-era-dc", "n4sid-moesp", "n4sid-cva", "n4sid-ssarx")

KEYS: dict[str, dict[str, Any]] = {
    "campaign": {"title": TEXT, "structure": TEXT},
    "records": {
        "files": TEXTS, "name": TEXT, "time_format": TEXT, "time": ("name", "index", "modified"), "index": TEXT,
        "index_path": TEXT, "index_time": TEXT, "config": TEXT, "storage": TABLE,
    },
    "channels": {
        "inputs": NAMES, "outputs": NAMES, "columns": NAMES, "fs_hz": Number(0, 1e9, above=True),
        "codes": (0, 16, 24, 32), "scale": NUMBERS, "offset": NUMBERS, "saturated": ("keep", "missing"),
    },
    "identification": {
        "method": METHODS, "p": Number(1, 4096, whole=True), "rows": Number(2, 4096, whole=True),
        "order": ("auto", Number(1, 4096, whole=True)), "max_order": Number(1, 4096, whole=True),
        "hankel": ("system", "innovations", "literal"), "detrend": ("none", "mean"),
        "sigma_blocks": (0, Number(8, 100, whole=True)), "pieces": Number(1, 100, whole=True),
        "stabilization": FLAG, "band": NUMBERS, "decimate": Number(1, 1000, whole=True),
        "refine": ("no", "auto", "yes"),
    },
    "group": {"by": NAMES, "band_c": Number(0, 200, above=True)},
    "temperature": {"channel": TEXT, "scale": Number(-1e9, 1e9), "offset": Number(-1e9, 1e9), "column": TEXT},
    "trend": {
        "training_until": TEXT, "training_share": Number(0.05, 1.0), "false_alarm_per_year": Number(1e-4, 0.5),
        "min_mpc": Number(0, 1), "max_damping": Number(0, 1, above=True), "series": NAMES,
        "seed": Number(0, 2**31, whole=True),
        "temperature_order": ("auto", Number(0, 3, whole=True)), "change_test": FLAG,
    },
    "cluster": {"workers": Number(1, 4096, whole=True), "address": TEXT, "memory_mb": Number(100, 1e7)},
    "output": {"folder": TEXT, "keep": ("auto", "parts", "sums"), "batch_mb": Number(1, 4096)},
}  # fmt: skip


def nearest(name: str, known: Sequence[str]) -> str:
    """`; did you mean "p"?`, or the list of what is known when nothing is near."""
    close = difflib.get_close_matches(name, known, n=1, cutoff=0.5)
    return f'; did you mean "{close[0]}"?' if close else f"; known: {', '.join(known)}"


def line_of(text: str, section: str, key: str | None) -> int | None:
    """The line of a key (None: of the section's head) in the text of a TOML file; None when it is not found."""
    inside = False
    for number, line in enumerate(text.splitlines(), 1):
        bare = line.split("#", 1)[0].strip()
        if bare.startswith("["):
            inside = bare.strip("[] ").strip() == section
            if inside and key is None:
                return number
        elif inside and key is not None and bare.split("=", 1)[0].strip().strip("\"'") == key:
            return number
    return None


class Place:
    """A section of a SPEC.toml, for messages."""

    def __init__(self, path: Path, text: str, section: str) -> None:
        self.path, self.section, self._text = path, section, text

    def refuse(self, key: str | None, what: str) -> NoReturn:
        """Raise InputError that names file, line, section and key."""
        line = line_of(self._text, self.section, key) or line_of(self._text, self.section, None)
        at = f"{self.path}:{line}" if line else str(self.path)
        raise InputError(f'{at}: [{self.section}]{"" if key is None else f", key {chr(34)}{key}{chr(34)}"}: {what}')


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)


def _expectation(rule: Any) -> str:
    if isinstance(rule, tuple) and not isinstance(rule, Number):
        return " or ".join(_expectation(one) if isinstance(one, Number) else repr(one) for one in rule)
    if isinstance(rule, Number):
        kind = "a whole number" if rule.whole else "a number"
        upper = "" if rule.high == math.inf else f" to {rule.high:g}"
        return f"{kind} {'above' if rule.above else 'from'} {rule.low:g}{upper}"
    return str(rule)


def fits(value: Any, rule: Any) -> bool:
    """Does the value keep the rule of its key?"""
    if isinstance(rule, Number):
        if not _is_number(value) or (rule.whole and not isinstance(value, int)):
            return False
        return bool(rule.low <= value <= rule.high) and not (rule.above and value == rule.low)
    if isinstance(rule, tuple):
        return any(
            fits(value, one) if isinstance(one, Number) else (value == one and type(value) is type(one)) for one in rule
        )
    if rule in (TEXT, FLAG, TABLE):
        return isinstance(value, {TEXT: str, FLAG: bool, TABLE: dict}[rule]) and value != ""
    listed = isinstance(value, list)
    if rule == NUMBERS:
        return listed and all(_is_number(one) for one in value)
    return listed and all(isinstance(one, str) and one.strip() for one in value)


def check_keys(path: Path, text: str, file: dict[str, Any]) -> None:
    """Every section and key is known and holds what it may. Raises InputError."""
    for section, table in file.items():
        if section not in KEYS:
            line = line_of(text, section, None)
            at = f"{path}:{line}" if line else str(path)
            raise InputError(f'{at}: unknown section "{section}"{nearest(section, list(KEYS))}')
        place = Place(path, text, section)
        if not isinstance(table, dict):
            place.refuse(None, f"found {table!r}, expected a table")
        for key, value in table.items():
            rule = KEYS[section].get(key)
            if rule is None:
                place.refuse(key, f"unknown key{nearest(key, list(KEYS[section]))}")
            if not fits(value, rule):
                place.refuse(key, f"found {value!r}, expected {_expectation(rule)}")
