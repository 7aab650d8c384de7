# SPDX-License-Identifier: MIT
"""What a file is that was given in the place of another: by a look at its beginning, with what to do."""

from __future__ import annotations

import re
from pathlib import Path
from typing import NamedTuple

from okid._errors import InputError
from okid.data.input_file import parse_json
from okid.formats.log_names import FRAME_CSV_HEAD

LOOKED_AT = 65536  # bytes
MADE_BY = "as `okid identify`, `okid run` or `okid replay` writes it with --json FILE"


class Kind(NamedTuple):
    """`key`: one of those of _HERE and _INSTEAD; `words`: the same for a reader, with its article."""

    key: str
    words: str


_WANTED = {
    "result": f"an okid.result/1, {MADE_BY}",
    "record": "the record that the result is of (a table of samples)",
    "events": "JSON lines as `okid run` or `okid replay` writes them with --events FILE",
    "config": "a CONFIG.toml of okid",
}
# Kinds that a place takes, or has a message of its own for.
_HERE = {
    "result": ("result",),
    "record": ("table", "empty", "binary"),
    "events": ("events", "empty"),
    "config": ("config", "rig", "toml", "empty"),
}
_INSTEAD = {
    ("result", "truth"): "give the file of --json, not that of --truth",
    ("result", "events"): "give it with --events, and the file of --json here",
    ("result", "config"): "`okid replay LOG -c {path} --json result.json` makes one",
    ("result", "rig"): "`okid simulate {path} --log run.log --config frame.toml`, then "
    "`okid replay run.log -c frame.toml --json result.json` makes one",
    ("result", "log"): "`okid replay {path} -c CONFIG.toml --json result.json` makes one",
    ("result", "journal"): "`okid replay {path} --json result.json` makes one",
    ("result", "table"): "`okid identify {path} --inputs NAMES --outputs NAMES --json result.json` makes one; "
    "the table itself goes with --record",
    ("record", "log"): "`okid convert {path} run.csv -c CONFIG.toml` makes one",
    ("record", "journal"): "`okid convert {path} run.csv` makes one",
    ("record", "frames"): "`okid-convert {path} run.csv --config CONFIG.toml` makes one",
    ("record", "events"): "give it with --events",
    ("record", "config"): "give it with --config",
    ("events", "config"): "give it with --config",
    ("events", "table"): "give it with --record",
    ("config", "events"): "give it with --events",
    ("config", "table"): "give it with --record",
}
_TEXTS = (  # the first that is found in the text
    ("log", r"\A\(\d+\.\d+\)\s+\S+\s+[0-9A-Fa-f]+#", "a log of CAN frames (candump -L)"),
    ("html", r"(?i)\A(?:<!doctype html|<html)", "an HTML page"),
    ("config", r"(?m)^\s*\[{1,2}(?:acquisition|bus|channel|identification)\]", "a CONFIG.toml"),
    ("rig", r"(?m)^\s*(?:masses|M)\s*=\s*\[", "a RIG.toml"),
    ("toml", r"(?m)\A(?:\s*#[^\n]*\n|\s*\n)*\[{1,2}[\w.-]+\]{1,2}\s*$", "a TOML file"),
    ("dbc", r"\AVERSION\s|(?m:^BU_\s*:)", "a DBC"),
)  # fmt: skip
_BYTES = (
    ("journal", b"\x8fOKJ", "a journal of CAN frames"),
    ("pdf", b"%PDF-", "a PDF"),
    ("picture", b"\x89PNG", "a picture"),
)


def _json_kind(text: str) -> Kind | None:
    """Of text that begins with a brace: by its schema, or events by their first line."""
    try:
        first = parse_json(text.partition("\n")[0])
    except ValueError:
        first = None
    if isinstance(first, dict) and isinstance(first.get("type"), str):
        return Kind("events", "JSON lines, the events of a run")
    found = re.search(r'"schema"\s*:\s*"([^"\\]{1,60})"', text)
    schema = found[1] if found else ""
    if schema == "okid.result/1":
        return Kind("result", "a result of okid")
    if schema == "okid.truth/1":
        return Kind("truth", "the truth of a simulation (schema 'okid.truth/1')")
    return Kind("json", f"JSON of the schema {schema!r}") if found else None


def _is_table(text: str) -> bool:
    """Comment lines, a line of names, a line of numbers."""
    lines = [line for line in text.splitlines()[:40] if line.strip() and not line.startswith("#")]
    if len(lines) < 2 or not re.search(r"[,;\t]", lines[0]):
        return False
    return re.match(r'[\s"]*(?:[-+]?[.\d]|nan|[,;\t])', lines[1], re.IGNORECASE) is not None


def kind_of(path: str | Path) -> Kind | None:
    """What a file is, None for what is not known or cannot be read. Cost: the first 64 KiB."""
    place = Path(path)
    if place.is_dir():
        return Kind("folder", "a folder")
    if not place.is_file():
        return None  # absent, or a pipe: a look would take from it
    try:
        with place.open("rb") as file:
            head = file.read(LOOKED_AT)
    except OSError:
        return None
    if not head:
        return Kind("empty", "empty")
    for key, magic, words in _BYTES:
        if head.startswith(magic):
            return Kind(key, words)
    if b"\0" in head:
        return Kind("binary", "a binary file")
    text = head.decode("utf-8-sig", errors="replace").lstrip()
    if text.startswith("{"):
        return _json_kind(text)
    if text.startswith(FRAME_CSV_HEAD):
        return Kind("frames", "a table of CAN frames")
    for key, pattern, words in _TEXTS:
        if re.search(pattern, text):
            return Kind(key, words)
    return Kind("table", "a table of samples (CSV)") if _is_table(text) else None


def check_kind(path: str | Path, place: str) -> None:
    """InputError when `path` is known to be something else than `place` takes.

    `place`: "result", "record", "events" or "config". The message names what was found, what is
    expected and what to do. A file of no known kind passes: its reader judges.
    """
    found = kind_of(path)
    if found is None or found.key in _HERE[place]:
        return
    remedy = _INSTEAD.get((place, found.key), "")
    text = f"{path}: is {found.words}, expected {_WANTED[place]}"
    raise InputError(text + (f": {remedy.format(path=path)}" if remedy else ""))
