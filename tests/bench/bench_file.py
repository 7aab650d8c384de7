# SPDX-License-Identifier: MIT
"""Where the programs of `make bench` leave their ratios, for tools/bench_check.py."""

from __future__ import annotations

import json
import sys
from pathlib import Path


def keep(ratios: dict[str, float], argument: int = 1) -> None:
    """Into the file of `okid bench --save` that the command line names there; nothing where it names none."""
    if len(sys.argv) <= argument:
        return
    path = Path(sys.argv[argument])
    bench = json.loads(path.read_text(encoding="utf-8"))
    bench["ratios"] |= ratios
    path.write_text(json.dumps(bench, indent=1) + "\n", encoding="utf-8")
