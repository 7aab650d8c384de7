#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""The C interface of libokid and libokid_host for other languages: the crate okid-sys (Rust), okid.jl (Julia), and the
function okid_identify for MATLAB and GNU Octave.

usage: bindings.py FOLDER     with the package okid importable; the crate needs bindgen and rustfmt

The crate is what bindgen reads in the C headers; Julia's functions, structs and constants are those of okid.abi, the
package's own. tests/languages holds one to the other.
"""

from __future__ import annotations

import ctypes
import re
import subprocess
import sys
from pathlib import Path
from typing import Any

from okid import abi
from okid.abi import host, layout, signatures

ROOT = Path(__file__).resolve().parents[1]
INCLUDE = [ROOT / part / "include" for part in ("lib", "firmware_host", "drivers")]
HEADERS = "".join(path.read_text("utf-8") for path in sorted(INCLUDE[0].rglob("*.h")))
LINKED = set(re.findall(r"#define (okid_\w+) OKID_LINKED\(", HEADERS))
CONSTANT = re.compile(r"\bOKID_[A-Z0-9_]+\b")
MADE = """{0} SPDX-License-Identifier: MIT
{1} The C interface of libokid and libokid_host, made by tools/bindings.py, for 64-bit systems. What the functions do
{1} and which pointers may be null stands in okid/okid.h and okid_host.h."""
BINDGEN = ["bindgen", "--allowlist-function=okid_.*", "--allowlist-type=okid_.*", "--allowlist-var=OKID_.*",
           "--blocklist-type=__.*", "--default-macro-constant-type=signed", "--no-prepend-enum-name"]  # fmt: skip
JULIA = {"c_byte": "Int8", "c_short": "Int16", "c_int": "Int32", "c_uint": "UInt32", "c_long": "Int64",
         "c_ulong": "Csize_t", "c_double": "Float64", "c_float": "Float32", "c_char_p": "Cstring",
         "c_void_p": "Ptr{Cvoid}"}  # fmt: skip


def c_name(struct: type[ctypes.Structure]) -> str:
    """okid_..._t, with which its description begins."""
    found = re.match(r"okid_\w+", struct.__doc__ or "")
    if not found:
        raise SystemExit(f"bindings: {struct.__name__}: its description does not begin with the C name")
    return found[0]


def is_struct(kind: Any) -> bool:
    return isinstance(kind, type) and issubclass(kind, ctypes.Structure)


def julia(kind: Any) -> str:
    if is_struct(kind):
        return c_name(kind)
    if hasattr(kind, "_length_"):
        return f"NTuple{{{kind._length_}, {julia(kind._type_)}}}"
    return JULIA.get(kind.__name__) or f"Ptr{{{julia(kind._type_)}}}"


def structs() -> list[type[ctypes.Structure]]:
    """Every struct that a function takes, those it holds before it."""
    out: list[type[ctypes.Structure]] = []

    def visit(kind: Any) -> None:
        if is_struct(kind) and kind not in out:
            for _, part, *_ in kind._fields_:
                visit(part)
            out.append(kind)
        elif not isinstance(getattr(kind, "_type_", ""), str):  # a pointer, an array
            visit(kind._type_)

    for table in (signatures.SIGNATURES, host.SIGNATURES):
        for result, arguments in table.values():
            for kind in (result, *arguments):
                visit(kind)
    return out


def functions() -> list[tuple[str, str, str, Any, list[Any]]]:
    """Library, name, linked name, result and arguments of every function."""
    rows = [("okid", name, f"{name}_{abi.ABI}_double" if name in LINKED else name, *signature)
            for name, signature in signatures.SIGNATURES.items()]  # fmt: skip
    return rows + [("okid_host", name, name, *signature) for name, signature in host.SIGNATURES.items()]


def constants() -> dict[str, int]:
    """Those of the headers that okid.abi has, and the number of the host's interface."""
    mirrored = {f"OKID_{name}": value for name, value in vars(layout).items() if isinstance(value, int)}
    known = {name: mirrored[name] for name in dict.fromkeys(CONSTANT.findall(HEADERS)) if name in mirrored}
    return {**known, "OKID_HOST_ABI": host.ABI}


