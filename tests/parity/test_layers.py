# SPDX-License-Identifier: MIT
"""No room leans on a room above it: the graphs of includes in firmware_host and of imports in tools/okid, drawn from
the files, against the order that is stated here."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
HOST, PACKAGE = ROOT / "firmware_host", ROOT / "tools" / "okid"

# Below first. A file may include what stands in its own room or in one before it.
ROOMS = [
    "files", "result", "consensus", "record", "frequency", "compare", "config", "align", "acquire", "journal",
    "publish", "live", "rig", "face", "commands",
]  # fmt: skip


def includes() -> Iterator[tuple[str, str, str]]:
    """(room, room it includes from, where)."""
    for file in sorted(HOST.glob("*/*.?pp")):
        for room in re.findall(r'#include "(\w+)/[\w.]+"', file.read_text()):
            if (HOST / room).is_dir() and room != file.parent.name:
                yield file.parent.name, room, f"{file.relative_to(ROOT)} includes {room}/"


def modules() -> dict[str, Path]:
    out = {}
    for file in sorted(PACKAGE.rglob("*.py")):
        parts = ["okid", *file.relative_to(PACKAGE).with_suffix("").parts]
        out[".".join(parts[:-1] if parts[-1] == "__init__" else parts)] = file
    return out


def imports(of: Path, known: dict[str, Path]) -> Iterator[str]:
    """Modules of the package that a file imports anywhere but for its types alone."""
    tree = ast.parse(of.read_text())
    typing = {
        node
        for branch in ast.walk(tree)
        if isinstance(branch, ast.If) and isinstance(branch.test, ast.Name) and branch.test.id == "TYPE_CHECKING"
        for node in ast.walk(branch)
    }
    for node in ast.walk(tree):
        if node in typing:
            continue
        if isinstance(node, ast.ImportFrom) and node.module:
            for name in node.names:
                full = f"{node.module}.{name.name}"
                yield full if full in known else node.module
        elif isinstance(node, ast.Import):
            yield from (name.name for name in node.names)


def circles(graph: dict[str, set[str]]) -> list[list[str]]:
    """Every strongly connected part of more than one node (Tarjan)."""
    number: dict[str, int] = {}
    lowest: dict[str, int] = {}
    stack: list[str] = []
    out: list[list[str]] = []

    def visit(node: str) -> None:
        number[node] = lowest[node] = len(number)
        stack.append(node)
        for other in sorted(graph.get(node, ())):
            if other not in number:
                visit(other)
            if other in stack:
                lowest[node] = min(lowest[node], lowest[other])
        if lowest[node] == number[node]:
            part = [stack.pop()]
            while part[-1] != node:
                part.append(stack.pop())
            if len(part) > 1:
                out.append(sorted(part))

    for node in sorted(graph):
        if node not in number:
            visit(node)
    return out


def test_the_search_for_circles_finds_them() -> None:
    assert circles({"a": {"b"}, "b": {"c"}, "c": {"b", "d"}, "d": set()}) == [["b", "c"]]
    assert circles({"a": {"b", "c"}, "b": {"c"}}) == []


def test_every_room_of_the_host_has_its_place() -> None:
    assert sorted(path.name for path in HOST.iterdir() if path.is_dir() and any(path.glob("*.cpp"))) == sorted(ROOMS)


def test_rooms_of_the_host_lean_downwards_only() -> None:
    seen = list(includes())
    assert len(seen) > 100
    assert [where for room, other, where in seen if ROOMS.index(other) > ROOMS.index(room)] == []


def test_lib_and_drivers_know_nothing_of_the_host() -> None:
    for folder in ("lib", "drivers"):
        for file in (ROOT / folder).rglob("*.[ch]*"):
            found = re.findall(r'#include [<"]([^>"]+)[>"]', file.read_text(errors="replace"))
            foreign = "drv/" if folder == "lib" else "okid/"
            assert [
                one for one in found if one.startswith((foreign, "okid_host")) or "firmware_host" in one
            ] == [], file


@pytest.fixture(scope="module")
def graph() -> dict[str, set[str]]:
    known = modules()
    return {name: {one for one in imports(file, known) if one in known and one != name} for name, file in known.items()}


def room(name: str) -> str:
    return name.split(".")[1] if "." in name else "okid"


def test_no_circle_among_the_modules_of_the_package(graph: dict[str, set[str]]) -> None:
    """`from okid import x` of a module loads the whole package, which is loaded by then: it is no circle."""
    assert len(graph) > 80
    assert circles({name: others - {"okid"} for name, others in graph.items()}) == []


def test_no_circle_among_the_rooms_of_the_package(graph: dict[str, set[str]]) -> None:
    rooms: dict[str, set[str]] = {}
    for name, others in graph.items():
        if room(name) != "okid":
            rooms.setdefault(room(name), set()).update(room(other) for other in others)
    assert circles({name: others - {"okid", name} for name, others in rooms.items()}) == []


@pytest.mark.parametrize("folder", [HOST, PACKAGE], ids=lambda folder: folder.name)
def test_few_files_stand_outside_the_rooms(folder: Path) -> None:
    """A newcomer reads the names of the rooms first."""
    assert len([file for file in folder.iterdir() if file.is_file()]) <= 8
