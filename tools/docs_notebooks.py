# SPDX-License-Identifier: MIT
"""Hook of mkdocs: each of docs/notebooks is a page, run when the pages are made, with the outputs of its cells.

Without the library of okid (`make build`) the cells stand alone, and a line says so.
"""

from __future__ import annotations

import re
import tempfile
from pathlib import Path
from typing import Any

import nbformat
from mkdocs.structure.files import File

ROOT = Path(__file__).resolve().parents[1]


def executed(path: Path) -> Any:
    """The notebook with outputs; without the library as it is in the tree."""
    notebook = nbformat.read(path, 4)
    if (ROOT / "build" / "libokid_host.so").exists():
        from nbclient import NotebookClient

        with tempfile.TemporaryDirectory() as folder:  # a notebook may write files
            NotebookClient(notebook, timeout=300, resources={"metadata": {"path": folder}}).execute()
    return notebook


def shown(output: Any) -> str:
    """One output of a cell as Markdown: a picture, a table of the package, or text."""
    data = output.get("data", {})
    if "image/svg+xml" in data:
        return f'\n<div class="formula">{data["image/svg+xml"]}</div>\n'
    if "image/png" in data:
        return f'\n<img alt="output of the cell" src="data:image/png;base64,{data["image/png"].strip()}">\n'
    if "text/html" in data:
        return "\n" + re.sub(r"\n\s*\n", "\n", data["text/html"]) + "\n"
    text = data.get("text/plain") or output.get("text") or "\n".join(output.get("traceback", []))
    return f"\n```text\n{text.rstrip()}\n```\n" if text.strip() else ""


def page_of(notebook: Any) -> str:
    """The notebook as a page."""
    parts = []
    for cell in notebook.cells:
        if cell.cell_type == "markdown":
            parts.append(cell.source)
        elif cell.source.strip():
            parts.append(f"```python\n{cell.source}\n```\n" + "".join(map(shown, cell.get("outputs", []))))
    if not any(cell.get("outputs") for cell in notebook.cells):
        parts.insert(1, "*Made without `make build`: the outputs of the cells are missing.*")
    return "\n\n".join(parts) + "\n"


def on_files(files: Any, config: Any) -> Any:
    """A page beside each notebook, under its name."""
    for path in sorted((Path(config["docs_dir"]) / "notebooks").glob("*.ipynb")):
        files.append(File.generated(config, f"notebooks/{path.stem}.md", content=page_of(executed(path))))
    return files


def on_page_markdown(markdown: str, page: Any, config: Any, files: Any) -> str:
    """Links to a notebook lead to its page."""
    return re.sub(r"(\]\([^)\s]*notebooks/[\w-]+)\.ipynb(?=[)#])", r"\1.md", markdown)
