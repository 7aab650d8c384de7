# SPDX-License-Identifier: MIT
"""The library on other processors and in other projects gives the result of this machine.

tests/embedded/run builds what is run here ($OKID_EMBEDDED): a program against the installed library, with the flags of
pkg-config, with the library as a part of it, and for Arm boards.
"""

from __future__ import annotations

import json
import os
import re
import subprocess
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import systems

BUILD = Path(os.environ.get("OKID_EMBEDDED", "build-embedded")).resolve()
EMULATOR: dict[str, list[str]] = {
    "aarch64": ["qemu-aarch64", "-L", "/usr/aarch64-linux-gnu"],
    "armhf": ["qemu-arm", "-L", "/usr/arm-linux-gnueabihf"],
}
METHODS = {0: "okid-era", 1: "okid-era-dc", 2: "n4sid-moesp", 3: "n4sid-cva", 4: "n4sid-ssarx"}


@pytest.fixture(scope="module")
def codes(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """W1 with 1 % noise, 16-bit codes."""
    record = np.hstack(systems.record(systems.w1(), 10000, 1.0, 3))
    path = tmp_path_factory.mktemp("record") / "w1.codes"
    np.round(record / np.abs(record).max(axis=0) * 30000).astype("<i2").tofile(path)
    return path


def run(folder: str, codes: Path, method: int, program: str = "identify_codes") -> dict[str, Any]:
    """The result of the program built in a folder."""
    command = [*EMULATOR.get(folder, []), str(BUILD / folder / program), str(codes), "1", "3", "152.2", str(method)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    result: dict[str, Any] = json.loads(done.stdout)
    return result


def assert_equal(found: dict[str, Any], expected: dict[str, Any]) -> None:
    """1e-9: frequencies and damping each for itself, arrays relative to their largest entry."""
    assert found.keys() == expected.keys()
    assert (found["order"], found["rows"]) == (6, expected["rows"])
    assert len(found["frequency_hz"]) == 3
    for name in ("frequency_hz", "damping_ratio"):
        np.testing.assert_allclose(found[name], expected[name], rtol=1e-9, err_msg=name)
    for name in ("singular_values", "markov", "innovation", "mpc", "emac", "shape_re", "shape_im"):
        reference = np.asarray(expected[name])
        np.testing.assert_allclose(found[name], reference, atol=1e-9 * np.abs(reference).max(), rtol=0, err_msg=name)


@pytest.mark.parametrize("method", METHODS, ids=METHODS.get)
@pytest.mark.parametrize("board", EMULATOR)
def test_the_result_on_a_board_is_that_of_this_machine(board: str, method: int, codes: Path) -> None:
    found = run(board, codes, method)
    assert found["backend"] == "eigen"
    assert_equal(found, run("outside-package", codes, method))


def test_the_kernel_of_aarch64_is_neon() -> None:
    (kernel,) = (BUILD / "aarch64/okid/lib/CMakeFiles/okid_objects_main.dir").rglob("kernel.c.o")
    command = ["aarch64-linux-gnu-objdump", "-d", str(kernel)]
    listing = subprocess.run(command, capture_output=True, text=True, check=True).stdout
    vector = re.findall(r"\tfmla\tv\d+\.2d", listing)
    assert len(vector) >= 4 * 5, f"{len(vector)} vector multiply-adds in the kernel, expected those of a 5 x 4 tile"


def test_installed_library_shared_static_and_by_pkg_config_are_the_same(codes: Path) -> None:
    expected = run("outside-package", codes, 0)
    assert expected["backend"] == "lapacke"
    for folder, program in (
        ("outside-package", "identify_codes_static"),
        ("outside-pkgconfig", "identify_codes"),
        ("outside-pkgconfig", "identify_codes_static"),
    ):
        assert run(folder, codes, 0, program) == expected, f"{folder}/{program}"


@pytest.mark.parametrize("method", METHODS, ids=METHODS.get)
def test_as_a_part_of_another_project_it_needs_nothing_but_eigen(method: int, codes: Path) -> None:
    found = run("outside-fetch", codes, method)
    assert found["backend"] == "eigen"
    assert_equal(found, run("outside-package", codes, method))
    needed = subprocess.run(
        ["readelf", "-d", str(BUILD / "outside-fetch" / "identify_codes_static")],
        capture_output=True,
        text=True,
        check=True,
    ).stdout
    assert set(re.findall(r"Shared library: \[(\w+)", needed)) <= {"libc", "libm", "libstdc", "libgcc_s"}
