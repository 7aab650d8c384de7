# SPDX-License-Identifier: MIT
"""Every public header can be the first and only one a program includes, in C99 and in C++."""

from __future__ import annotations

import subprocess
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
FOLDERS = [ROOT / room / "include" for room in ("lib", "drivers", "firmware_host")]
HEADERS = sorted(str(path.relative_to(folder)) for folder in FOLDERS for path in folder.rglob("*.h"))


@pytest.mark.parametrize("language", [["-x", "c", "-std=c99"], ["-x", "c++", "-std=c++17"]], ids=["c", "c++"])
def test_each_stands_alone(language: list[str]) -> None:
    wrong, places = {}, [f"-I{folder}" for folder in FOLDERS]
    for header in HEADERS:
        done = subprocess.run(
            ["cc", *language, "-fsyntax-only", "-Wall", "-Wextra", "-Werror", *places, "-"],
            input=f"#include <{header}>\n", capture_output=True, text=True, check=False,
        )  # fmt: skip
        if done.returncode != 0:
            wrong[header] = done.stderr
    assert len(HEADERS) > 40 and not wrong, wrong
