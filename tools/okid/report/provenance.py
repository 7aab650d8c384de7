# SPDX-License-Identifier: MIT
"""The last section: which files, programs and settings this report was made of."""

from __future__ import annotations

import hashlib
import re
from html import escape
from pathlib import Path

from okid._errors import InputError
from okid.data.input_file import open_input
from okid.report import page
from okid.report.material import Material, Source

CHUNK = 1 << 20


def source_of(kind: str, path: str | Path) -> Source:
    """Name, SHA-256 and size of a file. InputError when it cannot be read."""
    digest, size = hashlib.sha256(), 0
    try:
        with open_input(path) as file:
            while block := file.read(CHUNK):
                digest.update(block)
                size += len(block)
    except OSError as fault:
        raise InputError(f"{path}: {fault.strerror or fault}") from None
    return Source(kind, str(path), digest.hexdigest(), size)


def without_passwords(text: str) -> str:
    """The text with user names and passwords of addresses taken out: mqtt://user:secret@host becomes mqtt://…@host."""
    return re.sub(r"://[^\n]*@", "://…@", text)


def provenance_section(m: Material, written: str | None) -> page.Section:
    """`written`: the one line that tells when and by which command, None = left out."""
    from okid import library_version

    raw = m.result.raw
    rows = [("Result made by", f"okid {raw.get('version', '–')}"), ("Report made by", f"okid {library_version()}")]
    if m.events is not None and m.events.start is not None and m.events.start.get("config"):
        rows.append(("Config of the run", str(m.events.start["config"])))
    rows += [("Written", written)] if written else []
    files = [[one.kind, one.name, str(one.size), one.sha256] for one in m.sources]
    listed = page.table(["file", "name", "bytes", "SHA-256"], files, "files") if files else ""
    texts = [
        f"{page.heading(f'Text of {name}')}\n<pre>{escape(without_passwords(text))}</pre>" for name, text in m.texts
    ]
    return page.section("Provenance", page.facts(rows), listed, *texts)
