# SPDX-License-Identifier: MIT
"""okid_core.c of tools/amalgamate.py on three emulated processors and by clang here: the library's states, bit for bit.

Sizes and instructions are kept for table.py; QEMU counts instructions, the picolibc of RISC-V starts its image.
"""

from __future__ import annotations

import json
import os
import shutil
import subprocess
from dataclasses import dataclass
from pathlib import Path

import core_feed
import pytest

BUILD = Path(os.environ.get("OKID_EMBEDDED", "build-embedded")).resolve() / "core"
STRICT = ["-std=c11", "-ffunction-sections", "-fdata-sections", "-Wall", "-Wextra", "-Werror"]
NODE = ["-nostartfiles", "-nodefaultlibs", f"-T{core_feed.BOARDS / 'node.ld'}", "-Wl,--defsym=NODE_FLASH=0",
        "-Wl,--defsym=NODE_FLASH_BYTES=128K", "-Wl,--defsym=NODE_RAM_BYTES=64K", "-Wl,--defsym=NODE_STACK=4K",
        "-Wl,--start-group", "-lm", "-lc_nano", "-lgcc", "-Wl,--end-group"]  # fmt: skip
VIRT = ["-Tpicolibc.ld", "-Wl,--defsym=__flash=0x80000000,--defsym=__flash_size=0x20000,--defsym=__ram=0x80100000",
        "-Wl,--defsym=__ram_size=0x10000,--defsym=__stack_size=0x1000", "-lm"]  # fmt: skip


@dataclass(frozen=True)
class Target:
    """A processor, its compiler and the machine that runs its image."""

    name: str
    tools: str
    cpu: list[str]
    emulator: list[str]
    image: list[object]  ## what the image has beside feed.c and okid_core.c


MPS2 = [core_feed.BOARDS / "board_mps2.c", core_feed.BOARDS / "startup.c", *NODE]
TARGETS = [
    Target("Cortex-M4", "arm-none-eabi", ["-mcpu=cortex-m4", "-mthumb", "-mfloat-abi=hard", "-mfpu=fpv4-sp-d16"],
           ["qemu-system-arm", "-M", "mps2-an386"], MPS2),
    Target("Cortex-M7", "arm-none-eabi", ["-mcpu=cortex-m7", "-mthumb", "-mfloat-abi=hard", "-mfpu=fpv5-d16"],
           ["qemu-system-arm", "-M", "mps2-an500"], MPS2),
    Target("RV32IMAC", "riscv64-unknown-elf", ["--specs=picolibc.specs", "-march=rv32imac", "-mabi=ilp32"],
           ["qemu-system-riscv32", "-M", "virt", "-bios", "none"], [core_feed.HERE / "board_virt.c", *VIRT]),
]  # fmt: skip


@pytest.fixture(scope="module")
def folder() -> Path:
    core_feed.generate(BUILD)
    return BUILD


def lines(command: list[str]) -> str:
    """What an image writes up to its last line; it ends with the emulator."""
    with subprocess.Popen(command, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, text=True) as machine:
        try:
            assert machine.stdout is not None
            return "".join(iter(machine.stdout.readline, "end\n"))
        finally:
            machine.kill()


def text_bytes(target: Target, file: Path) -> int:
    shown = subprocess.run([f"{target.tools}-size", file], capture_output=True, text=True, check=True).stdout
    return int(shown.splitlines()[1].split()[0])


@pytest.mark.xdist_group("core")
@pytest.mark.parametrize("target", TARGETS, ids=lambda target: target.name)
def test_sums_are_those_of_the_library_to_the_last_bit(target: Target, folder: Path) -> None:
    kept = {}
    for optimise in ("-Os", "-O2"):
        compiler = [f"{target.tools}-gcc", *target.cpu, optimise, *STRICT]
        image = folder / f"{target.name}{optimise}.elf"
        core_feed.compile(compiler, folder, image, *target.image, "-Wl,--gc-sections")
        qemu = ["-kernel", str(image), "-icount", "shift=0", "-display", "none", "-monitor", "none", "-serial", "stdio"]
        states, instructions = core_feed.read(lines([*target.emulator, *qemu]))
        assert states == core_feed.expected()
        subprocess.run([*compiler, "-c", "okid_core.c", "-o", image.with_suffix(".o")], cwd=folder, check=True)
        used = text_bytes(target, image) - 8 * core_feed.SAMPLES
        kept[optimise] = {"whole": text_bytes(target, image.with_suffix(".o")), "used": used, **instructions}
    (folder / f"{target.name}.json").write_text(json.dumps(kept))


@pytest.mark.xdist_group("core")
def test_clang_compiles_it_without_a_warning_to_the_same_states(folder: Path) -> None:
    clang = shutil.which("clang-14") or shutil.which("clang")
    assert clang, "no clang: tools/setup.sh embedded"
    host = [core_feed.HERE / "board_host.c", "-lm"]
    core_feed.compile([clang, "-O2", "-pedantic", *STRICT], folder, folder / "feed", *host)
    shown = subprocess.run([folder / "feed"], capture_output=True, text=True, check=True).stdout
    assert core_feed.read(shown)[0] == core_feed.expected()
