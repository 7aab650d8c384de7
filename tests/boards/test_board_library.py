# SPDX-License-Identifier: MIT
"""The library for boards that tools/amalgamate.py --boards writes: its parts name each other rightly, its sketches and
its Zephyr sample compile against stubs of their frameworks, okid's own decoder reads bit for bit what they send.

The stubs are written from the frameworks' references: that a framework itself compiles them is not checked here. COBS
is also taken apart by the package `cobs` and CRC-32 by zlib, which share nothing with okid.
"""

from __future__ import annotations

import json
import re
import struct
import subprocess
import sys
import zlib
from pathlib import Path
from xml.etree import ElementTree

import core_feed
import numpy as np
import pytest
import yaml
from cobs import cobs
from program import PROGRAM

ROOT, HERE = core_feed.ROOT, Path(__file__).resolve().parent
STRICT = ["-Wall", "-Wextra", "-Werror", "-O1"]


def run(*command: object, **more: object) -> bytes:
    return subprocess.run([str(word) for word in command], check=True, stdout=subprocess.PIPE, **more).stdout  # type: ignore[call-overload, no-any-return]


@pytest.fixture(scope="module")
def library(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The library with codes.h beside its sources, and board_host.o, core.o, read_back."""
    it = tmp_path_factory.mktemp("library")
    run(sys.executable, ROOT / "tools" / "amalgamate.py", it, "--boards", "https://example.org/okid")
    core_feed.write_codes(it / "src")
    run("gcc", "-c", "okid_core.c", core_feed.HERE / "board_host.c", f"-I{core_feed.BOARDS}", cwd=it / "src")
    drivers = [path for path in sorted((ROOT / "drivers" / "src").glob("*.c")) if "gpiod" not in path.name]
    include = f"-I{ROOT}/drivers/include"
    run("gcc", "-D_GNU_SOURCE", include, HERE / "read_back.c", *drivers, "-lm", "-o", it / "read_back")
    return it


def test_readme_names_what_the_folder_has(library: Path) -> None:
    text = (library / "README.md").read_text("utf-8")
    assert "@VERSION@" not in text
    for name in ("src/okid_core.c", "src/okid_modes.cpp", "examples/", "samples/"):
        assert f"`{name}`" in text
        assert (library / name).exists()


def test_every_declared_function_links(library: Path) -> None:
    """Those of both headers, as the compiler lists them, from one program with both sources."""
    src = library / "src"
    (src / "seen.c").write_text('#include "okid_core.h"\n#include "okid_modes.h"\n')
    run("gcc", "-aux-info", "seen.txt", "-fsyntax-only", "seen.c", cwd=src)
    listed = re.findall(r"^/\* okid_\w+\.h:\S+ \*/ extern .*?\b(\w+) \(", (src / "seen.txt").read_text(), re.M)
    named = {re.sub(r"_\d+_double$", "", name) for name in listed}
    assert {"okid_accumulator_add", "drv_stream_encode_floats", "okid_modal_analyse"} < named and len(named) > 60
    assert not any(name.startswith(("okid_identify_", "okid_square_root_", "okid_subspace_")) for name in named)
    includes = '#include "okid_core.h"\n#include "okid_modes.h"\n'
    addresses = ", ".join(f"(void *){name}" for name in sorted(named))
    (src / "all.c").write_text(f"{includes}void *all[] = {{{addresses}}};\nint main(void) {{ return all[0] == 0; }}\n")
    run("gcc", "-c", "all.c", cwd=src)
    run("g++", "-std=c++17", "-w", "-O0", "-I/usr/include/eigen3", "-c", "okid_modes.cpp", cwd=src)
    run("g++", "all.o", "okid_core.o", "okid_modes.o", "-lm", "-o", "all", cwd=src)


def sketch(library: Path, name: str, *more: object) -> bytes:
    """What a sketch sends over the record."""
    objects = [library / "src" / f"{part}.o" for part in ("okid_core", "board_host")]
    core_feed.sketch(library, name, ["g++", "-O1"], image := library / name, *objects, *more)
    return run(image)


def test_packets_of_the_sketch_are_the_codes_by_two_decoders(library: Path) -> None:
    sent, codes = sketch(library, "stream_node"), core_feed.w1(core_feed.SAMPLES)
    rows = np.array([line.split() for line in run(library / "read_back", input=sent).decode().splitlines()], dtype=int)
    count = core_feed.SAMPLES // 8 * 8
    np.testing.assert_array_equal(rows[:, 0], np.arange(count))
    np.testing.assert_array_equal(rows[:, 2:], codes[:count])
    assert set(np.diff(rows[8::8, 1])) == {8000}
    plain = [cobs.decode(part) for part in sent.split(b"\0")[:-1]]
    assert all(zlib.crc32(p[:-4]) == struct.unpack("<I", p[-4:])[0] for p in plain)
    np.testing.assert_array_equal(np.frombuffer(b"".join(p[12:-4] for p in plain), "<i2").reshape(-1, 4), codes[:count])


def test_frames_of_the_sketch_are_the_codes_by_the_dbc(library: Path) -> None:
    (library / "can.log").write_bytes(sketch(library, "stream_node", "-DNODE_CAN"))
    dbc = ROOT / "drivers" / "proto" / "okid.dbc"
    config = '[acquisition]\nrate_hz = 1000.0\n[[bus]]\nname = "can0"\ntype = "socketcan"\n'
    config += f'interface = "can0"\ndbc = "{dbc}"\n'
    for k, (role, unit, message, signal) in enumerate(
        [
            ("force", "N", "OKID_Force", "Force1"),
            *(("acceleration", "m/s^2", "OKID_Accel1", f"Accel{k}") for k in (1, 2, 3)),
        ]
    ):
        config += (
            f'[[channel]]\nname = "{signal}"\nrole = "{role}"\nunit = "{unit}"\nbus = "can0"\nmessage = "{message}"\n'
        )
        config += f'signal = "{signal}"\nsequence = "Counter"\ndof = {max(k, 1)}\n'
    (library / "node.toml").write_text(config)
    run(PROGRAM, "convert", "can.log", "can.csv", "-c", "node.toml", cwd=library)
    table = np.loadtxt(library / "can.csv", delimiter=",", skiprows=3, usecols=(-4, -3, -2, -1))
    codes = np.round(table / [0.01, 0.005, 0.005, 0.005]).astype(int)
    np.testing.assert_array_equal(codes, core_feed.w1(core_feed.SAMPLES)[: len(codes)])
    assert len(codes) >= core_feed.SAMPLES - 1  # the last sample may wait for the next one


def test_zephyr_sample_streams_the_codes_and_tells_missed_ticks(library: Path) -> None:
    source, image = library / "samples" / "stream" / "src" / "main.c", library / "zephyr_sample"
    run("gcc", "-std=c11", *STRICT, "-I.", f"-I{HERE / 'stubs'}", source, "okid_core.o", "-lm", "-o", image,
        cwd=library / "src")  # fmt: skip
    lines = run(library / "read_back", input=run(image)).decode().splitlines()
    got = {int(number): tuple(map(int, codes)) for number, _, *codes in map(str.split, lines)}
    late = (1003, 1604)  # stubs/zephyr/kernel.h; what waited for its packet then is dropped
    numbers = [k + sum(k >= at for at in late) for k in range(core_feed.SAMPLES)]
    dropped = {1000, 1001, 1002, 1603, *range(core_feed.SAMPLES - 5, core_feed.SAMPLES)}
    codes = core_feed.w1(core_feed.SAMPLES).tolist()
    assert got == {number: tuple(codes[k]) for k, number in enumerate(numbers) if k not in dropped}


def test_manifests_agree_and_name_files_that_are_there(library: Path) -> None:
    version = re.search(r'OKID_VERSION "(.*)"', (library / "src" / "okid_core.h").read_text())[1]  # type: ignore[index]
    assert not [path for path in library.rglob("*") if path.is_file() and b"@VERSION@" in path.read_bytes()]
    properties = dict(line.split("=", 1) for line in (library / "library.properties").read_text().splitlines())
    described = json.loads((library / "library.json").read_text())
    component = yaml.safe_load((library / "idf_component.yml").read_text())
    pack = ElementTree.parse(library / "okid.okid.pdsc")
    release = pack.find("releases/release")
    assert release is not None
    assert {properties["version"], described["version"], component["version"], release.get("version")} == {version}
    assert pack.findtext("url") == properties["url"] == "https://example.org/okid"
    named = [*described["headers"], properties["includes"]]
    files = [f"src/{name}" for name in named] + [file.get("name") for file in pack.iter("file")]
    module = yaml.safe_load((library / "zephyr" / "module.yml").read_text())
    files += [f"{module['build']['cmake']}/CMakeLists.txt", module["build"]["kconfig"], pack.findtext("license")]
    files += [f"{sample}/stream/sample.yaml" for sample in module["samples"]]
    assert [name for name in files if not (library / str(name)).is_file()] == []


@pytest.mark.parametrize("file", ["CMakeLists.txt", "zephyr/CMakeLists.txt"])
def test_build_files_of_frameworks_name_their_sources(library: Path, file: str) -> None:
    """Both are run by CMake with the framework's functions in its place, which say what they were given."""
    names = ["idf_component_register", "zephyr_include_directories", "zephyr_compile_definitions",
             "zephyr_library_named", "zephyr_library_sources", "zephyr_library_include_directories"]  # fmt: skip
    functions = "".join(f'function({name})\n  message("{name} ${{ARGV}}")\nendfunction()\n' for name in names)
    settings = (
        'set(CONFIG_OKID y)\nset(CONFIG_OKID_MODES y)\nset(CONFIG_OKID_FLOAT y)\nset(CONFIG_OKID_EIGEN "/eigen")\n'
    )
    script = library / "framework.cmake"
    script.write_text(f"{functions}{settings}include({library / file})\n")
    said = run("cmake", "-P", script, stderr=subprocess.STDOUT).decode()
    sources = re.findall(r"[\w/.-]+\.c(?:pp)?\b", said)
    assert all((library / source).is_file() or Path(source).is_file() for source in sources), said
    expected = {"okid_core.c"} if file == "CMakeLists.txt" else {"okid_core.c", "okid_modes.cpp"}
    assert {Path(source).name for source in sources} == expected
    assert file == "CMakeLists.txt" or "zephyr_compile_definitions OKID_REAL=float" in said


def test_without_eigen_the_modes_are_left_out_with_a_warning(library: Path) -> None:
    told = subprocess.run(["g++", "-std=c++17", "-fsyntax-only", "okid_modes.cpp"], cwd=library / "src",
                          capture_output=True, text=True, check=True)  # fmt: skip
    assert "Eigen/Core is not in the include path" in told.stderr
