# SPDX-License-Identifier: MIT
"""The Python examples of README and tutorial run as they stand, and the files the documents name exist."""

import pathlib
import re

import numpy as np
import okid
import pytest

ROOT = pathlib.Path(__file__).resolve().parents[2]
DOCUMENTS = [ROOT / "README.md", *sorted((ROOT / "docs").glob("**/*.md"))]


def python_blocks(path: pathlib.Path) -> list[str]:
    """Those that no other test runs: it would be named in the line above."""
    found = re.findall(r"([^\n]*)\n+```python\n(.*?)```", path.read_text(), re.DOTALL)
    return [block for before, block in found if "is run by `tests/" not in before]


@pytest.mark.parametrize("path", [p for p in DOCUMENTS if python_blocks(p)], ids=lambda p: p.name)
def test_python_examples_run(
    path: pathlib.Path, capsys: pytest.CaptureFixture[str], tmp_path: pathlib.Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """With u and y of a simulated record at hand, and the same as run.mf4."""
    monkeypatch.chdir(tmp_path)
    rng = np.random.default_rng(3)
    u = rng.standard_normal(4000)
    y = np.zeros((4000, 2))
    for n in range(2, 4000):
        y[n] = 1.9 * y[n - 1] - 0.98 * y[n - 2] + np.array([1.0, -0.5]) * u[n - 1]
    y += 0.01 * y.std() * rng.standard_normal(y.shape)
    names, units = ["force1", "acc1", "acc2"], ["N", "m/s^2", "m/s^2"]
    okid.write_mdf4("run.mf4", okid.Record(names, np.column_stack([u, y]), 250.0, units=units))
    for block in python_blocks(path):
        exec(compile(block, str(path), "exec"), {"u": u, "y": y})
    said = capsys.readouterr().out
    assert ("Hz" in said) == (path.name not in ("formats.md", "virtual-sensors.md")) == ("m/s^2" not in said)


@pytest.mark.parametrize("path", DOCUMENTS, ids=lambda p: p.name)
def test_links_lead_somewhere(path: pathlib.Path) -> None:
    for target in re.findall(r"\]\(([^)#]+)\)", path.read_text()):
        if not target.startswith("http"):
            assert (path.parent / target).exists(), f"{path.name}: {target} does not exist"


@pytest.mark.parametrize("path", DOCUMENTS, ids=lambda p: p.name)
def test_named_files_exist(path: pathlib.Path) -> None:
    for name in re.findall(r"`((?:lib|drivers|firmware_host|tools|tests|docs)/[\w./-]+\.\w+)`", path.read_text()):
        assert (ROOT / name).exists(), f"{path.name} names {name}, which does not exist"
