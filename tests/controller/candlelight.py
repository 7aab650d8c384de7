# SPDX-License-Identifier: MIT
"""A USB CAN adapter without hardware: the candleLight protocol, classic and FD, in user space, on an emulated port.

dummy_hcd is a USB host and a device port in one; FunctionFS lets a program be the device. On the other side stands the
kernel's own gs_usb driver, as with a CANable or a candleLight. Numbers: linux/drivers/net/can/usb/gs_usb.c.
"""

from __future__ import annotations

import contextlib
import math
import os
import struct
import subprocess
import threading
import time
from collections.abc import Callable
from pathlib import Path

GADGETS = Path("/sys/kernel/config/usb_gadget")
ERROR = 0x20000000
RESTARTED, BUS_OFF, CONTROLLER = 0x100, 0x40, 0x4
FEATURE_STAMPS, FEATURE_FD, FEATURE_EXTENDED_CONSTANTS = 1 << 4, 1 << 8, 1 << 10
MODE_FD = 1 << 8
FLAG_OVERFLOW, FLAG_FD, FLAG_BRS = 1, 2, 4
BREQ_TIMING, BREQ_MODE, BREQ_CONSTANTS, BREQ_DEVICE_CONFIG, BREQ_TIMESTAMP = 1, 2, 4, 5, 6
BREQ_DATA_TIMING, BREQ_EXTENDED_CONSTANTS = 10, 11
EVENT_SETUP = 4
CLOCK_HZ = 80_000_000
TIMING_LIMITS = (1, 256, 1, 128, 128, 1, 512, 1)  # segments, jump width, prescaler: least, most, step
DATA_LIMITS = (1, 32, 1, 16, 16, 1, 32, 1)
LENGTHS = (0, 1, 2, 3, 4, 5, 6, 7, 8, 12, 16, 20, 24, 32, 48, 64)  # by DLC
FROM_THE_BUS = 0xFFFFFFFF


def descriptors() -> tuple[bytes, bytes]:
    """One vendor interface with a bulk endpoint in each direction, at full and at high speed; no strings."""
    each = []
    for size in (64, 512):
        out = struct.pack("<9B", 9, 4, 0, 0, 2, 0xFF, 0xFF, 0xFF, 0)
        for address in (0x81, 0x02):
            out += struct.pack("<BBBBHB", 7, 5, address, 2, size, 0)
        each.append(out)
    body = struct.pack("<II", 3, 3) + b"".join(each)
    head = struct.pack("<III", 3, 12 + len(body), 1 | 2)  # FUNCTIONFS_DESCRIPTORS_MAGIC_V2, full and high speed
    return head + body, struct.pack("<IIII", 2, 16, 0, 0)


