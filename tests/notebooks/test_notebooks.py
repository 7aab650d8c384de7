# SPDX-License-Identifier: MIT
"""The tutorial notebooks run from top to bottom, their own assertions hold, and they are committed without outputs."""

from __future__ import annotations

import json
import os
import pathlib

import pytest

ROOT = pathlib.Path(__file__).resolve().parents[2]
NOTEBOOKS = sorted((ROOT / "docs" / "notebooks").glob("*.ipynb"))


def test_there_are_notebooks() -> None:
    assert {path.stem for path in NOTEBOOKS} >= {"hammer_test", "shaker_test"}


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_runs(path: pathlib.Path, tmp_path: pathlib.Path) -> None:
    import nbformat  # seconds of import, which every process of the tier would pay
    from nbclient import NotebookClient

    book = nbformat.read(path, as_version=4)
    code = [cell for cell in book.cells if cell.cell_type == "code"]
    assert not any(cell.outputs or cell.execution_count for cell in code), "clear the outputs before a commit"
    assert sum("assert " in cell.source for cell in code) >= 3, "a notebook checks what it claims"
    client = NotebookClient(book, timeout=1800, resources={"metadata": {"path": str(tmp_path)}})
    client.execute(env={**os.environ, "PYTHONPATH": str(ROOT / "tools")})
    outputs = [output for cell in code for output in cell.outputs]
    assert all(output.output_type != "stream" or output.name != "stderr" for output in outputs), outputs
    kinds = [kind for output in outputs for kind in output.get("data", {})]
    assert kinds.count("image/png") >= 3 and kinds.count("text/html") >= 2


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_is_tidy(path: pathlib.Path) -> None:
    """No paths of the machine it was written on, one line a line of source, so that a change reads well."""
    text = path.read_text(encoding="utf-8")
    assert str(ROOT) not in text and "SPDX-License-Identifier" in text
    assert text == json.dumps(json.loads(text), indent=1, ensure_ascii=False) + "\n"
