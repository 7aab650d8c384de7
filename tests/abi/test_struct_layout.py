# SPDX-License-Identifier: MIT
"""The ctypes mirror in okid.abi equals the C headers: sizes, offsets, constants, functions and their arguments."""

from __future__ import annotations

import ctypes
import re
import shutil
import subprocess
from pathlib import Path

import pytest
from okid import abi
from okid.abi.shared_object import candidates

ROOT = Path(__file__).resolve().parents[2]
INCLUDE = ROOT / "lib" / "include"
CONSTANT_PREFIXES = (
    "OK",
    "WARN_",
    "ERR_",
    "SAMPLE_",
    "SUBSPACE_",
    "DETREND_",
    "METHOD_",
    "SOLVER_",
    "HANKEL_",
    "NOTE_",
    "SENSE_",
    "HOLD_",
    "HOLDS_",
    "MKR_",
)
CONSTANTS = {name: value for name, value in vars(abi).items() if name.startswith(CONSTANT_PREFIXES) and name.isupper()}
# C parameter type (without const, names and spaces) -> kinds of ctypes that may stand for it
SCALARS = {
    "int32_t": ctypes.c_int32,
    "int64_t": ctypes.c_int64,
    "uint32_t": ctypes.c_uint32,
    "size_t": ctypes.c_size_t,
    "double": ctypes.c_double,
    "okid_status_t": ctypes.c_int,
    "okid_detrend_t": ctypes.c_int,
}
POINTED = {
    "double": ctypes.c_double,
    "float": ctypes.c_float,
    "int32_t": ctypes.c_int32,
    "int16_t": ctypes.c_int16,
}


def headers_text() -> str:
    """All public headers without comments."""
    text = "\n".join(path.read_text(encoding="utf-8") for path in sorted((INCLUDE / "okid").rglob("*.h")))
    text = re.sub(r"\bokid_real_t\b", "double", text)  # what the shared library of hosts is built with
    return re.sub(r"//[^\n]*", "", re.sub(r"/\*.*?\*/", "", text, flags=re.S))


@pytest.fixture(scope="module")
def measured(tmp_path_factory: pytest.TempPathFactory) -> dict[str, int]:
    """sizeof, offsetof and constants as the C compiler sees them."""
    compiler = shutil.which("cc") or shutil.which("gcc") or shutil.which("clang")
    assert compiler is not None, "a C compiler is needed to check the ABI"
    folder = tmp_path_factory.mktemp("abi")
    lines = []
    for name, struct in abi.STRUCTS.items():
        lines.append(f'P("{name}", sizeof({name}));')
        for field, *_ in struct._fields_:
            lines.append(f'P("{name}.{field}", offsetof({name}, {field}));')
            lines.append(f'P("{name}.{field}.size", sizeof((({name}*)0)->{field}));')
    lines += [f'P("OKID_{name}", OKID_{name});' for name in CONSTANTS]
    headers = sorted(path.relative_to(INCLUDE) for path in (INCLUDE / "okid").rglob("*.h"))
    head = "".join(f"#include <{name}>\n" for name in [*headers, "stdio.h", "stddef.h"])
    head += '#define P(name, value) printf("%s %lld\\n", name, (long long)(value))\n'
    source = folder / "layout.c"
    source.write_text(head + "int main(void) {\n" + "\n".join(lines) + "\nreturn 0;\n}\n", encoding="utf-8")
    program = folder / "layout"
    subprocess.run(
        [compiler, "-std=c99", "-I", str(INCLUDE), str(source), "-o", str(program)], check=True, timeout=1800
    )
    shown = subprocess.run([str(program)], check=True, capture_output=True, text=True, timeout=1800).stdout
    return {name: int(value) for name, value in (line.split() for line in shown.splitlines())}


@pytest.mark.parametrize("name", sorted(abi.STRUCTS))
def test_struct_layout(measured: dict[str, int], name: str) -> None:
    struct = abi.STRUCTS[name]
    assert ctypes.sizeof(struct) == measured[name]
    for field, *_ in struct._fields_:
        place = getattr(struct, field)
        assert (place.offset, place.size) == (measured[f"{name}.{field}"], measured[f"{name}.{field}.size"]), field


def test_no_field_is_missing() -> None:
    text = headers_text()
    bodies = dict((name, body) for body, name in re.findall(r"typedef struct \w+ \{(.*?)\} (okid_\w+_t);", text, re.S))
    assert set(bodies) == set(abi.STRUCTS)
    for name, body in bodies.items():
        declared = [
            re.sub(r"[^\w]", "", piece.split()[-1])
            for line in body.split(";")
            for piece in line.split(",")
            if piece.strip()
        ]
        assert declared == [field for field, *_ in abi.STRUCTS[name]._fields_], name


def test_constants(measured: dict[str, int]) -> None:
    seen = {key: value for key, value in measured.items() if key.startswith("OKID_")}
    assert {f"OKID_{name}": value for name, value in CONSTANTS.items()} == seen


