# SPDX-License-Identifier: MIT
"""The line of progress below a cell of a notebook."""

from __future__ import annotations

import sys
from importlib import import_module
from io import StringIO
from typing import Any

from okid.data.progress import Progress


class _Cell(StringIO):
    """A terminal of one line, in the output of the cell that runs; there is none until something is written."""

    def __init__(self) -> None:
        super().__init__()
        self._shown: Any = None

    def isatty(self) -> bool:
        return True

    def write(self, text: str) -> int:
        display: Any = import_module("IPython.display").display
        content = {"text/plain": text.strip()}
        if self._shown is None:
            self._shown = display(content, raw=True, display_id=True)
        else:
            self._shown.update(content, raw=True)
        return len(text)


def in_notebook() -> bool:
    """Is this Python the kernel of a notebook?"""
    if "ipykernel" not in sys.modules or "IPython" not in sys.modules:
        return False
    return hasattr(sys.modules["IPython"].get_ipython(), "kernel")


def cell_progress() -> Progress:
    """Progress for the cell that runs; outside of a notebook it says nothing: a library keeps stderr clean."""
    inside = in_notebook()
    return Progress("okid", inside, _Cell() if inside else None)
