# SPDX-License-Identifier: MIT
"""Extension of mkdocstrings' reader: examples (`>>>`) in docstrings become code, as they are in the source."""

from __future__ import annotations

from typing import Any

import griffe


def fenced(text: str) -> str:
    """The text with every run of lines from one with `>>>` to an empty one between fences."""
    out: list[str] = []
    inside = False
    for line in text.splitlines():
        if line.startswith(">>>") and not inside:
            inside = True
            out += ["", "```pycon"]
        elif not line.strip() and inside:
            inside = False
            out.append("```")
        out.append(line)
    return "\n".join([*out, "```"] if inside else out)


class Examples(griffe.Extension):  # type: ignore[misc]
    """Changes the docstring of every object that is read."""

    def on_object(self, *, obj: Any, **_: Any) -> None:
        """Called once for each object."""
        if obj.docstring:
            obj.docstring.value = fenced(obj.docstring.value)
