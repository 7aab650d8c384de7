# SPDX-License-Identifier: MIT
"""The node in QEMU, and the line to it: packets of samples, commands, reports (tests/embedded/node/link.h).

The packets are built and taken apart by a COBS and a CRC of Python's own, so that the codec of drivers/ is not compared
with itself.
"""

from __future__ import annotations

import os
import select
import struct
import subprocess
import time
import zlib
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType

import numpy as np
from numpy.typing import NDArray

CHANNELS, PAYLOAD = 4, 480
RESET, IDENTIFY, STATE, COUNTS = 0xC0, 0xC1, 0xC2, 0xC3
REPORT_MODES, REPORT_STATE, REPORT_COUNTS = 0x81, 0x82, 0x83
COUNT_NAMES = (
    "p real_bytes packets damaged samples missing rows tick_hz link_ticks summing_ticks identifying_ticks state_bytes "
    "work_bytes stack_used stack_room"
).split()
Codes = NDArray[np.int16]


def stuff(plain: bytes) -> bytes:
    """COBS with the closing 0."""
    out = bytearray()
    for piece in plain.split(b"\0"):
        while len(piece) >= 254:
            out += b"\xff" + piece[:254]
            piece = piece[254:]
        out += bytes([len(piece) + 1]) + piece
    return bytes(out) + b"\0"


def unstuff(line: bytes) -> bytes:
    """A packet without its closing 0 back to plain bytes."""
    out, at = bytearray(), 0
    while at < len(line):
        distance = line[at]
        out += line[at + 1 : at + distance]
        at += distance
        if distance < 255 and at < len(line):
            out += b"\0"
    return bytes(out)


def packet(plain: bytes) -> bytes:
    """Sum, stuffing and end."""
    return stuff(plain + struct.pack("<I", zlib.crc32(plain)))


def samples(codes: Codes, first: int, each: int = 32) -> Iterator[bytes]:
    """Packets of `each` samples; the number of the first one is `first`. codes: samples x channels."""
    for at in range(0, len(codes), each):
        part = codes[at : at + each].astype("<i2")
        head = struct.pack("<BBBBII", 1, 0, part.shape[1], len(part), (first + at) % 2**32, (first + at) * 6570 % 2**32)
        yield packet(head + part.tobytes())


@dataclass(frozen=True)
class Modes:
    """LINK_REPORT_MODES. Frequencies in Hz; shape: modes x outputs."""

    status: int
    stage: int
    radius: float
    ridge: float
    singular_values: NDArray[np.float64]
    frequency_hz: NDArray[np.float64]
    damping_ratio: NDArray[np.float64]
    mpc: NDArray[np.float64]
    emac: NDArray[np.float64]
    shape: NDArray[np.complex128]
    frequency_std_hz: NDArray[np.float64] | None = None
    damping_ratio_std: NDArray[np.float64] | None = None


def modes_of(report: bytes, outputs: int = 3) -> Modes:
    """Take a report of modes apart."""
    status, stage, count = struct.unpack_from("<3i", report)
    numbers = np.frombuffer(report[12:], dtype="<f8")
    table = numbers[12:].reshape(count, 6 + 2 * outputs)
    shape = table[:, 6 : 6 + outputs] + 1j * table[:, 6 + outputs :]
    f, zeta, f_std, zeta_std, mpc, emac = table[:, :6].T
    return Modes(status, stage, numbers[0], numbers[1], numbers[2:12], f, zeta, mpc, emac, shape, f_std, zeta_std)


class Node:
    """A firmware image on an emulated board, its UART on pipes; one instruction takes one nanosecond there."""

    def __init__(self, machine: str, image: Path, patience_s: float = 120.0) -> None:
        self.patience_s = patience_s
        command = ["qemu-system-arm", "-M", machine, "-kernel", str(image), "-icount", "shift=0", "-display", "none"]
        command += ["-monitor", "none", "-serial", "stdio"]
        self.process = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE)
        assert self.process.stdin is not None and self.process.stdout is not None
        self.to, self.out = self.process.stdin.fileno(), self.process.stdout.fileno()
        os.set_blocking(self.to, False)
        self.waiting = b""
        self.sending = b""
        try:
            self.report(REPORT_COUNTS)  # the node says that it is up; what was sent before would be lost
        except BaseException:
            self.__exit__(None, None, None)
            raise

    def __enter__(self) -> Node:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        self.process.kill()
        self.process.wait()
        for pipe in (self.process.stdin, self.process.stdout):
            assert pipe is not None
            pipe.close()

    def send(self, *packets: bytes) -> None:
        """Put packets on the line; they go out while reports are waited for."""
        self.sending += b"".join(packets)

    def line(self) -> bytes:
        """The next packet of the node without its 0. TimeoutError when nothing moves for the patience given."""
        deadline = time.monotonic() + self.patience_s
        while b"\0" not in self.waiting:
            writes = [self.to] if self.sending else []
            ready = select.select([self.out], writes, [], max(0.0, deadline - time.monotonic()))
            if not ready[0] and not ready[1]:
                raise TimeoutError(f"the node has been silent for {self.patience_s} s")
            if ready[1]:
                self.sending = self.sending[os.write(self.to, self.sending[:65536]) :]
                deadline = time.monotonic() + self.patience_s
            if ready[0]:
                bytes_ = os.read(self.out, 65536)
                if not bytes_:
                    raise EOFError(f"QEMU ended with status {self.process.wait()}")
                self.waiting += bytes_
        line, _, self.waiting = self.waiting.partition(b"\0")
        return line

    def report(self, kind: int) -> bytes:
        """The payload of the next report, which must be of this kind; its sums and part numbers are checked."""
        whole, part = b"", 0
        while True:
            plain = unstuff(self.line())
            body, (check,) = plain[:-4], struct.unpack("<I", plain[-4:])
            if zlib.crc32(body) != check or struct.unpack("<BH", body[:3]) != (kind, part):
                raise ValueError(f"report {body[:3].hex()} (sum {check:08x}), expected kind {kind:#x}, part {part}")
            whole, part = whole + body[3:], part + 1
            if len(body) - 3 < PAYLOAD:
                return whole

    def ask(self, command: int, kind: int) -> bytes:
        """Send a command, and the report that answers it."""
        self.send(packet(bytes([command])))
        return self.report(kind)

    def state(self) -> bytes:
        """The node's accumulator as okid_accumulator_serialise() writes it."""
        return self.ask(STATE, REPORT_STATE)

    def modes(self, outputs: int = 3) -> Modes:
        """Let the node identify."""
        return modes_of(self.ask(IDENTIFY, REPORT_MODES), outputs)

    def counts(self) -> dict[str, int]:
        """What it has counted and measured since it started."""
        return dict(zip(COUNT_NAMES, struct.unpack("<15I", self.ask(COUNTS, REPORT_COUNTS)), strict=True))
