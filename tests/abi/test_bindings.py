# SPDX-License-Identifier: MIT
"""tools/bindings.py: its Rust and Julia name each function once, linked as the headers link it; every struct is one
of the headers'. tests/languages compiles and runs what it writes.
"""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]


@pytest.fixture(scope="module")
def written(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("bindings")
    subprocess.run([sys.executable, ROOT / "tools" / "bindings.py", folder], check=True)
    return folder


def headers(*folders: str) -> str:
    text = "".join(path.read_text("utf-8") for folder in folders for path in (ROOT / folder).rglob("*.h"))
    return re.sub(r"//[^\n]*|/\*.*?\*/", "", text, flags=re.S)


def test_functions_and_structs_are_those_of_the_headers(written: Path) -> None:
    rust, julia = (written / "rust/okid-sys/src/lib.rs").read_text(), (written / "julia/okid.jl").read_text()
    text = headers("lib/include", "firmware_host/include")
    declared = set(re.findall(r"\bOKID_(?:HOST_)?API [^;(]*?\b(okid_\w+)\(", text))
    functions = re.findall(r"pub fn (\w+)\(", rust)
    assert len(functions) == len(set(functions)) > 200
    assert set(functions) <= declared
    assert re.findall(r"^(okid_\w+)\(", julia, re.M) == functions
    structs = re.findall(r"pub struct (\w+)", rust)
    assert not [name for name in structs if not re.search(rf"}} {name};", text)]
    assert re.findall(r"^struct (\w+)", julia, re.M) == structs


def test_names_that_the_interface_numbers_are_linked_so(written: Path) -> None:
    abi = (ROOT / "lib/include/okid/abi.h").read_text()
    number = re.search(r"#define OKID_ABI (\d+)", abi)[1]  # type: ignore[index]
    linked = {f"{name}_{number}_double" for name in re.findall(r"#define (okid_\w+) OKID_LINKED\(", abi)}
    rust, julia = (written / "rust/okid-sys/src/lib.rs").read_text(), (written / "julia/okid.jl").read_text()
    assert set(re.findall(r'link_name = "(\w+)"', rust)) == {name for name in linked if f":{name}, " in julia}
    assert len(linked) - len(re.findall("link_name", rust)) <= 2  # okid.abi leaves out what Python does not call
