# SPDX-License-Identifier: MIT
"""A USB CAN adapter without hardware: the candleLight (gs_usb) protocol in user space, on an emulated USB port.

dummy_hcd is a USB host and a device port in one; FunctionFS lets a program be the device. On the other side stands the
kernel's own gs_usb driver, as with a CANable or a candleLight. Numbers: linux/drivers/net/can/usb/gs_usb.c.
"""

from __future__ import annotations

import os
import struct
import subprocess
import threading
import time
from pathlib import Path

GADGETS = Path("/sys/kernel/config/usb_gadget")
ERROR = 0x20000000
RESTARTED, BUS_OFF, CONTROLLER = 0x100, 0x40, 0x4
HARDWARE_STAMPS = 1 << 4
VENDOR_ON_INTERFACE = 0x41
BREQ_MODE, BREQ_BT_CONST, BREQ_DEVICE_CONFIG, BREQ_TIMESTAMP = 2, 4, 5, 6
EVENT_SETUP = 4


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

    def __init__(self, name: str, serial: str, port: int = 0, ppm: float = 0.0, first_us: int = 0) -> None:
        self.port, self.ppm, self.first_us = f"dummy_udc.{port}", ppm, first_us
        self.gadget, self.room = GADGETS / name, Path("/dev/shm") / f"ffs-{name}"
        self.began, self.started = time.monotonic_ns(), threading.Event()
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
        self.into_host, self.out_of_host = (os.open(self.room / each, os.O_RDWR) for each in ("ep1", "ep2"))
        for task in (self.control, self.echo):
            threading.Thread(target=task, daemon=True).start()

    def plug(self) -> None:
        self.started.clear()
        (self.gadget / "UDC").write_text(self.port)

    def unplug(self) -> None:
        self.started.clear()
        (self.gadget / "UDC").write_text("\n")

    def clock_us(self) -> int:
        return int((time.monotonic_ns() - self.began) / 1000 * (1 + 1e-6 * self.ppm) + self.first_us) & 0xFFFFFFFF

    def control(self) -> None:
        """Requests on endpoint 0."""
        answers = {
            BREQ_BT_CONST: struct.pack("<10I", HARDWARE_STAMPS, 48_000_000, 1, 16, 1, 8, 4, 1, 1024, 1),
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
                text = os.read(self.ep0, length)
                if request == BREQ_MODE and struct.unpack_from("<I", text)[0] == 1:
                    self.started.set()
            except OSError:
                continue  # unplugged in the midst of it

    def echo(self) -> None:
        """What the host sends is on the bus at once, and told so."""
        while True:
            try:
                frame = os.read(self.out_of_host, 24)
                os.write(self.into_host, frame[:20] + struct.pack("<I", self.clock_us()))
            except OSError:
                time.sleep(0.01)

    def send(self, identifier: int, data: bytes) -> None:
        """A frame that came over the bus, or an error message."""
        head = struct.pack("<IIBBBB", 0xFFFFFFFF, identifier, len(data), 0, 0, 0)
        os.write(self.into_host, head + data.ljust(8, b"\0") + struct.pack("<I", self.clock_us()))