def rust_text() -> str:
    """Every header, but for abi.h: without its macros bindgen sees names and descriptions, not linked names."""
    allow = "#![allow(non_camel_case_types, non_snake_case, non_upper_case_globals)]"
    lines = [*MADE.format("//", "//!").splitlines(), allow, f"pub const OKID_ABI: i32 = {abi.ABI};"]
    headers = [f"-include{path}" for part in INCLUDE[:2] for path in sorted(part.rglob("*.h"))]
    clang = ["-DOKID_ABI_H", *(f"-I{part}" for part in INCLUDE), *headers]
    try:
        subprocess.run(["rustfmt", "--version"], check=True, capture_output=True)
        known = subprocess.run(["bindgen", "--help"], check=True, capture_output=True, text=True).stdout
        usize = ["--size_t-is-usize"] if "--size_t-is-usize" in known else []  # later releases do so unasked
        command = [*BINDGEN, *usize, *(f"--raw-line={line}" for line in lines), str(INCLUDE[1] / "okid_host.h")]
        text = subprocess.run([*command, "--", *clang], check=True, stdout=subprocess.PIPE, text=True).stdout
    except FileNotFoundError as missing:
        raise SystemExit(f"bindings: {missing.filename} is not installed, which the Rust crate needs") from None
    for name in LINKED:
        linked = f'#[link_name = "{name}_{abi.ABI}_double"]'
        text = text.replace(f"    pub fn {name}(", f"    {linked}\n    pub fn {name}(")
    return text.replace('doc = "< ', 'doc = " ')


def julia_text() -> str:
    lines = [*MADE.format("#", "#").splitlines(), "module Okid", 'const libokid = get(ENV, "OKID_LIBRARY", "libokid")',
             'const libokid_host = get(ENV, "OKID_HOST_LIBRARY", "libokid_host")']  # fmt: skip
    lines += [f"const {name} = Int32({value})" for name, value in constants().items()]
    for kind in structs():
        fields = "".join(f"    {name}::{julia(part)}\n" for name, part in kind._fields_)
        lines.append(f"struct {c_name(kind)}\n{fields}end")
    for library, name, linked, result, arguments in functions():
        taken = ", ".join(f"a{k}" for k in range(len(arguments)))
        kinds = "".join(f"{julia(kind)}, " for kind in arguments)
        call = f"ccall((:{linked}, lib{library}), {julia(result) if result else 'Cvoid'}, ({kinds})"
        lines.append(f"{name}({taken}) = {call}{', ' + taken if taken else ''})")
    return "\n".join([*lines, "end", ""])


def write(folder: Path) -> None:
    """rust/okid-sys, julia/okid.jl, matlab/ in the folder."""
    for name in ("rust", "matlab"):
        from_, to = ROOT / "packaging" / name, folder / ("rust/okid-sys" if name == "rust" else name)
        for path in (p for p in sorted(from_.rglob("*")) if p.is_file()):
            target = to / path.relative_to(from_)
            target.parent.mkdir(parents=True, exist_ok=True)
            version = re.search(r'#define OKID_VERSION "([^"]+)"', HEADERS)
            assert version
            target.write_text(path.read_text("utf-8").replace("@VERSION@", version[1]), "utf-8")
    for path, text in (("julia/okid.jl", julia_text), ("rust/okid-sys/src/lib.rs", rust_text)):
        (folder / path).parent.mkdir(parents=True, exist_ok=True)
        (folder / path).write_text(text(), "utf-8")


if __name__ == "__main__":
    if len(sys.argv) != 2 or sys.argv[1].startswith("-"):
        sys.exit(__doc__)
    write(Path(sys.argv[1]))
