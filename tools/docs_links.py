# SPDX-License-Identifier: MIT
"""Hook of mkdocs: links that a code host follows and a site of docs/ cannot (files outside it, folders) become text."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

LINK = re.compile(r"(?<!!)\[([^\]]+)\]\(([^)\s#:]+)(#[^)\s]*)?\)")


def on_page_markdown(markdown: str, page: Any, config: Any, files: Any) -> str:
    """The page with such links as their words; fenced blocks stay as they are."""
    root = Path(config["docs_dir"]).resolve()
    folder = (root / page.file.src_uri).parent

    def kept(link: re.Match[str]) -> str:
        target = (folder / link[2]).resolve()
        follows = target.is_file() and target.is_relative_to(root)
        return link[0] if follows or not target.exists() else link[1]  # one that leads nowhere is for mkdocs to refuse

    parts = re.split(r"(?m)(^```.*?^```$)", markdown, flags=re.DOTALL)
    return "".join(part if part.startswith("```") else LINK.sub(kept, part) for part in parts)
