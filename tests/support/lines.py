# SPDX-License-Identifier: MIT
"""A serial line made of a pseudo terminal, packets as docs/wire-protocol.md has them (cobs and zlib, not our code), and
`okid run` at the other end."""

from __future__ import annotations

import contextlib
import fcntl
import json
import os
import signal
import struct
import subprocess
import termios
import threading
import tty
import zlib
from array import array
from collections.abc import Iterable, Iterator
from io import FileIO
from pathlib import Path
from typing import Any

import program
from cobs import cobs


class Line:
    """Our end of a line whose other end has a path that stays the same when it is unplugged and plugged in again."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self.plug_in()

    def plug_in(self) -> None:
        self.fd, self._far = os.openpty()
        tty.setraw(self._far)
        self.path.unlink(missing_ok=True)
        self.path.symlink_to(os.ttyname(self._far))

    def unplug(self) -> None:
        self.path.unlink(missing_ok=True)
        os.close(self._far)
        os.close(self.fd)

    def write(self, data: bytes) -> None:
        while data:
            data = data[os.write(self.fd, data) :]

    def own(self) -> FileIO:
        """The same end once more, for a thread that may outlive this one: the number of a descriptor that is closed is
        given to the next file, of whatever test."""
        return FileIO(os.dup(self.fd), "r+")

    def unread(self) -> int:
        """Bytes that the other end has not read yet."""
        return int(array("i", fcntl.ioctl(self._far, termios.FIONREAD, bytes(4)))[0])


@contextlib.contextmanager
def line(path: Path) -> Iterator[Line]:
    one = Line(path)
    try:
        yield one
    finally:
        one.unplug()


def packet(sequence: int, rows: list[list[int]], *, time_us: int = 0, size: int = 2) -> bytes:
    """Samples as int16 (size 2) or int24 (size 3), with the closing 0."""
    codes = b"".join(code.to_bytes(size, "little", signed=True) for row in rows for code in row)
    head = struct.pack("<BBBBII", 1, size - 2, len(rows[0]), len(rows), sequence & 0xFFFFFFFF, time_us & 0xFFFFFFFF)
    return cobs.encode(head + codes + struct.pack("<I", zlib.crc32(head + codes))) + b"\0"


def unpack(stream: bytes) -> list[tuple[int, int, list[list[int]]]]:
    """(sequence, time_us, rows) of every packet; every one must be whole."""
    out = []
    for piece in stream.split(b"\0")[:-1]:
        plain = cobs.decode(piece)
        assert zlib.crc32(plain[:-4]) == struct.unpack("<I", plain[-4:])[0]
        version, form, channels, samples, sequence, time_us = struct.unpack("<BBBBII", plain[:12])
        assert version == 1
        size = 2 + form
        codes = [int.from_bytes(plain[i : i + size], "little", signed=True) for i in range(12, len(plain) - 4, size)]
        assert len(codes) == channels * samples
        out.append((sequence, time_us, [codes[i * channels : (i + 1) * channels] for i in range(samples)]))
    return out


def node_config(
    folder: Path, more: str = "", rate_hz: float = 100, roles: tuple[str, ...] = ("force", "acceleration")
) -> Path:
    """A config of one serial node at folder/tty with a channel for each role."""
    text = f'[acquisition]\nrate_hz = {rate_hz}\n[[bus]]\nname = "node"\ntype = "serial"\nframing = "cobs"\n'
    text += f'device = "{folder}/tty"\n'
    for field, role in enumerate(roles):
        text += f'[[channel]]\nname = "c{field}"\nrole = "{role}"\nfield = {field}\n'
    path = folder / "node.toml"
    path.write_text(text + more)
    return path


def witmotion(x: int, y: int, z: int) -> bytes:
    body = b"\x55\x51" + struct.pack("<hhhh", x, y, z, 2500)
    return body + bytes([sum(body) & 0xFF])


class Run:
    """`okid run` in the background; result() waits for its end and gives what it told."""

    def __init__(self, config: Path, *arguments: object) -> None:
        self.events_path = config.with_suffix(".jsonl")
        self.process = subprocess.Popen(
            [program.PROGRAM, "run", str(config), "--events", str(self.events_path), *map(str, arguments)],
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            stdin=subprocess.DEVNULL,
        )

    def stop(self) -> None:
        self.process.send_signal(signal.SIGINT)

    def finish(self, status: int = 0) -> list[dict[str, Any]]:
        out, self.stderr = self.process.communicate(timeout=1800)
        assert self.process.returncode == status, f"{self.process.returncode}\n{out}\n{self.stderr}"
        return self.events()

    def events(self) -> list[dict[str, Any]]:
        if not self.events_path.exists():
            return []
        whole = self.events_path.read_text().rpartition("\n")[0]
        return [json.loads(line) for line in whole.splitlines()]


def of_type(events: Iterable[dict[str, Any]], kind: str) -> list[dict[str, Any]]:
    return [event for event in events if event["type"] == kind]


class Reader:
    """Collects what arrives at our end of a line."""

    def __init__(self, line: Line) -> None:
        self._data, self._more = bytearray(), threading.Condition()
        threading.Thread(target=self._read, args=(line.own(),), daemon=True).start()

    def _read(self, source: FileIO) -> None:
        with source, contextlib.suppress(OSError):
            while data := source.read(4096):
                with self._more:
                    self._data += data
                    self._more.notify_all()

    def packets(self, count: int, timeout: float = 1800) -> bytes:
        """What has come once it holds so many packets."""
        with self._more:
            assert self._more.wait_for(lambda: self._data.count(0) >= count, timeout), bytes(self._data)
            return bytes(self._data)
