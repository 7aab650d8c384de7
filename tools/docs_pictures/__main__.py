# SPDX-License-Identifier: MIT
"""`make docs-pictures`: every picture of docs/images, from real runs of the program that stands in build/.

`python -m docs_pictures [GROUP ...]` with PYTHONPATH=tools makes those of the groups below.
"""

from __future__ import annotations

import sys
import time

from docs_pictures import browser, drawings, plots, runs


def main(wanted: list[str]) -> int:
    groups = {
        "drawings": drawings.make,
        "plots": plots.make,
        "report": browser.reports,
        "live": browser.live,
        "campaign": browser.campaign,
        "notebook": browser.notebook,
    }
    unknown = [name for name in wanted if name not in groups]
    if unknown:
        print(f"docs-pictures: no group {unknown[0]}; there are {', '.join(groups)}", file=sys.stderr)
        return 2
    runs.prepare()
    for name in wanted or groups:
        began = time.monotonic()
        made = groups[name]()
        print(f"{name}: {len(made)} pictures, {time.monotonic() - began:.0f} s: {' '.join(made)}")
    return 0


sys.exit(main(sys.argv[1:]))
