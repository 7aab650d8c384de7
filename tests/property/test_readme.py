# SPDX-License-Identifier: MIT
"""The Python examples of README and tutorial run as they stand, and the files the documents name exist."""

import pathlib
import re

import numpy as np
import pytest

ROOT = pathlib.Path(__file__).resolve().parents[2]
DOCUMENTS = [ROOT / "README.md", *sorted((ROOT / "docs").glob("**/*.md"))]


def python_blocks(path: pathlib.Path) -> list[str]:
    return re.findall(r"```python\n(.*?)```", path.read_text(), re.DOTALL)


@pytest.mark.parametrize("path", [p for p in DOCUMENTS if python_blocks(p)], ids=lambda p: p.name)
def test_python_examples_run(path: pathlib.Path, capsys: pytest.CaptureFixture[str]) -> None:
    rng = np.random.default_rng(3)
    u = rng.standard_normal(4000)
    y = np.zeros((4000, 2))
    for n in range(2, 4000):
        y[n] = 1.9 * y[n - 1] - 0.98 * y[n - 2] + np.array([1.0, -0.5]) * u[n - 1]
    y += 0.01 * y.std() * rng.standard_normal(y.shape)
    for block in python_blocks(path):
        exec(compile(block, str(path), "exec"), {"u": u, "y": y})
    assert "Hz" in capsys.readouterr().out


@pytest.mark.parametrize("path", DOCUMENTS, ids=lambda p: p.name)
def test_links_lead_somewhere(path: pathlib.Path) -> None:
    for target in re.findall(r"\]\(([^)#]+)\)", path.read_text()):
        if not target.startswith("http"):
            assert (path.parent / target).exists(), f"{path.name}: {target} does not exist"


@pytest.mark.parametrize("path", DOCUMENTS, ids=lambda p: p.name)
def test_named_files_exist(path: pathlib.Path) -> None:
    for name in re.findall(r"`((?:lib|drivers|firmware_host|tools|tests|docs)/[\w./-]+\.\w+)`", path.read_text()):
        assert (ROOT / name).exists(), f"{path.name} names {name}, which does not exist"
