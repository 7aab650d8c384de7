# SPDX-License-Identifier: MIT
"""okid-report: one self-contained HTML page from an okid.result/1, with more pictures for all that is given with it.

write_report(result, "report.html", record="run.csv") from Python, main() is the command.
"""

from __future__ import annotations

from collections.abc import Sequence
from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from okid.report.compose import build, write_report
    from okid.report.loaded import Loaded, load_result, loaded_from
    from okid.report.measured import Measured, measure, measured_from
    from okid.report.responses import choose_pairs

__all__ = [
    "Loaded",
    "Measured",
    "build",
    "choose_pairs",
    "load_result",
    "loaded_from",
    "main",
    "measure",
    "measured_from",
    "write_report",
]

_PLACES = {
    "compose": ("build", "write_report"),
    "loaded": ("Loaded", "load_result", "loaded_from"),
    "measured": ("Measured", "measure", "measured_from"),
    "responses": ("choose_pairs",),
}


def main(arguments: Sequence[str] | None = None) -> int:
    """Entry point of okid-report; returns the exit code 0, 2, or 130 after Ctrl-C. What draws is loaded when needed."""
    from okid.data.interrupt import guarded

    return guarded("okid-report", "okid.report.command", arguments)


def __getattr__(name: str) -> Any:
    """The functions load with matplotlib and scipy (2 s) when the first of them is used."""
    for module, names in _PLACES.items():
        if name in names:
            return getattr(import_module(f"okid.report.{module}"), name)
    raise AttributeError(f"module 'okid.report' has no attribute {name!r}")
