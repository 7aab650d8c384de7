# SPDX-License-Identifier: MIT
"""Those who connect and do no good: too many, too slow, a broker that announces 256 MB, no descriptors left."""

from __future__ import annotations

import contextlib
import os
import pathlib
import resource
import socket
import struct
import subprocess
import threading
import time
from collections.abc import Iterator

import pytest
from okid.live.server import MOST_VISITORS, PageServer
from program import PROGRAM, okid
from two_masses import rig_text, simulate_rig
from waiting import until


@pytest.fixture(scope="module")
def rig(tmp_path_factory: pytest.TempPathFactory) -> pathlib.Path:
    return simulate_rig(tmp_path_factory.mktemp("rig"), rig_text(120.0))


@contextlib.contextmanager
def publishing(
    rig: pathlib.Path, lines: str, descriptors: int | None = None, speed: str = "4"
) -> Iterator[subprocess.Popen[str]]:
    (rig / "p.toml").write_text((rig / "a.toml").read_text() + f"[publish]\n{lines}\n")
    limit = (lambda: resource.setrlimit(resource.RLIMIT_NOFILE, (descriptors, descriptors))) if descriptors else None
    with subprocess.Popen(
        [PROGRAM, "replay", rig / "a.log", "-c", rig / "p.toml", "--speed", speed, "--json", rig / "r.json"],
        preexec_fn=limit, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True,
    ) as run:  # fmt: skip
        yield run
        run.terminate()


def free_port() -> int:
    with socket.socket() as one:
        one.bind(("127.0.0.1", 0))
        return int(one.getsockname()[1])


def status(run: subprocess.Popen[str], key: str) -> int:
    text = pathlib.Path(f"/proc/{run.pid}/status").read_text()
    return next(int(line.split()[1]) for line in text.splitlines() if line.startswith(key))


def cpu_s(run: subprocess.Popen[str]) -> float:
    fields = pathlib.Path(f"/proc/{run.pid}/stat").read_text().rsplit(")", 1)[1].split()
    return (int(fields[11]) + int(fields[12])) / 100


def connected(port: int) -> socket.socket:
    def attempt() -> socket.socket | None:
        with contextlib.suppress(OSError):
            return socket.create_connection(("127.0.0.1", port), timeout=1800)
        return None

    one: socket.socket = until(attempt)
    return one


@pytest.mark.parametrize("judged", [False, pytest.param(True, marks=pytest.mark.realtime)], ids=["", "processor"])
def test_no_descriptors_left(rig: pathlib.Path, judged: bool) -> None:
    """Release 0.1 went round accept() with a whole processor, and had no descriptor left for its result: exit 2."""
    assert okid("replay", rig / "a.log", "-c", rig / "a.toml", "--json", rig / "calm.json").returncode == 0
    port = free_port()
    with (
        publishing(
            rig,
            f'prometheus = "127.0.0.1:{port}"\nsocket = "s"',
            descriptors=16,
            speed="20",
        ) as run,
        contextlib.ExitStack() as crowd,
    ):
        connected(port).close()
        for _ in range(45):
            one = crowd.enter_context(socket.socket(socket.AF_UNIX))
            one.setblocking(False)
            until(lambda one=one: one.connect_ex(str(rig / "s")) == 0)  # nobody is left standing at the door
        before, at = cpu_s(run), time.monotonic()
        time.sleep(2)
        assert not judged or (cpu_s(run) - before) / (time.monotonic() - at) < 0.5
        with connected(port) as wire:
            wire.sendall(b"GET /metrics HTTP/1.0\r\n\r\n")
            with contextlib.suppress(ConnectionResetError):
                assert wire.recv(15) in (b"", b"HTTP/1.1 200 OK")
        assert run.poll() is None
        _, told = run.communicate(timeout=1800)
        assert run.returncode == 0, told
    assert (rig / "r.json").read_bytes() == (rig / "calm.json").read_bytes()


@pytest.mark.parametrize("piecewise", [False, True])
def test_a_broker_that_announces_256_mb(rig: pathlib.Path, piecewise: bool) -> None:
    """Release 0.1 took the room for it: 540 MB."""
    with socket.create_server(("127.0.0.1", 0)) as server:
        server.settimeout(1800)
        with publishing(rig, f'mqtt = "mqtt://127.0.0.1:{server.getsockname()[1]}"') as run:
            wire, _ = server.accept()
            with wire:
                wire.settimeout(1800)
                assert wire.recv(1000)[0] == 0x10  # CONNECT
                wire.sendall(b"\x20\x02\x00\x00")
                announced = b"\x30\xff\xff\xff\x7f" + struct.pack(">H", 1) + b"t"
                for k in range(len(announced)) if piecewise else [None]:
                    with contextlib.suppress(OSError):
                        wire.sendall(announced if k is None else announced[k : k + 1])
                    time.sleep(0.1)
                with contextlib.suppress(OSError):
                    for _ in range(50):
                        wire.sendall(bytes(1 << 20))
                time.sleep(0.5)
            assert status(run, "VmPeak") < 1_500_000 and status(run, "VmHWM") < 150_000
            assert run.poll() is None
            run.terminate()
            assert "announced a packet" in run.communicate(timeout=1800)[1]


def test_slow_visitors_do_not_pile_up() -> None:
    """740 of them left 337 threads in release 0.1."""

    class Quiet:
        hub = None

    server = PageServer(Quiet(), "127.0.0.1", 0)  # type: ignore[arg-type]
    thread = threading.Thread(target=server.serve_forever, kwargs={"poll_interval": 0.05}, daemon=True)
    thread.start()
    before, crowd = threading.active_count(), []
    try:
        for _ in range(300):
            one = socket.create_connection(("127.0.0.1", server.server_port), timeout=1800)
            one.sendall(b"GET / HT")
            crowd.append(one)
        time.sleep(0.5)
        assert threading.active_count() - before <= MOST_VISITORS
        with socket.create_connection(("127.0.0.1", server.server_port), timeout=1800) as wire:
            wire.sendall(b"GET / HTTP/1.0\r\nHost: localhost\r\n\r\n")
            assert wire.recv(15).startswith(b"HTTP/1.0 200")
    finally:
        for one in crowd:
            one.close()
        server.shutdown()
        server.server_close()


@pytest.mark.realtime
def test_the_page_without_descriptors_does_not_spin() -> None:
    """Release 0.1 asked for the visitor it could not take without a pause."""

    class Quiet:
        hub = None

    server = PageServer(Quiet(), "127.0.0.1", 0)  # type: ignore[arg-type]
    visitor = socket.socket()
    threading.Thread(target=server.serve_forever, kwargs={"poll_interval": 0.05}, daemon=True).start()
    limits = resource.getrlimit(resource.RLIMIT_NOFILE)
    free = os.open("/dev/null", os.O_RDONLY)
    os.close(free)
    try:
        resource.setrlimit(resource.RLIMIT_NOFILE, (free, limits[1]))
        visitor.connect(("127.0.0.1", server.server_port))
        before = time.process_time()
        time.sleep(1)
        assert time.process_time() - before < 0.3
    finally:
        resource.setrlimit(resource.RLIMIT_NOFILE, limits)
    visitor.settimeout(1800)
    visitor.sendall(b"GET / HTTP/1.0\r\nHost: localhost\r\n\r\n")
    assert visitor.recv(15).startswith(b"HTTP/1.0 200")
    visitor.close()
    server.shutdown()
    server.server_close()
