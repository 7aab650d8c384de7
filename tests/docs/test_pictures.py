# SPDX-License-Identifier: MIT
"""Pictures of the pages: each is shown somewhere, is made by tools/docs_pictures, is not empty, and there are many."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

from markdown_pages import ROOT, pages

IMAGES = ROOT / "docs" / "images"


def test_every_picture_is_shown_and_made() -> None:
    shown = {Path(name).name for page in pages() for name in re.findall(r"!\[[^\]]+\]\(([^)]+)\)", page.read_text())}
    here = {path.name for path in IMAGES.iterdir()}
    assert here == shown and len(here) >= 20
    source = "".join(path.read_text() for path in (ROOT / "tools" / "docs_pictures").glob("*.py"))
    assert all(f'"{name}"' in source for name in here), sorted(name for name in here if f'"{name}"' not in source)
    assert all(path.stat().st_size > 1000 for path in IMAGES.iterdir())


def test_drawings_come_out_as_they_stand(tmp_path: Path) -> None:
    """Those without numbers in them are the same bytes again."""
    code = f"""import pathlib
from docs_pictures import drawings, runs
runs.IMAGES = pathlib.Path({str(tmp_path)!r})
print(*drawings.make())"""
    done = subprocess.run([sys.executable, "-c", code], cwd=ROOT / "tools", capture_output=True, text=True, check=True)
    for name in done.stdout.split():
        assert (tmp_path / name).read_bytes() == (IMAGES / name).read_bytes(), f"{name}: make docs-pictures"
