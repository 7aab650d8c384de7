# SPDX-License-Identifier: MIT
"""okid on a serial line over USB: a microcontroller's CDC-ACM port, by the kernel's own gadget (usb_f_acm) on an
emulated USB port, and the kernel's cdc_acm driver on the other side: unplugging, breaks, a reader that stops."""

from __future__ import annotations

import array
import contextlib
import fcntl
import os
import signal
import statistics
import termios
import threading
import time
from collections.abc import Iterator
from pathlib import Path

import pytest
from can_run import OKID, sh
from candlelight import GADGETS
from lines import Run, of_type, packet

RATE = 100
TIOCGICOUNT = 0x545D
PLUGS = int(os.environ.get("OKID_PLUGS", "20"))


class Board:
    """A microcontroller with a USB serial port of its own. Its link below by-id is made as udev makes it."""

    def __init__(self, serial: str, folder: Path) -> None:
        self.gadget, self.serial, self.by_id = GADGETS / "board", serial, folder / f"usb-okid_board_{serial}-if00"
        self.function = self.gadget / "functions" / "acm.board"
        self.function.mkdir(parents=True)
        for key, text in (("idVendor", "0x1d6b"), ("idProduct", "0x0104"), ("bcdUSB", "0x0200")):
            (self.gadget / key).write_text(text)
        strings = self.gadget / "strings" / "0x409"
        strings.mkdir()
        for key, text in (("serialnumber", serial), ("product", "board"), ("manufacturer", "okid")):
            (strings / key).write_text(text)
        setting = self.gadget / "configs" / "c.1"
        setting.mkdir()
        (setting / self.function.name).symlink_to(self.function)
        self.port = Path(f"/dev/ttyGS{(self.function / 'port_num').read_text().strip()}")
        self.fd = -1
        self.plugged = threading.Event()

    def host_side(self) -> Path | None:
        for each in Path("/sys/class/tty").glob("ttyACM*"):
            with contextlib.suppress(OSError):  # on its way out
                if (each / "device" / ".." / "serial").read_text().strip() == self.serial:
                    return Path("/dev") / each.name
        return None

    def plug(self) -> None:
        (self.gadget / "UDC").write_text("dummy_udc.0")
        for _ in range(1000):
            found = self.host_side()
            if found and found.exists():
                break
            time.sleep(0.01)
        assert found
        self.by_id.unlink(missing_ok=True)
        self.by_id.symlink_to(found)
        self.fd = os.open(self.port, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)
        settings = termios.tcgetattr(self.fd)
        settings[0] = settings[1] = settings[3] = 0
        termios.tcsetattr(self.fd, termios.TCSANOW, settings)
        self.plugged.set()

    def unplug(self) -> None:
        self.plugged.clear()
        (self.gadget / "UDC").write_text("\n")
        os.close(self.fd)
        self.by_id.unlink(missing_ok=True)
        while self.host_side():
            time.sleep(0.005)


