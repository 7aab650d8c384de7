# SPDX-License-Identifier: MIT
"""What tools/bindings.py writes, used: the crate okid-sys by cargo without a network, okid_identify in GNU Octave.

The mode in both is chosen and simulated in the language itself, so nothing of okid's own simulation is shared. okid.jl,
written from the tables of the Python package, is held to the crate, which bindgen reads in the C headers.
"""

from __future__ import annotations

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest
from program import PROGRAM

ROOT = Path(__file__).resolve().parents[2]
BUILD = Path(PROGRAM).parent
INCLUDE = [f"-I{ROOT / part}" for part in ("lib/include", "firmware_host/include", "drivers/include")]
RECORD = """
rand ('seed', 3); n = 4000; fs = 100; f = 12.5; zeta = 0.02;
w = 2 * pi * f / fs; r = exp (-zeta * w); u = 2 * rand (n, 1) - 1;
y = filter ([0 1], [1, -2 * r * cos(w * sqrt (1 - zeta^2)), r^2], u) + 1e-3 * (2 * rand (n, 1) - 1);
"""
C = {"c_int": "i32", "c_uint": "u32", "usize": "u64", "isize": "i64"}  # on 64-bit systems
JULIA = {"Int32": "i32", "UInt32": "u32", "Int64": "i64", "Csize_t": "u64", "Float64": "f64", "Float32": "f32",
         "Int16": "i16", "Cstring": "*c_char"}  # fmt: skip


