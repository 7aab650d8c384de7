# SPDX-License-Identifier: MIT
"""The firmware of tests/embedded/node in QEMU, fed with rig W1 over its serial line, beside the same codes on the host.

tests/embedded/run builds the images and says where they are ($OKID_EMBEDDED); what was measured is written beside them
for table.py.
"""

from __future__ import annotations

import json
import os
import subprocess
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import core_feed
import host_chain
import numpy as np
import pytest
import systems
from numpy.typing import NDArray
from qemu_node import RESET, Modes, Node, packet, samples

BUILD = Path(os.environ.get("OKID_EMBEDDED", "build-embedded")).resolve()
SAMPLES, RATE_HZ = 10000, 152.20657039571532  # NODE_RATE_HZ of main.c: of W1
RAM, FLASH = {20: 64 * 1024, 10: 32 * 1024}, 128 * 1024
Codes = NDArray[np.int16]
Real = NDArray[np.float64]


@dataclass(frozen=True)
class Image:
    """A build of the node, the machine it runs on, its lags and what stands before them in its name."""

    folder: str
    machine: str
    p: int
    kind: str = "p"

    @property
    def name(self) -> str:
        return f"{self.folder}-{self.kind}{self.p}"

    @property
    def path(self) -> Path:
        return BUILD / self.folder / f"node_{self.kind}{self.p}.elf"

    @property
    def is_float(self) -> bool:
        return "float" in self.folder


IMAGES = [
    Image("m4-double", "netduinoplus2", 20),
    Image("m4-double", "netduinoplus2", 10),
    Image("m4-float", "netduinoplus2", 20),
    Image("m7-double", "mps2-an500", 20),
]


def each_in_a_process(images: list[Image]) -> list[Any]:
    """Parameters of a fixture: one image, one process of pytest-xdist, whose emulator serves all its tests."""
    return [pytest.param(i, id=i.name, marks=pytest.mark.xdist_group(i.name)) for i in images]


@pytest.fixture(scope="module", params=each_in_a_process(IMAGES))
def image(request: pytest.FixtureRequest) -> Image:
    return request.param  # type: ignore[no-any-return]


@pytest.fixture(scope="module")
def node(image: Image) -> Iterator[Node]:
    with Node(image.machine, image.path) as it:
        yield it


@pytest.fixture(scope="module")
def w1() -> Codes:
    return core_feed.w1(SAMPLES)


def compare(node: Modes, host: Modes, is_float: bool) -> None:
    """Double: 1e-9 all over. Float: docs/howto/port-to-a-board.md."""
    f, zeta, shape, other = (3e-6, 1e-3, 1e-4, 1e-3) if is_float else (1e-9,) * 4
    assert (node.status, node.stage) == (0, 5)
    assert node.ridge == host.ridge
    np.testing.assert_allclose(node.frequency_hz, host.frequency_hz, rtol=f)
    np.testing.assert_allclose(node.damping_ratio, host.damping_ratio, rtol=zeta)
    np.testing.assert_allclose(node.shape, host.shape, atol=shape)
    np.testing.assert_allclose(node.singular_values[:6], host.singular_values[:6], rtol=f)
    for name in ("radius", "mpc", "emac"):
        np.testing.assert_allclose(getattr(node, name), getattr(host, name), rtol=other, err_msg=name)


def test_sums_are_those_of_the_host_to_the_last_bit_and_modes_agree(node: Node, image: Image, w1: Codes) -> None:
    node.send(packet(bytes([RESET])), *samples(w1, 0))
    host = host_chain.sums([w1], image.p)
    assert node.state() == host.to_bytes()
    modes, expected = node.modes(), host_chain.identify(host, image.p, RATE_HZ)
    compare(modes, expected, image.is_float)
    truth = systems.w1().modes()
    np.testing.assert_allclose(modes.frequency_hz, truth[0], rtol=5e-5)
    np.testing.assert_allclose(modes.damping_ratio, truth[1], rtol=0.01)
    assert node.state() == host.to_bytes(), "identifying has changed the sums"
    keep_measurements(node, image, modes, expected.frequency_hz, expected.damping_ratio)


@pytest.mark.parametrize(("folder", "machine"), [("m4-double", "netduinoplus2"), ("m7-double", "mps2-an500")])
def test_correlation_sums_are_those_of_the_host_to_the_last_bit(folder: str, machine: str, w1: Codes) -> None:
    lags, image = 300, Image(folder, machine, 300)
    host = core_feed.correlation([w1[:4000], w1[4100:]], lags, gap=100)
    with Node(machine, image.path) as node:
        node.send(packet(bytes([RESET])), *samples(w1[:4000], 0), *samples(w1[4100:], 4100))
        assert node.state() == host
        counts = node.counts()
    assert counts["missing"] == 100
    size = sections(image.path)
    assert size["data"] + size["bss"] + counts["stack_used"] <= 80 * 1024
    (BUILD / f"{image.name}.json").write_text(json.dumps({**counts, **size, "machine": machine}))