class Firmware(threading.Thread):
    """Sends a packet with one sample every 10 ms. What the port takes no more is thrown away, as firmware does."""

    def __init__(self, board: Board, rate: float = RATE) -> None:
        super().__init__(daemon=True)
        self.board, self.period, self.ending, self.number, self.thrown_away = board, 1 / rate, False, 0, 0

    def run(self) -> None:
        due = time.monotonic()
        while not self.ending:
            data = packet(self.number, [sample(self.number)], time_us=self.number * 1_000_000 // RATE)
            if self.board.plugged.is_set():
                try:
                    self.thrown_away += os.write(self.board.fd, data) != len(data)
                except BlockingIOError:
                    self.thrown_away += 1
                except OSError:
                    pass  # unplugged in the midst of it
            self.number += 1
            due += self.period
            time.sleep(max(0.0, due - time.monotonic()))

    def __enter__(self) -> Firmware:
        self.start()
        return self

    def __exit__(self, *_: object) -> None:
        self.stop()

    def stop(self) -> int:
        self.ending = True
        self.join(10)
        return self.number


def sample(number: int) -> list[int]:
    value = (number * 7919) % 2003 - 1000
    return [value, 3 * value]


@pytest.fixture(scope="module")
def board(tmp_path_factory: pytest.TempPathFactory) -> Board:
    stock = os.environ["OKID_STOCK"]
    sh("modprobe", "-d", stock, "-a", "configfs", "libcomposite", "usb_f_acm", "cdc_acm")
    sh("modprobe", "-d", stock, "dummy_hcd", "num=2")
    sh("mount", "-t", "configfs", "config", "/sys/kernel/config", check=False)
    return Board("4F2A", tmp_path_factory.mktemp("by-id"))


@pytest.fixture
def live(board: Board, tmp_path: Path) -> Iterator[Run]:
    board.plug()
    text = f'[acquisition]\nrate_hz = {RATE}\n[[bus]]\nname = "node"\ntype = "serial"\nframing = "cobs"\n'
    text += f'device = "{board.by_id}"\n[identification]\nmethod = "okid-era"\np = 4\nrows = 8\nsigma = "none"\n'
    for field, role in enumerate(("force", "acceleration")):
        text += f'[[channel]]\nname = "c{field}"\nrole = "{role}"\nfield = {field}\n'
    (tmp_path / "a.toml").write_text(text)
    told = " ".join(sh(OKID, "doctor", str(tmp_path / "a.toml"), check=False).stdout.split())
    assert f"{board.by_id} at 115200 baud" in told and "counts overruns" in told
    run = Run(tmp_path / "a.toml")
    for _ in range(1000):
        if any(Path(each).exists() and os.readlink(each) == str(board.host_side()) for each in fds(run)):
            break
        time.sleep(0.01)
    time.sleep(0.2)
    yield run
    if run.process.poll() is None:
        run.process.kill()
        run.process.wait(10)
    board.unplug()


def fds(run: Run) -> list[str]:
    return [str(each) for each in Path(f"/proc/{run.process.pid}/fd").iterdir()]


def end(run: Run) -> tuple[list[dict], dict]:
    time.sleep(0.5)
    run.stop()
    events = run.finish(3)  # these numbers are no structure
    return events, of_type(events, "stats")[-1]["bus"]["node"]


def wait_for(run: Run, kind: str, count: int) -> None:
    for _ in range(4000):
        if run.events_path.read_text().count(f'"event":"{kind}"') >= count:
            return
        time.sleep(0.005)
    raise AssertionError(f"{kind} was not told")


def test_unplugged_and_plugged_again_by_id(board: Board, live: Run) -> None:
    opened = []
    with Firmware(board) as firmware:
        time.sleep(0.5)
        for turn in range(1, PLUGS + 1):
            board.unplug()
            wait_for(live, "link_down", turn)
            board.plug()
            wait_for(live, "link_up", turn)
            time.sleep(0.2)
            opened.append(len(fds(live)))
    number = firmware.stop()
    events, counts = end(live)
    told = [event["event"] for event in of_type(events, "bus")]
    assert [each for each in told if each.startswith("link")] == ["link_down", "link_up"] * PLUGS
    assert (counts["link_downs"], counts["reopened"]) == (PLUGS, PLUGS)
    holes = [gap for gap in of_type(events, "gap") if gap["channel"] == "c0"]
    assert len(holes) == PLUGS and {hole["cause"] for hole in holes} == {"link_down"}
    assert counts["received"] + counts["lost"] == number
    assert set(opened) == {opened[0]}
    lengths = [hole["count"] for hole in holes]
    print(f"\n{PLUGS} plugs: {statistics.median(lengths):.0f} (median), {max(lengths)} (most) samples of 10 ms missing")


def breaks_seen(board: Board) -> int:
    """By the driver; root may open a line that is in exclusive use."""
    line = os.open(board.by_id, os.O_RDONLY | os.O_NOCTTY | os.O_NONBLOCK)
    counts = array.array("i", [0] * 20)  # cts, dsr, rng, dcd, rx, tx, frame, overrun, parity, brk, ..
    fcntl.ioctl(line, TIOCGICOUNT, counts)
    os.close(line)
    return counts[9]


def test_breaks_are_no_data(board: Board, live: Run) -> None:
    """A break amid the packets (a board that resets, a cable half pulled): no byte more, none less. While the board's
    port sends a break it takes no data: those samples are missing."""
    with Firmware(board) as firmware:
        before = breaks_seen(board)
        for _ in range(10):
            time.sleep(0.2)
            termios.tcsendbreak(board.fd, 0)
        assert breaks_seen(board) == before + 10, "the breaks reach the driver"
        time.sleep(0.5)
    number, missing = firmware.stop(), firmware.thrown_away
    _, counts = end(live)
    assert 0 < missing < number // 2 + number // 4
    assert (counts["received"], counts["lost"], counts["damaged"]) == (number - missing, missing, 0)


def test_a_reader_that_stops_makes_usb_wait(board: Board, live: Run) -> None:
    """Three seconds in which okid gets no processor: nothing overruns, because USB makes the board wait."""
    with Firmware(board) as firmware:
        time.sleep(0.5)
        live.process.send_signal(signal.SIGSTOP)
        time.sleep(3)
        live.process.send_signal(signal.SIGCONT)
        time.sleep(1)
    number = firmware.stop()
    _, counts = end(live)
    assert firmware.thrown_away == 0, "3 s are 12 KiB: the buffers of port and driver hold them"
    assert (counts["received"], counts["lost"], counts["overruns"]) == (number, 0, 0)