@pytest.fixture(scope="module")
def written(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("bindings")
    subprocess.run([sys.executable, ROOT / "tools" / "bindings.py", folder], check=True)
    matlab = folder / "matlab"
    library = [f"-L{BUILD}", "-lokid_host", f"-Wl,-rpath,{BUILD}"]
    subprocess.run(["mkoctfile", "--mex", "-Wall", "-Werror", *INCLUDE, "okid_identify_mex.c", *library,
                    "-o", "okid_identify_mex.mex"], cwd=matlab, check=True)  # fmt: skip
    return folder


def octave(written: Path, script: str) -> str:
    command = ["octave-cli", "--norc", "--quiet", "--eval", RECORD + script]
    return subprocess.run(command, cwd=written / "matlab", capture_output=True, text=True, check=True).stdout


def test_rust_finds_a_mode_by_both_libraries(written: Path) -> None:
    crate = written / "rust" / "okid-sys"
    environment = {**os.environ, "OKID_LIB_DIR": str(BUILD), "CARGO_TARGET_DIR": str(written / "target")}
    run = subprocess.run(["cargo", "test", "--offline"], cwd=crate, env=environment,
                         capture_output=True, text=True)  # fmt: skip
    assert run.returncode == 0, run.stderr + run.stdout
    assert "test result: ok. 2 passed" in run.stdout
    assert "warning" not in run.stderr


def test_octave_finds_a_mode(written: Path) -> None:
    shown = octave(written, """
        q = okid_identify (u, y, fs, struct ('method', 'okid-era', 'order', 2));
        printf ("%d %.9f %.9f %s\\n", numel (q.modes), q.modes(1).frequency_hz, q.modes(1).damping_ratio, q.schema);
        """)  # fmt: skip
    count, frequency, damping, schema = shown.split()
    assert (count, schema) == ("1", "okid.result/1")
    assert float(frequency) == pytest.approx(12.5, rel=1e-5)
    assert float(damping) == pytest.approx(0.02, rel=1e-3)


@pytest.mark.parametrize(
    ("call", "text"),
    [
        ("okid_identify (u(1:10), y, fs)", "inputs have 10 samples, outputs 4000: expected as many"),
        ("okid_identify (u, y, -1)", 'fs: found "-1", expected a sample rate in Hz above 0'),
        ("okid_identify (u * 0, y, fs)", "constant"),
        ("okid_identify_mex (1, u, y)", "expected text and two real matrices"),
    ],
)
def test_octave_says_what_is_wrong_and_goes_on(written: Path, call: str, text: str) -> None:
    shown = octave(written, f"try, {call}, catch e, disp (e.message), end; q = okid_identify (u, y, fs); disp ('on')")
    assert text in shown
    assert shown.rstrip().endswith("on")


@pytest.fixture(scope="module")
def texts(written: Path) -> tuple[str, str]:
    return (written / "rust/okid-sys/src/lib.rs").read_text(), (written / "julia/okid.jl").read_text()


def plain(rust: str, kind: str) -> str:
    """A kind of the crate without its aliases; enumerations, unsigned there, are the int32 that C passes."""
    kind = kind.removeprefix("::std::os::raw::")
    if kind.startswith("*"):
        return "*" + plain(rust, kind.split(" ", 1)[1])
    alias = re.search(rf"pub type {kind} = ([^;]+)", rust) if kind.startswith("okid_") else None
    if alias:
        return "i32" if alias[1].endswith("c_uint") else plain(rust, alias[1])
    return "*function" if kind.startswith("::std::option::Option<") else C.get(kind, kind)


def fits(rust: str, kind: str, julia: str) -> bool:
    """Ptr{Cvoid} is a pointer to whatever, Cstring text that nobody writes to; all else must be of the same kind."""
    array = re.fullmatch(r"\[(.+); (\d+)usize\]", kind)
    if array:
        inner = julia.removeprefix(f"NTuple{{{array[2]}, ")
        return inner != julia and fits(rust, array[1], inner.removesuffix("}"))
    bare = plain(rust, kind)
    if julia.startswith("Ptr{") and bare.startswith("*"):
        return julia == "Ptr{Cvoid}" or fits(rust, kind.split(" ", 1)[1], julia[4:-1])
    return bare == JULIA.get(julia, plain(rust, julia)) and (julia != "Cstring" or kind.startswith("*const"))


def test_functions_take_and_give_what_the_headers_say(texts: tuple[str, str]) -> None:
    rust, julia = texts
    found = re.findall(r"pub fn (okid_\w+)\((.*?)\)(?:\s*-> ([^;]+))?;", rust, re.S)
    declared = {name: ([one.split(": ")[1] for one in re.findall(r"\w+: [^,]+", taken)], result)
                for name, taken, result in found}  # fmt: skip
    calls = re.findall(r"^(okid_\w+)\(.*?\) = ccall\(\(:\w+, lib\w+\), (\S+), \((.*?)\)", julia, re.M)
    assert {name for name, *_ in calls} == set(declared)
    assert len(calls) == len(declared) > 200
    for name, result, taken in calls:
        arguments, expected = declared[name]
        kinds = re.findall(r"[^\s,{]+(?:\{.*?\}+)?(?=, )", taken)
        assert len(kinds) == len(arguments), name
        for argument, kind in zip(arguments, kinds, strict=True):
            assert fits(rust, argument, kind), f"{name}: {argument}, in Julia {kind}"
        assert fits(rust, expected.strip(), result) if expected else result == "Cvoid", name


def test_fields_and_constants_are_those_of_the_headers(texts: tuple[str, str]) -> None:
    rust, julia = texts
    structs = re.findall(r"^struct (\w+)\n(.*?)^end", julia, re.M | re.S)
    assert len(structs) > 30
    for name, body in structs:
        alias = re.search(rf"pub type {name} = (\w+);", rust)
        declared = re.search(rf"pub struct {alias[1] if alias else name} \{{(.*?)\n\}}", rust, re.S)
        assert declared, name
        expected = re.findall(r"pub (\w+?)_?: (.+),", declared[1])
        fields = re.findall(r"(\w+)::(.+)", body)
        assert [field for field, _ in fields] == [field for field, _ in expected], name
        for (field, kind), (_, theirs) in zip(fields, expected, strict=True):
            assert fits(rust, theirs, kind), f"{name}.{field}: {theirs}, in Julia {kind}"
    constants = re.findall(r"^const (OKID_\w+) = Int32\((-?\d+)\)", julia, re.M)
    assert len(constants) > 60
    assert set(constants) <= set(re.findall(r"pub const (OKID_\w+): \w+ = (-?\d+);", rust))


def test_every_linked_name_is_exported(texts: tuple[str, str]) -> None:
    rust, julia = texts
    libraries = [BUILD / "libokid.so", BUILD / "libokid_host.so"]
    shown = subprocess.run(["nm", "-D", "--defined-only", *libraries], check=True, capture_output=True, text=True)
    exported = set(re.findall(r" T (okid_\w+)", shown.stdout))
    linked = {name or plain for name, plain in re.findall(r'(?:link_name = "(\w+)"\]\s+)?pub fn (okid_\w+)\(', rust)}
    assert linked - exported == set()
    assert linked == set(re.findall(r"ccall\(\(:(\w+),", julia))
