# SPDX-License-Identifier: MIT
"""The files of the page: a fixed list, so no request can name another file."""

from __future__ import annotations

import gzip
import threading
from pathlib import Path
from typing import NamedTuple

WEB = Path(__file__).resolve().parent.parent / "web"
SCRIPT, STYLE = "text/javascript; charset=utf-8", "text/css; charset=utf-8"
FILES = {
    "/": ("live.html", "text/html; charset=utf-8"),
    "/live.css": ("live.css", STYLE),
    "/plots.css": ("plots.css", STYLE),
    "/icon.svg": ("icon.svg", "image/svg+xml"),
    "/live.js": ("live.js", SCRIPT),
    "/start.js": ("start.js", SCRIPT),
    "/lanes.js": ("lanes.js", SCRIPT),
    "/plots.js": ("plots.js", SCRIPT),
    "/tables.js": ("tables.js", SCRIPT),
    "/structure.js": ("structure.js", SCRIPT),
    "/pens.js": ("pens.js", SCRIPT),
    "/shapes.js": ("shapes.js", SCRIPT),
    "/selection.js": ("selection.js", SCRIPT),
}
PLOTLY = "/plotly.js"


class Asset(NamedTuple):
    """A file as it is sent: gzip tells that `data` is compressed; lasting ones never change under their name."""

    data: bytes
    kind: str
    gzip: bool = False
    lasting: bool = False


class Assets:
    """The page's own files, read again for each request, and plotly.js of the installed package, packed once."""

    def __init__(self) -> None:
        self._plotly: Asset | None = None
        self._lock = threading.Lock()

    def get(self, path: str) -> Asset | None:
        """What stands under a path; None when nothing does. Raises OSError when a file of the package is gone."""
        if path == PLOTLY:
            return self._get_plotly()
        if path not in FILES:
            return None
        name, kind = FILES[path]
        return Asset((WEB / name).read_bytes(), kind)

    def _get_plotly(self) -> Asset:
        with self._lock:
            if self._plotly is None:
                from plotly.offline import get_plotlyjs

                packed = gzip.compress(get_plotlyjs().encode(), compresslevel=6, mtime=0)
                self._plotly = Asset(packed, SCRIPT, gzip=True, lasting=True)
            return self._plotly
