# SPDX-License-Identifier: MIT
"""okid behind the kernel's driver of the commonest USB adapters (gs_usb): errors, bus-off, stamps, unplugging."""

from __future__ import annotations

import os
import signal
import subprocess
import time
from collections.abc import Iterator
from pathlib import Path

import pytest
from can_run import Run, bus, sh
from candlelight import BUS_OFF, CONTROLLER, ERROR, RESTARTED, Adapter
from conftest import batch

RATE = 100
PLUGS = int(os.environ.get("OKID_PLUGS", "20"))
CONFIG = f"""
[acquisition]
rate_hz = {RATE}
[[bus]]
name = "can0"
interface = "usbcan"
""" + "".join(
    f"""
[[channel]]
name = "{name}"
role = "{role}"
can_id = 0x100
start_bit = {start}
length = 16
signed = true
sequence = {{ start_bit = 0, length = 16 }}
"""
    for name, role, start in (("f", "force", 16), ("a", "acceleration", 32))
)


@pytest.fixture(scope="module")
def adapter() -> Adapter:
    stock = os.environ["OKID_STOCK"]
    sh("modprobe", "-d", stock, "-a", "configfs", "libcomposite", "usb_f_fs", "dummy_hcd", "gs_usb")
    sh("mount", "-t", "configfs", "config", "/sys/kernel/config", check=False)
    return Adapter("one", "0123456789", ppm=200.0, first_us=(1 << 32) - 3_000_000)  # wraps after 3 s


def named() -> str | None:
    """The interface of the adapter with our serial number, as a udev rule finds it."""
    for each in Path("/sys/class/net").iterdir():
        serial = each / "device" / ".." / "serial"
        if serial.exists() and serial.read_text().strip() == "0123456789":
            return each.name
    return None


def bring_up() -> None:
    """What udev and systemd-networkd do when an adapter is plugged in."""
    for _ in range(500):
        name = named()
        if name:
            break
        time.sleep(0.02)
    assert name
    batch(f"link set {name} down", f"link set {name} name usbcan", "link set usbcan up type can bitrate 500000")


def sample(number: int) -> bytes:
    value = (number * 7919) % 2003 - 1000
    return b"".join((v & 0xFFFF).to_bytes(2, "little") for v in (number, value, 3 * value))


def send(adapter: Adapter, first: int, last: int) -> None:
    for number in range(first, last):
        adapter.send(0x100, sample(number))
        time.sleep(1 / RATE)


@pytest.fixture
def live(adapter: Adapter, tmp_path: Path) -> Iterator[Run]:
    adapter.plug()
    bring_up()
    (tmp_path / "a.toml").write_text(CONFIG)
    run = Run(tmp_path, interface="usbcan")
    yield run
    if run.process.poll() is None:
        run.process.kill()
        run.process.wait(10)
    adapter.unplug()


def end(run: Run) -> list[dict]:
    time.sleep(0.3)
    run.process.send_signal(signal.SIGINT)
    assert run.process.wait(30) in (0, 3), run.messages()  # whether these numbers make a model does not matter here
    return run.events()


def wait_for(run: Run, kind: str, count: int = 1) -> float:
    """Until okid has told it. @return how long that took, s"""
    begin = time.monotonic()
    while time.monotonic() - begin < 20:
        if (run.folder / "ev").read_text().count(f'"event":"{kind}"') >= count:
            return time.monotonic() - begin
        time.sleep(0.005)
    raise AssertionError(f"{kind} was not told: {run.messages()}")


