# SPDX-License-Identifier: MIT
"""Every DBC file of a folder ($OKID_DBC, such as tests/files/dbc of the cantools source package): each plain message
is decoded as cantools decodes it. Long tier only; it fetches nothing."""

from __future__ import annotations

import contextlib
import json
import math
import os
import random
from pathlib import Path

import cantools
import program
import pytest

FOLDER = os.environ.get("OKID_DBC", "")
FILES = sorted(Path(FOLDER).rglob("*.dbc")) if FOLDER and os.environ.get("OKID_SLOW") else []
RATE = 100
FD_LENGTHS = (*range(9), 12, 16, 20, 24, 32, 48, 64)


def database_of(path: Path) -> cantools.database.can.Database | None:
    for strict in (True, False):
        with contextlib.suppress(Exception):
            return cantools.database.load_file(str(path), strict=strict)
    return None


def plain_messages(database: cantools.database.can.Database) -> list[cantools.database.can.Message]:
    """Those of which every frame carries every signal."""
    found = [m for m in database.messages if m.signals and not m.is_multiplexed() and 1 <= m.length <= 64]
    return [m for m in found if decodes(m)]


def decodes(message: cantools.database.can.Message) -> bool:
    """Some of the files are made to be wrong: signals beyond the end of their message."""
    with contextlib.suppress(cantools.database.DecodeError):
        return bool(message.decode(bytes(message.length), decode_choices=False))
    return False


def frames_of(message: cantools.database.can.Message, draw: random.Random) -> list[tuple[bytes, dict[str, float]]]:
    found: list[tuple[bytes, dict[str, float]]] = []
    while len(found) < 4:
        data = draw.randbytes(message.length)
        values = {k: float(v) for k, v in message.decode(data, decode_choices=False).items()}
        if all(math.isfinite(v) for v in values.values()):
            found.append((data, values))
    return found


def check_message(folder: Path, path: Path, message: cantools.database.can.Message, draw: random.Random) -> int:
    frames = frames_of(message, draw)
    fd = "fd = true\n" if message.length > 8 else ""
    text = (
        f'[acquisition]\nrate_hz = {RATE}\n[[bus]]\nname = "b"\ninterface = "can0"\n{fd}dbc = {json.dumps(str(path))}\n'
    )
    for i, signal in enumerate(message.signals[:60]):
        role = "acceleration" if i == 0 else "aux"
        text += f'[[channel]]\nname = "s{i}"\nrole = "{role}"\nmessage = {json.dumps(message.name)}\n'
        text += f"signal = {json.dumps(signal.name)}\n"
    (folder / "a.toml").write_text(text)
    identifier = f"{message.frame_id:08X}" if message.is_extended_frame else f"{message.frame_id:03X}"
    mark = "##0" if message.length > 8 else "#"
    wire = next(n for n in (message.length, 12, 16, 20, 24, 32, 48, 64) if n >= message.length and n in FD_LENGTHS)
    rows = [
        f"({n / RATE:.6f}) can0 {identifier}{mark}{data.ljust(wire, bytes(1)).hex().upper()}\n"
        for n, (data, _) in enumerate(frames)
    ]
    (folder / "a.log").write_text("".join(rows))
    done = program.okid("convert", folder / "a.log", folder / "a.csv", "-c", folder / "a.toml")
    assert done.returncode == 0, f"{path.name} {message.name}: {done.stderr}"
    table = [line for line in (folder / "a.csv").read_text().splitlines() if not line.startswith("#")][1:]
    assert len(table) == len(frames), (path.name, message.name)
    for row, (_, values) in zip(table, frames, strict=True):
        for cell, signal in zip(row.split(","), message.signals, strict=False):
            wanted = values[signal.name] * (9.80665 if signal.unit == "g" else 1)  # accelerations are m/s^2
            assert math.isclose(float(cell), wanted, rel_tol=1e-9, abs_tol=1e-12 * max(1.0, abs(wanted))), (
                path.name,
                message.name,
                signal.name,
            )
    return 1


if FILES:  # without a folder there is nothing to test, which is no skip

    @pytest.mark.parametrize("path", FILES, ids=[path.name for path in FILES])
    def test_file_as_cantools(tmp_path: Path, path: Path) -> None:
        database = database_of(path)
        draw = random.Random(path.name)
        names = [message.name for message in database.messages] if database else []
        messages = [m for m in plain_messages(database) if names.count(m.name) == 1] if database else []
        for message in messages[:40]:
            check_message(tmp_path, path, message, draw)


if FOLDER and os.environ.get("OKID_SLOW"):

    def test_the_folder_holds_files() -> None:
        assert FILES, f"OKID_DBC={FOLDER}: no .dbc file in it"
        assert sum(len(plain_messages(d)) for d in map(database_of, FILES) if d) > 0
