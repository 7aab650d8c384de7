# SPDX-License-Identifier: MIT
"""The sketches of packaging/arduino on Cortex-M4 and M7 in QEMU: they send what they send here, and identify there.

tests/boards/test_board_library.py reads the packets back; here they are compared with those of this machine.
"""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import core_feed
import numpy as np
import pytest
import systems
from test_core import BUILD, MPS2, TARGETS, Target

EIGEN = ["-isystem", "/usr/include/eigen3"]
BARE = ["-fno-exceptions", "-fno-rtti", "-fno-threadsafe-statics", "-fno-use-cxa-atexit", "-ffunction-sections"]
MORE = ["-Wl,--gc-sections", "-Wl,--defsym=NODE_RAM_BYTES=96K", "-Wl,--defsym=NODE_STACK=8K"]


@pytest.fixture(scope="module")
def library() -> Path:
    it = BUILD.parent / "library"
    subprocess.run([sys.executable, core_feed.ROOT / "tools" / "amalgamate.py", it, "--boards"], check=True)
    core_feed.write_codes(it / "src")
    return it


def built(library: Path, name: str, target: Target | None) -> Path:
    """The image of a sketch for a processor, or (None) for this machine."""
    tools, cpu = ("", []) if target is None else (f"{target.tools}-", target.cpu)
    image = library / f"{name}-{target.name if target else 'here'}"
    boards = [core_feed.HERE / "board_host.c"] if target is None else MPS2[:2]
    sources = [library / "src" / "okid_core.c", *boards]
    objects = []
    for source in map(Path, map(str, sources)):
        objects.append(f"{image}-{source.stem}.o")
        compiler = [f"{tools}gcc", *cpu, "-Os", "-ffunction-sections", f"-I{core_feed.BOARDS}", f"-I{library / 'src'}"]
        subprocess.run([*compiler, "-c", source, "-o", objects[-1]], check=True)
    modes = [library / "src" / "okid_modes.cpp"] if name == "modes_node" else []
    link = (
        []
        if target is None
        else [*MORE, *[word for word in map(str, MPS2[2:]) if "RAM" not in word and "STACK" not in word]]
    )
    core_feed.sketch(library, name, [f"{tools}g++", *cpu, "-Os", *BARE, *EIGEN], image, *modes, *objects, *link)
    return image


def sent(library: Path, name: str, target: Target, count: int) -> bytes:
    """The first bytes that an image sends in QEMU."""
    qemu = ["-kernel", str(built(library, name, target)), "-display", "none", "-monitor", "none", "-serial", "stdio"]
    with subprocess.Popen([*target.emulator, *qemu], stdin=subprocess.DEVNULL, stdout=subprocess.PIPE) as machine:
        try:
            assert machine.stdout is not None
            return machine.stdout.read(count)
        finally:
            machine.kill()


@pytest.mark.xdist_group("sketches")
@pytest.mark.parametrize("target", TARGETS[:2], ids=lambda target: target.name)
def test_packets_are_those_of_this_machine(library: Path, target: Target) -> None:
    here = subprocess.run([built(library, "stream_node", None)], stdout=subprocess.PIPE, check=True).stdout
    assert len(here) > core_feed.SAMPLES * 8
    assert sent(library, "stream_node", target, len(here)) == here


@pytest.mark.xdist_group("sketches")
def test_modes_on_the_board_are_those_of_the_structure(library: Path) -> None:
    here = subprocess.run([built(library, "modes_node", None)], stdout=subprocess.PIPE, check=True).stdout
    assert sent(library, "modes_node", TARGETS[1], len(here)) == here
    found = np.array([[float(x) for x in re.findall(r"[\d.]+", line)] for line in here.decode().splitlines()])
    frequency, damping = systems.w1().modes()
    np.testing.assert_allclose(found[:, 0], frequency * systems.w1().dt * 1000, rtol=3e-4)
    np.testing.assert_allclose(found[:, 1], 100 * damping, rtol=0.03)


@pytest.mark.xdist_group("sketches")
def test_validators_of_the_frameworks_accept_the_manifests(library: Path) -> None:
    """PlatformIO's, ESP-IDF's and Kconfig's own readers, in a Python of their own (tools/setup.sh embedded)."""
    python = core_feed.ROOT / ".venv" / "boards" / "bin" / "python"
    subprocess.run([python, core_feed.ROOT / "tests" / "embedded" / "manifests.py", library], check=True)