def test_error_passive_bus_off_and_restart(adapter: Adapter, live: Run) -> None:
    """As the firmware of the adapter tells them; its driver knows no restart-ms, the firmware restarts by itself."""
    send(adapter, 0, 50)
    adapter.send(ERROR | CONTROLLER, bytes([0, 0x20, 0, 0, 0, 0, 0, 130]))
    wait_for(live, "error_passive")
    adapter.send(ERROR | BUS_OFF, b"")
    late = wait_for(live, "bus_off")
    time.sleep(0.3)  # 30 samples are sent by a node that nobody hears
    adapter.send(ERROR | RESTARTED, b"")
    wait_for(live, "restarted")
    send(adapter, 80, 130)
    events = end(live)
    told = [event["event"] for event in events if event["type"] == "bus"]
    assert [each for each in told if each in ("error_passive", "bus_off", "restarted")] == [
        "error_passive",
        "bus_off",
        "restarted",
    ]
    assert {(g["channel"], g["first"], g["last"]) for g in events if g["type"] == "gap"} == {
        ("f", 50, 79),
        ("a", 50, 79),
    }
    counts = bus(events)
    assert (counts["received"], counts["lost"], counts["state"]) == (100, 30, "error-active")
    assert (counts["errors"]["bus_off"], counts["errors"]["restarted"]) == (1, 1)
    print(f"\nbus-off told after {1e3 * late:.0f} ms")
    assert late < 0.1


def test_unplugged_and_plugged_again(adapter: Adapter, live: Run) -> None:
    """Every time: told, bound to the new interface, samples again, the hole between marked; nothing grows."""
    send(adapter, 0, 20)
    fds, number = Path(f"/proc/{live.process.pid}/fd"), 20
    open_files = len(list(fds.iterdir()))
    for turn in range(1, PLUGS + 1):
        adapter.unplug()
        wait_for(live, "link_down", turn)
        while named():  # it goes down before it goes away
            time.sleep(0.005)
        adapter.plug()
        bring_up()
        while (live.folder / "ev").read_text().count('"event":"link_up"') < turn:  # from now on each sample counts
            send(adapter, number, number + 1)
            number += 1
        send(adapter, number, number + 10)
        number += 10
    assert len(list(fds.iterdir())) == open_files
    events = end(live)
    counts, holes = bus(events), [event for event in events if event["type"] == "gap" and event["channel"] == "f"]
    assert {hole["cause"] for hole in holes} <= {"link_down"} and len(holes) <= PLUGS
    assert counts["lost"] == counts["lost_by"]["link_down"] == sum(hole["count"] for hole in holes)
    assert counts["received"] + counts["lost"] == number and counts["received"] >= 20 + 10 * PLUGS
    assert [event["event"] for event in events if event["type"] == "bus"] == ["link_down", "link_up"] * PLUGS
    longest = max((hole["count"] for hole in holes), default=0)
    print(f"\n{PLUGS} plugs: at most {longest} samples of {1000 // RATE} ms until samples came again")


def test_stamps_of_the_adapter_are_used(adapter: Adapter, live: Run) -> None:
    """Its clock is 200 ppm fast and wraps while it runs: the kernel and okid carry it on."""
    send(adapter, 0, 600)
    events = end(live)
    counts = bus(events)
    assert (counts["received"], counts["lost"]) == (600, 0)
    clock = counts["clock"]
    print("\n", clock)
    assert clock["restarts"] == 0 and abs(clock["rate_ppm"] + 200) < 5 * clock["rate_std_ppm"] < 200


def test_candump_sees_the_device_clock(adapter: Adapter, live: Run, tmp_path: Path) -> None:
    """The test's own premise, by a foreign program: hardware stamps do come."""
    with (tmp_path / "seen").open("w") as out:
        watch = subprocess.Popen(["candump", "-H", "-t", "a", "usbcan"], stdout=out)
        time.sleep(1.0)
        send(adapter, 0, 100)
        time.sleep(0.5)
        watch.terminate()
        watch.wait(10)
    stamps = [float(line.split()[0].strip("()")) for line in (tmp_path / "seen").read_text().splitlines()]
    assert len(stamps) == 100 and 0.9 < stamps[-1] - stamps[0] < 20 and stamps == sorted(stamps)