class Adapter:
    """One channel. Its clock runs `ppm` fast against this machine's and wraps at 32 bits of microseconds."""

    def __init__(
        self, name: str, serial: str, port: int = 0, ppm: float = 0.0, first_us: int = 0, fd: bool = False
    ) -> None:
        self.port, self.ppm = f"dummy_udc.{port}", ppm
        self.fd, self.serial = fd, serial
        self.rates: dict[int, float] = {}  # bit/s as the driver set them, by request
        self.mode = 0
        self.gadget, self.room = GADGETS / name, Path("/dev/shm") / f"ffs-{name}"
        self.set_clock(first_us)
        self.started = threading.Event()
        self.function = self.gadget / "functions" / f"ffs.{name}"
        self.function.mkdir(parents=True)
        for key, text in (("idVendor", "0x1d50"), ("idProduct", "0x606f"), ("bcdUSB", "0x0200")):
            (self.gadget / key).write_text(text)
        strings = self.gadget / "strings" / "0x409"
        strings.mkdir()
        for key, text in (("serialnumber", serial), ("product", "candleLight"), ("manufacturer", "okid tests")):
            (strings / key).write_text(text)
        setting = self.gadget / "configs" / "c.1"
        setting.mkdir()
        (setting / self.function.name).symlink_to(self.function)
        self.room.mkdir()
        subprocess.run(["mount", "-t", "functionfs", name, self.room], check=True)
        self.ep0 = os.open(self.room / "ep0", os.O_RDWR)
        for text in descriptors():
            os.write(self.ep0, text)
        # Where it is not plugged in a frame fails: it must not wait, to be sent as the first one of the next plug.
        self.into_host, self.out_of_host = (
            os.open(self.room / each, os.O_RDWR | os.O_NONBLOCK) for each in ("ep1", "ep2")
        )
        self.sending = threading.Lock()
        for task in (self.control, self.transmit):
            threading.Thread(target=task, daemon=True).start()

    def plug(self, port: int | None = None) -> None:
        self.started.clear()
        if port is not None:
            self.port = f"dummy_udc.{port}"
        (self.gadget / "UDC").write_text(self.port)

    def unplug(self) -> None:
        self.started.clear()
        (self.gadget / "UDC").write_text("\n")
        with self.sending:  # a frame that was on its way has failed by now
            pass

    def set_clock(self, now_us: int) -> None:
        """Before it is plugged in: the driver takes its clock for one that never jumps."""
        self.began, self.first_us = time.monotonic_ns(), now_us

    def clock_us(self, at_ns: int | None = None) -> int:
        """Of its clock, now or at a time of CLOCK_MONOTONIC."""
        passed = (time.monotonic_ns() if at_ns is None else at_ns) - self.began
        return int(passed / 1000 * (1 + 1e-6 * self.ppm) + self.first_us) & 0xFFFFFFFF

    def control(self) -> None:
        """Requests on endpoint 0."""
        features = FEATURE_STAMPS | (FEATURE_FD | FEATURE_EXTENDED_CONSTANTS if self.fd else 0)
        constants = struct.pack("<10I", features, CLOCK_HZ, *TIMING_LIMITS)
        answers = {
            BREQ_CONSTANTS: constants,
            BREQ_EXTENDED_CONSTANTS: constants + struct.pack("<8I", *DATA_LIMITS),
            BREQ_DEVICE_CONFIG: struct.pack("<4BII", 0, 0, 0, 0, 2, 1),
        }
        while event := os.read(self.ep0, 12):
            kind, request, _value, _index, length = struct.unpack("<BBHHH", event[:8])
            if event[8] != EVENT_SETUP:
                continue
            try:
                if kind & 0x80:
                    answer = struct.pack("<I", self.clock_us()) if request == BREQ_TIMESTAMP else answers[request]
                    os.write(self.ep0, answer[:length])
                    continue
                self.told(request, os.read(self.ep0, length))
            except OSError:
                continue  # unplugged in the midst of it

    def told(self, request: int, text: bytes) -> None:
        if request in (BREQ_TIMING, BREQ_DATA_TIMING):
            before, first, second, _jump, prescaler = struct.unpack("<5I", text)
            self.rates[request] = CLOCK_HZ / prescaler / (1 + before + first + second)
        if request == BREQ_MODE:
            started, self.mode = struct.unpack("<II", text)
            (self.started.set if started == 1 else self.started.clear)()

    def transmit(self) -> None:
        """What the host sends is on the bus at once, and the host is told so with a stamp."""
        while True:
            try:
                frame = os.read(self.out_of_host, 512)
                size = 12 + (64 if frame[10] & FLAG_FD else 8)
                os.write(self.into_host, frame[:size].ljust(size, b"\0") + struct.pack("<I", self.clock_us()))
            except OSError:
                time.sleep(0.01)

    def send(self, identifier: int, data: bytes, flags: int = 0, at_ns: int | None = None) -> None:
        """A frame that came over the bus (at that time, else now), or an error message."""
        long = flags & FLAG_FD
        head = struct.pack("<IIBBBB", FROM_THE_BUS, identifier, LENGTHS.index(len(data)), 0, flags, 0)
        stamp = struct.pack("<I", self.clock_us(at_ns))
        os.write(self.into_host, head + data.ljust(64 if long else 8, b"\0") + stamp)


class Node(threading.Thread):
    """Something that sends a frame every `period` seconds on every adapter's bus, whoever hears it: an adapter that is
    unplugged or not started does not."""

    def __init__(
        self,
        adapters: list[Adapter],
        identifier: int,
        frame: Callable[[int], bytes],
        period: float,
        begin: float | None = None,
        skips_after: float = math.inf,
    ):
        super().__init__(daemon=True)
        self.adapters, self.identifier, self.frame, self.period = adapters, identifier, frame, period
        self.begin = begin  # of time.monotonic(), when sample 0 is taken; None = at once
        self.skips_after = skips_after  # s, by which it may be late: it catches up; what is later it never sends
        self.sent_ns: dict[int, int] = {}
        self.taken_ns: dict[int, int] = {}  # by the host's kernel, too
        self.number, self.ending = 0, False
        self.late: list[float] = []  # s, of each sample
        self.worst_late = 0.0  # s, by which this machine did not give us a processor in time; set it back as you like

    def run(self) -> None:
        # It stands for another computer: it does not wait until the programs of this one leave it a processor.
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(10))
        due = time.monotonic() if self.begin is None else self.begin
        time.sleep(max(0.0, due - time.monotonic()))
        while not self.ending:
            self.sent_ns[self.number] = time.monotonic_ns()
            self.late.append(time.monotonic() - due)
            self.worst_late = max(self.worst_late, self.late[-1])
            for adapter in self.adapters:
                with contextlib.suppress(OSError), adapter.sending:  # unplugged in the midst of it
                    if adapter.started.is_set():
                        adapter.send(self.identifier, self.frame(self.number), at_ns=self.sent_ns[self.number])
                        self.taken_ns[self.number] = time.monotonic_ns()
            self.number += 1
            due += self.period
            while due + self.skips_after < time.monotonic():
                self.number += 1
                due += self.period
            time.sleep(max(0.0, due - time.monotonic()))

    def __enter__(self) -> Node:
        self.start()
        return self

    def __exit__(self, *_: object) -> None:
        self.stop()

    def stop(self) -> int:
        """@return samples it had, heard or not"""
        self.ending = True
        self.join(10)
        return self.number