def keep_measurements(node: Node, image: Image, modes: Modes, f: Real, zeta: Real) -> None:
    """Sizes, stack, instructions and distances from frequencies and damping ratios found elsewhere, for table.py."""
    counts = node.counts()
    off = np.abs(modes.frequency_hz / f - 1).max(), np.abs(modes.damping_ratio / zeta - 1).max()
    counted = {**counts, **sections(image.path), "f_error": off[0], "zeta_error": off[1], "machine": image.machine}
    (BUILD / f"{image.name}.json").write_text(json.dumps(counted))
    assert counts["samples"] == SAMPLES
    assert counts["damaged"] == 0
    assert counts["stack_used"] < counts["stack_room"], "the stack has been at its end"


def keep_within(node: Node, image: Image, ram: int) -> None:
    """Flash and memory suffice."""
    size, stack = sections(image.path), node.counts()["stack_used"]
    assert size["text"] + size["data"] <= FLASH
    assert size["data"] + size["bss"] + stack <= ram


def sections(path: Path) -> dict[str, int]:
    """Bytes of .text, .data, .bss (without the stack's room) of an image, by arm-none-eabi-size."""
    text = subprocess.run(["arm-none-eabi-size", "-A", str(path)], capture_output=True, text=True, check=True)
    lines = (line.split() for line in text.stdout.splitlines() if line.startswith("."))
    sizes = {words[0]: int(words[1]) for words in lines}
    return {"text": sizes[".text"] + sizes.get(".ARM.exidx", 0), "data": sizes[".data"], "bss": sizes[".bss"]}


def test_flash_and_ram_stay_within_what_is_promised(node: Node, image: Image) -> None:
    keep_within(node, image, RAM[image.p])


def test_no_heap_no_exceptions_no_stdio_in_the_image(image: Image) -> None:
    names = subprocess.run(["arm-none-eabi-nm", str(image.path)], capture_output=True, text=True, check=True).stdout
    found = {line.split()[-1] for line in names.splitlines()}
    banned = ("malloc", "free", "sbrk", "printf", "fopen", "write", "__cxa_throw", "_Unwind_", "_Zn", "_Zd", "abort")
    assert "okid_structured_solve_2_float" in found or "okid_structured_solve_2_double" in found
    assert not [n for n in found for b in banned if n.lstrip("_").startswith(b.lstrip("_")) and n != "board_write"]


def test_lost_late_and_damaged_packets_are_counted_and_leave_a_gap(node: Node, image: Image, w1: Codes) -> None:
    part, each = w1[:2048], 32
    packets = list(samples(part, 2**32 - 512, each))  # numbers wrap inside
    damaged = packets[3][:40] + bytes([packets[3][40] ^ 4 or 7]) + packets[3][41:]
    before = node.counts()["damaged"]
    noise = [b"\1\2\0", b"\xff" * 3000 + b"\0"]  # no packet; a line longer than any packet
    line = [*packets[:3], damaged, *packets[4:10], packets[6], *packets[10:20], *packets[22:], *noise]
    node.send(packet(bytes([RESET])), *line)
    parts = [part[: 3 * each], part[4 * each : 20 * each], part[22 * each :]]
    host = host_chain.sums(parts, image.p, [each, 2 * each])
    assert node.state() == host.to_bytes()
    counts = node.counts()
    assert counts["missing"] == 3 * each
    assert counts["damaged"] >= before + 2  # the packet and the bytes that were none; the endless line is no packet
    compare(node.modes(), host_chain.identify(host, image.p, RATE_HZ), image.is_float)


@pytest.mark.parametrize(
    ("make", "status"),
    [
        (lambda codes: codes * [0, 1, 1, 1], -7),  # OKID_ERR_INPUT
        (lambda codes: codes * [1, 1, 0, 1], -8),  # OKID_ERR_OUTPUT
        (lambda codes: codes[:40], -6),  # OKID_ERR_TOO_SHORT
    ],
    ids=["constant input", "constant output", "too short"],
)
def test_what_cannot_be_identified_is_said_and_the_node_goes_on(
    node: Node, image: Image, w1: Codes, make: object, status: int
) -> None:
    assert callable(make)
    node.send(packet(bytes([RESET])), *samples(make(w1[:600]).astype(np.int16), 0))
    modes = node.modes()
    assert (modes.status, modes.stage, len(modes.frequency_hz)) == (status, 1, 0)
    node.send(packet(bytes([RESET])), *samples(w1[:1200], 0))
    assert node.modes().status == 0