def test_every_constant_is_mirrored() -> None:
    enums = re.findall(r"enum(?: \w+)? \{(.*?)\}", headers_text(), re.S)
    names = {name for body in enums for name in re.findall(r"\b(OKID_[A-Z0-9_]+)\b\s*=", body)}
    assert names == {f"OKID_{name}" for name in CONSTANTS}


def declarations() -> dict[str, tuple[str, list[str]]]:
    found = re.findall(r"OKID_API\s+([\w\s*]+?)\s*\b(okid_\w+)\s*\(([^)]*)\)\s*;", headers_text())
    split = {name: (result, [a.strip() for a in arguments.split(",")]) for result, name, arguments in found}
    return {name: (result, [] if args == ["void"] else args) for name, (result, args) in split.items()}


def test_interface_and_version_are_those_of_the_headers() -> None:
    text = headers_text()
    assert int(re.findall(r"#define OKID_ABI (\d+)", text)[0]) == abi.ABI
    (version,) = re.findall(r'#define OKID_VERSION "(.+)"', text)
    parts = re.findall(r"#define OKID_VERSION_(?:MAJOR|MINOR|PATCH) (\d+)", text)
    project = (ROOT / "tools" / "pyproject.toml").read_text(encoding="utf-8")
    assert version == ".".join(parts) == abi.library().okid_version().decode()
    assert f'\nversion = "{version}"\n' in project


def test_what_makes_an_object_or_takes_arrays_alone_links_to_one_interface_only() -> None:
    linked = set(re.findall(r"#define (okid_\w+) OKID_LINKED\(", headers_text()))
    declared = declarations()
    takes_arrays = {
        name
        for name, (_, arguments) in declared.items()
        if not re.match(r"(const )?okid_\w+_t\* self", arguments[0] if arguments else "")
        and any(re.match(r"(const )?(double|okid_(model|records|run_sums)_t)\*", argument) for argument in arguments)
    }
    makes = {name for name in declared if name.endswith("_create")}
    assert linked == (makes | takes_arrays) - {"okid_model_workspace"} | {
        "okid_mechanics_continuous",
        "okid_mechanics_modes",
    }


@pytest.mark.parametrize(("name", "real"), [("okid_identify_create", "float"), ("okid_modal_analyse", "float")])
def test_a_library_of_another_number_type_does_not_link(tmp_path: Path, name: str, real: str) -> None:
    compiler = shutil.which("cc")
    assert compiler is not None
    source = tmp_path / "use.c"
    source.write_text(f"#include <okid/okid.h>\nint main(void) {{ return ((int (*)(void)){name})(); }}\n")
    command = [
        compiler,
        "-std=c99",
        "-w",
        "-I",
        str(INCLUDE),
        str(source),
        str(candidates("libokid.so", "OKID_LIBRARY")[-1]),
        "-o",
        str(tmp_path / "use"),
    ]
    subprocess.run(command, check=True, capture_output=True, timeout=1800)
    other = subprocess.run([*command, f"-DOKID_REAL={real}"], capture_output=True, text=True, timeout=1800)
    assert other.returncode != 0 and f"{name}_{abi.ABI}_{real}" in other.stderr


def test_every_function_is_bound() -> None:
    assert set(declarations()) == set(abi.SIGNATURES)
    for name in abi.SIGNATURES:
        assert getattr(abi.library(), name)


@pytest.mark.parametrize("name", sorted(abi.SIGNATURES))
def test_arguments(name: str) -> None:
    result, arguments = declarations()[name]
    bound_result, bound = abi.SIGNATURES[name]
    assert len(arguments) == len(bound)
    for text, kind in zip(arguments, bound, strict=True):
        plain = re.sub(r"\bconst\b|\b\w+$", "", text).replace(" ", "")
        if plain in SCALARS:
            assert kind is SCALARS[plain], text
        elif plain == "okid_method_t":
            assert kind is ctypes.c_int
        else:
            assert plain.endswith("*"), text
            target = plain.rstrip("*")
            if target in abi.STRUCTS:
                assert kind._type_ is abi.STRUCTS[target], text
            elif target in POINTED:
                assert kind._type_ is POINTED[target], text
            else:
                assert kind is ctypes.c_void_p or kind._type_ is ctypes.c_void_p, text
    plain_result = result.replace("const", "").replace(" ", "")
    expected_result = {"void": None, "char*": ctypes.c_char_p, "double*": abi.doubles, **SCALARS}[plain_result]
    assert bound_result is expected_result


def test_status_texts_differ() -> None:
    statuses = [v for k, v in CONSTANTS.items() if k.startswith(("OK", "WARN_", "ERR_"))]
    texts = [abi.status_text(status) for status in statuses]
    assert len(set(texts)) == len(texts)
    assert all(texts)
