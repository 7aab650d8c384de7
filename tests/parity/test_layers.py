# SPDX-License-Identifier: MIT
"""No room leans on a room above it: the graph of includes in firmware_host, drawn from the files, against the order that
is stated here."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
HOST = ROOT / "firmware_host"

# Below first. A file may include what stands in its own room or in one before it.
ROOMS = [
    "files", "result", "record", "config", "align", "acquire", "journal", "publish", "live", "rig", "face", "commands",
]  # fmt: skip


def includes() -> Iterator[tuple[str, str, str]]:
    """(room, room it includes from, where)."""
    for file in sorted(HOST.glob("*/*.?pp")):
        for room in re.findall(r'#include "(\w+)/[\w.]+"', file.read_text()):
            if (HOST / room).is_dir() and room != file.parent.name:
                yield file.parent.name, room, f"{file.relative_to(ROOT)} includes {room}/"


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
