# SPDX-License-Identifier: MIT
"""Hook of mkdocs: what Doxygen made of the C headers (build/docs/c) as part of the site, linked where it is named."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from mkdocs.structure.files import File

NAMED = "`build/docs/c`"


def on_files(files: Any, config: Any) -> Any:
    """The site with the folder c/ in it; made before by tools/docs.sh."""
    made = Path(config["site_dir"]).parent / "c"
    for path in sorted(made.rglob("*")):
        if path.is_file():
            name = f"c/{path.relative_to(made).as_posix()}"
            files.append(File.generated(config, name, abs_src_path=str(path)))
    return files


def on_page_markdown(markdown: str, page: Any, config: Any, files: Any) -> str:
    """The folder's name in reference/c-api.md as a link to its first page."""
    if page.file.src_uri != "reference/c-api.md":
        return markdown
    if NAMED not in markdown:
        raise ValueError(f"reference/c-api.md names no {NAMED}: nothing would lead to the pages of the headers")
    return markdown.replace(NAMED, "[every function, structure and macro](../c/index.html)")
