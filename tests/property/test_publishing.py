# SPDX-License-Identifier: MIT
"""[publish]: what subscribers, plotters, monitors and brokers get; slow, dead and hostile ones disturb nobody."""

from __future__ import annotations

import contextlib
import json
import os
import pathlib
import pty
import re
import shutil
import signal
import socket
import stat
import struct
import subprocess
import sys
import termios
import threading
import time
import urllib.parse
import urllib.request
from collections.abc import Iterator
from datetime import datetime
from typing import Any

import okid as okid_package
import pytest
from line_protocol_parser import parse_line
from mcap.exceptions import EndOfFile
from mcap.reader import NonSeekingReader, make_reader
from mcap_ros2.decoder import DecoderFactory
from program import PROGRAM, okid
from two_masses import rig_text, simulate_rig
from waiting import until


@pytest.fixture(scope="module")
def rig(tmp_path_factory: pytest.TempPathFactory) -> pathlib.Path:
    folder = simulate_rig(tmp_path_factory.mktemp("publish"), rig_text(60.0))
    text = (folder / "a.toml").read_text()
    text = text.replace('title = "virtual rig"', 'title = "Frame 7/b"').replace("update_s = 1.0", "update_s = 0.5")
    assert 'title = "Frame' in text and "update_s = 0.5" in text
    (folder / "a.toml").write_text(text)
    return folder


def free_port(kind: socket.SocketKind = socket.SOCK_STREAM) -> int:
    with socket.socket(socket.AF_INET, kind) as probe:
        probe.bind(("127.0.0.1", 0))
        port: int = probe.getsockname()[1]
        return port


@contextlib.contextmanager
def replaying(rig: pathlib.Path, section: str, *options: object, **how: Any) -> Iterator[subprocess.Popen[str]]:
    (rig / "b.toml").write_text((rig / "a.toml").read_text() + f"\n[publish]\n{section}\n")
    (rig / "e.jsonl").unlink(missing_ok=True)
    command = [PROGRAM, "replay", rig / "a.log", "-c", rig / "b.toml", "--events", rig / "e.jsonl", *map(str, options)]
    pipes = {"stdin": subprocess.DEVNULL, "stdout": subprocess.DEVNULL, "stderr": subprocess.PIPE} | how
    with subprocess.Popen(command, text=True, **pipes) as run:
        try:
            yield run
        finally:
            run.kill()


def connected(path: pathlib.Path) -> socket.socket:
    """A subscriber, as soon as somebody listens."""

    def attempt() -> socket.socket | None:
        one = socket.socket(socket.AF_UNIX)
        try:
            one.connect(str(path))
        except OSError:
            one.close()
            return None
        return one

    one: socket.socket = until(attempt)
    return one


def lines_of(one: socket.socket) -> list[str]:
    with one.makefile("r", encoding="utf-8") as file:
        return file.read().splitlines()


def file_lines(rig: pathlib.Path) -> list[str]:
    return (rig / "e.jsonl").read_text().splitlines()


def numbers(events: list[str], kind: str) -> list[dict[str, Any]]:
    return [event for event in map(json.loads, events) if event["type"] == kind]


def test_subscribers_of_every_kind(rig: pathlib.Path) -> None:
    """60 s of stream at ten times its speed: readers get every line, one that never reads harms nobody, one dies, one
    talks, a seventeenth is turned away."""
    path = rig / "live.sock"
    with replaying(rig, 'socket = "live.sock"', "--speed", "10") as run:
        readers = [connected(path) for _ in range(3)]
        assert stat.S_IMODE(path.stat().st_mode) == 0o660 and stat.S_ISSOCK(path.stat().st_mode)
        got: list[list[str]] = [[] for _ in readers]
        threads = [
            threading.Thread(target=lambda k=k: got[k].extend(lines_of(readers[k]))) for k in range(len(readers))
        ]
        for thread in threads:
            thread.start()
        mute = connected(path)
        mute.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 1)
        dead = connected(path)
        talker = connected(path)
        with contextlib.suppress(BrokenPipeError, ConnectionResetError):
            for _ in range(100):
                talker.sendall(b'{"type":"stop"}\n' * 1000)
        more = [connected(path) for _ in range(10)]
        late = socket.socket(socket.AF_UNIX)
        late.connect(str(path))
        late.settimeout(1800)
        assert late.recv(1) == b""
        dead.close()
        assert run.wait(1800) == 0, run.stderr
        for thread in threads:
            thread.join()
        for one in [mute, talker, *more]:
            one.close()
    whole = file_lines(rig)
    for lines in got:
        assert lines[0] == whole[0] and json.loads(lines[0])["type"] == "start"
        assert lines == [whole[0], *whole[whole.index(lines[1]) :]]  # nothing lost from when it came
        assert json.loads(lines[-1])["type"] == "result"
    assert numbers(whole, "stats")[-1]["bus"]["can0"]["lost"] == 0
    assert len(numbers(whole, "modes")) >= 110
    assert not path.exists()


def test_a_slow_one_loses_whole_lines_and_is_told(rig: pathlib.Path) -> None:
    text = (rig / "a.toml").read_text()
    often = text.replace("update_s = 0.5", "update_s = 0.02").replace("p = 12\nrows = 24", "p = 4\nrows = 8")
    (rig / "a.toml").write_text(often)  # 3,000 updates, each cheap
    try:
        with replaying(rig, 'socket = "live.sock"', "--speed", "20") as run:
            one = connected(rig / "live.sock")
            one.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
            events = rig / "e.jsonl"
            until(lambda: events.exists() and events.read_bytes().count(b"\n") > 2500)
            lines = lines_of(one)
            assert run.wait(1800) == 0
    finally:
        (rig / "a.toml").write_text(text)
    told = [json.loads(line) for line in lines]  # every line is whole
    lost = sum(event["count"] for event in told if event["type"] == "lost")
    assert lost > 0
    kept = [line for line, event in zip(lines, told, strict=True) if event["type"] != "lost"]
    whole = file_lines(rig)
    assert lost + len(kept) == len(whole) - whole.index(kept[1]) + 1
    assert told[-1]["type"] == "result"


def test_socket_files_of_others(rig: pathlib.Path) -> None:
    path = rig / "others.sock"
    stale = socket.socket(socket.AF_UNIX)
    stale.bind(str(path))
    stale.close()  # a process that died leaves it like this
    with replaying(rig, 'socket = "others.sock"') as run:
        assert run.wait(1800) == 0
    used = socket.socket(socket.AF_UNIX)
    used.bind(str(path))
    used.listen(1)
    with replaying(rig, 'socket = "others.sock"') as run:
        assert run.wait(1800) == 4
        assert run.stderr is not None and "another program listens there" in run.stderr.read()
    used.close()
    path.unlink()
    path.write_text("precious")
    with replaying(rig, 'socket = "others.sock"') as run:
        assert run.wait(1800) == 2
        assert run.stderr is not None and "found another file there" in run.stderr.read()
    assert path.read_text() == "precious" and not (rig / "e.jsonl").exists()
    path.unlink()


def test_datagrams(rig: pathlib.Path) -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as plotter:
        plotter.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 1 << 20)
        plotter.bind(("127.0.0.1", 0))
        plotter.settimeout(1800)
        with replaying(rig, f'udp = "127.0.0.1:{plotter.getsockname()[1]}"', "--speed", "30") as run:
            got = []
            while not got or got[-1]["t"] < 59.9:
                got.append(json.loads(plotter.recv(65536)))
            assert run.wait(1800) == 0
    modes = numbers(file_lines(rig), "modes")
    assert [one["t"] for one in got] == [event["t"] for event in modes]
    last, event = got[-1], modes[-1]
    assert all(isinstance(value, int | float) for value in last.values())
    assert last["timestamp"] == pytest.approx(1700000000 + event["t"], abs=1e-3)
    for mode in event["modes"]:
        assert last[f"mode{mode['track']}_frequency_hz"] == mode["frequency_hz"]
        assert last[f"mode{mode['track']}_damping_ratio"] == mode["damping_ratio"]
        assert last[f"mode{mode['track']}_frequency_std_hz"] == mode["frequency_std_hz"]
    assert last["can0_received"] > 20000 and last["can0_lost"] == 0 and last["settled"] == 1 and last["alarm"] == 0


def scrape(port: int) -> dict[str, float]:
    with urllib.request.urlopen(f"http://127.0.0.1:{port}/metrics", timeout=1800) as reply:
        text = reply.read().decode()
    return {line.rpartition(" ")[0]: float(line.rpartition(" ")[2]) for line in text.splitlines() if line[0] != "#"}


def test_prometheus(rig: pathlib.Path) -> None:
    port = free_port()
    with replaying(rig, f'prometheus = "127.0.0.1:{port}"', "--speed", "10") as run:

        def settled() -> dict[str, float] | None:
            with contextlib.suppress(OSError):
                page = scrape(port)
                if page.get("okid_settled") == 1 and 'okid_frames_received_total{bus="can0"}' in page:
                    return page
            return None

        page = until(settled)
        hostile = socket.create_connection(("127.0.0.1", port))
        with contextlib.suppress(OSError):
            hostile.sendall(b"GET /" + b"x" * 1000000)
        idle = [socket.create_connection(("127.0.0.1", port)) for _ in range(5)]
        assert run.wait(1800) == 0
        for one in [hostile, *idle]:
            one.close()
    assert page['okid_frames_lost_total{bus="can0",cause="sequence"}'] == 0
    assert page['okid_channel_completeness_percent{channel="acc1"}'] == 100
    truth = json.loads((rig / "t.json").read_text())["frequency_hz"]
    for k, f in enumerate(truth, 1):
        assert page[f'okid_mode_frequency_hz{{mode="{k}"}}'] == pytest.approx(f, rel=1e-2)
        assert page[f'okid_mode_frequency_std_hz{{mode="{k}"}}'] > 0
        assert page[f'okid_mode_damping_ratio{{mode="{k}"}}'] == pytest.approx(0.02, rel=0.2)
    assert page["okid_resident_bytes"] > 1e6 and page["okid_update_seconds"] > 0 and page["okid_updates_total"] > 3
    assert len(numbers(file_lines(rig), "modes")) >= 110  # the hostile ones disturbed nothing


def ask(port: int, request: bytes) -> bytes:
    with socket.create_connection(("127.0.0.1", port), timeout=1800) as wire:
        wire.sendall(request)
        return b"".join(iter(lambda: wire.recv(65536), b""))


def test_other_requests_get_an_answer_and_harm_nothing(rig: pathlib.Path) -> None:
    port = free_port()
    with replaying(rig, f'prometheus = "127.0.0.1:{port}"', "--speed", "10") as run:

        def page() -> bytes | None:
            with contextlib.suppress(OSError):
                return ask(port, b"GET /metrics HTTP/1.1\r\nHost: localhost\r\n\r\n")
            return None

        whole = until(page)
        head, _, body = whole.partition(b"\r\n\r\n")
        assert head.startswith(b"HTTP/1.1 200 OK") and f"Content-Length: {len(body)}".encode() in head
        assert b"# TYPE okid_settled gauge" in body
        for request, status in [
            (b"GET / HTTP/1.1\r\n\r\n", b"404"),
            (b"GET /favicon.ico HTTP/1.0\r\n\r\n", b"404"),
            (b"POST /metrics HTTP/1.1\r\nContent-Length: 3\r\n\r\nabc", b"405"),
            (b"HEAD / HTTP/1.1\r\n\r\n", b"404"),
            (b"\xff\x00\r\n\r\n", b"400"),
            (b"GET /metrics?a=b HTTP/1.1\r\n\r\n", b"200"),
            (b"GET /metrics HTTP/1.1\r\nhost:  127.0.0.1:99 \r\n\r\n", b"200"),
            (b"GET /metrics HTTP/1.1\r\nHost: [::1]:9273\r\n\r\n", b"200"),
            (b"GET /metrics HTTP/1.1\r\nHost: rebound.example:9273\r\n\r\n", b"403"),  # DNS rebinding
            (b"GET /metrics HTTP/1.1\r\nHost: localhost.evil\r\n\r\n", b"403"),
            (b"GET /metrics HTTP/1.1\r\nHost: localhost\r\nHost: a\r\n\r\n", b"403"),
            (b"GET /" + b"x" * 5000, b"431"),
        ]:
            assert ask(port, request).split()[1] == status, request
        bare = ask(port, b"HEAD /metrics HTTP/1.1\r\n\r\n")
        assert bare.startswith(b"HTTP/1.1 200 OK") and bare.endswith(b"\r\n\r\n")
        run.send_signal(signal.SIGTERM)
        asked = time.monotonic()
        assert run.wait(1800) in (0, 3)  # whether there is a model by then does not matter here
        assert time.monotonic() - asked < 10


@pytest.mark.parametrize("stdout", ["closed", "full"])
def test_nobody_reads_what_is_said(rig: pathlib.Path, stdout: str) -> None:
    """A pipe whose reader has gone, a disk that is full under stderr: the result is there, the journal closed."""
    text = (rig / "a.toml").read_text().replace('type = "socketcan"', 'type = "replay"\nfile = "a.log"')
    (rig / "q.toml").write_text(text + f'[record]\ndirectory = "quiet-{stdout}"\n')
    (rig / "q.json").unlink(missing_ok=True)
    reader, writer = os.pipe()
    os.close(reader)
    full = os.open("/dev/full", os.O_WRONLY)
    out = writer if stdout == "closed" else full
    command = [PROGRAM, "run", rig / "q.toml", "--json", rig / "q.json"]
    restored = {"restore_signals": True}  # SIGPIPE as a shell gives it
    subprocess.run(command, stdout=out, stderr=full, stdin=subprocess.DEVNULL, timeout=1800, check=False, **restored)
    os.close(writer)
    os.close(full)
    assert json.loads((rig / "q.json").read_text())["modes"]
    (path,) = (rig / f"quiet-{stdout}").glob("*.okj")
    done = okid("replay", path)
    assert done.returncode == 0 and "not closed" not in done.stderr, done.stderr


def test_a_port_that_is_taken(rig: pathlib.Path) -> None:
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen(1)
        with replaying(rig, f'prometheus = "127.0.0.1:{taken.getsockname()[1]}"') as run:
            assert run.wait(1800) == 4
            assert run.stderr is not None and "is the port taken" in run.stderr.read()


def test_what_listens_beyond_this_computer_is_said(rig: pathlib.Path) -> None:
    with replaying(rig, f'prometheus = "0.0.0.0:{free_port()}"\nudp = "192.0.2.1:9870"') as run:
        assert run.wait(1800) == 0
        assert run.stderr is not None
        text = run.stderr.read()
        assert "anyone who reaches that address" in text and "beyond this computer" in text
    with replaying(rig, f'prometheus = "127.0.0.1:{free_port()}"\nudp = "127.0.0.1:9"') as run:
        assert run.wait(1800) == 0
        assert run.stderr is not None and run.stderr.read() == ""


class Packets:
    """MQTT 3.1.1 as far as a subscriber of everything needs it."""

    def __init__(self, port: int) -> None:
        self.wire = socket.create_connection(("127.0.0.1", port))
        self.wire.settimeout(1800)
        self.send(0x10, b"\0\4MQTT\4\2\0\x3c" + b"\0\4test")
        assert self.read()[0] == 0x20
        self.send(0x82, b"\0\1\0\1#\0")
        assert self.read()[0] == 0x90

    def send(self, kind: int, body: bytes) -> None:
        assert len(body) < 128
        self.wire.sendall(bytes([kind, len(body)]) + body)

    def exactly(self, count: int) -> bytes:
        data = b""
        while len(data) < count:
            more = self.wire.recv(count - len(data))
            assert more
            data += more
        return data

    def read(self) -> tuple[int, bytes]:
        kind, size, shift = self.exactly(1)[0], 0, 0
        while True:
            byte = self.exactly(1)[0]
            size |= (byte & 127) << shift
            shift += 7
            if not byte & 128:
                return kind, self.exactly(size)

    def message(self) -> tuple[str, str]:
        body = self.read()[1]
        (length,) = struct.unpack_from(">H", body)
        return body[2 : 2 + length].decode(), body[2 + length :].decode()


@contextlib.contextmanager
def broker(port: int, folder: pathlib.Path) -> Iterator[None]:
    (folder / "broker.conf").write_text(f"listener {port} 127.0.0.1\nallow_anonymous true\n")
    program = shutil.which("mosquitto") or "/usr/sbin/mosquitto"
    with subprocess.Popen([program, "-c", folder / "broker.conf"], stderr=subprocess.DEVNULL) as run:
        try:
            until(lambda: port_is_open(port))
            yield
        finally:
            run.terminate()


def port_is_open(port: int) -> bool:
    with contextlib.suppress(OSError), socket.create_connection(("127.0.0.1", port)):
        return True
    return False


@pytest.mark.programs
def test_mqtt(rig: pathlib.Path) -> None:
    port = free_port()
    with broker(port, rig):
        everything = Packets(port)
        with replaying(rig, f'mqtt = "mqtt://127.0.0.1:{port}/lab"', "--speed", "20") as run:
            got = []
            while not got or got[-1][0] != "lab/Frame_7_b/result":
                got.append(everything.message())
            assert run.wait(1800) == 0
    whole = file_lines(rig)
    kinds = {topic.rpartition("/")[2] for topic, _ in got}
    assert {"modes", "stats", "result"} <= kinds
    at = whole.index(got[0][1])  # it takes a moment to connect; from then on nothing is missing
    assert at < 20 and [text for _, text in got] == whole[at:]
    assert all(topic == f"lab/Frame_7_b/{json.loads(text)['type']}" for topic, text in got)


@pytest.mark.programs
def test_home_assistant_is_told_when_it_is_asked_for(rig: pathlib.Path) -> None:
    port = free_port()
    with broker(port, rig):
        section = f'mqtt = "mqtt://127.0.0.1:{port}/lab"\ndiscovery = true'
        with replaying(rig, section, "--speed", "20") as run:
            assert run.wait(1800) == 0
        kept = Packets(port)  # what a Home Assistant that starts later gets
        told = {}
        while len(told) < 4:
            topic, text = kept.message()
            if topic.startswith("homeassistant/"):
                told[topic] = json.loads(text)
    tracks = {mode["track"] for event in numbers(file_lines(rig), "modes") for mode in event["modes"]} - {None}
    assert tracks == {1, 2}
    for track, word, unit in ((1, "frequency", "Hz"), (2, "damping", "%")):
        one = told[f"homeassistant/sensor/okid_Frame_7_b/mode{track}_{word}/config"]
        assert one["state_topic"] == "lab/Frame_7_b/modes" and one["unit_of_measurement"] == unit
        assert one["unique_id"] == f"okid_Frame_7_b_mode{track}_{word}"
        assert f"'track', 'eq', {track}" in one["value_template"]


def points(text: str) -> list[tuple[str, dict[str, str], dict[str, Any], int]]:
    """Line protocol as another reader takes it: measurement, tags, fields, ns; every line is one."""
    found = [parse_line(line) for line in text.splitlines()]
    return [(one["measurement"], one["tags"], one["fields"], one["time"]) for one in found]


def assert_influx(text: str, events: list[str]) -> None:
    """Every frequency of every tracked mode with the digits of the event, at its time."""
    start = json.loads(events[0])
    begin = datetime.fromisoformat(start["wall_time"]).timestamp()
    seen = [(int(tags["mode"]), of["frequency_hz"], ns) for name, tags, of, ns in points(text) if name == "okid_mode"]
    wanted = [
        (mode["track"], mode["frequency_hz"], event["t"])
        for event in numbers(events, "modes")
        for mode in event["modes"]
        if mode["track"] is not None
    ]
    assert [one[:2] for one in seen] == [one[:2] for one in wanted] and seen
    assert all(abs(ns / 1e9 - begin - t) < 0.1 for (_, _, ns), (_, _, t) in zip(seen, wanted, strict=True))
    last = [
        of for name, tags, of, _ in points(text) if name == "okid_bus" and tags == {"rig": "Frame_7_b", "bus": "can0"}
    ][-1]
    assert last["received"] == numbers(events, "stats")[-1]["bus"]["can0"]["received"]


def test_influx_lines_in_a_file(rig: pathlib.Path) -> None:
    with replaying(rig, 'influx = "out.lp"') as run:
        assert run.wait(1800) == 0
    assert_influx((rig / "out.lp").read_text(), file_lines(rig))


@contextlib.contextmanager
def database(folder: pathlib.Path) -> Iterator[tuple[int, int]]:
    """An InfluxDB with the database `rig`; its ports for HTTP and for datagrams."""
    web, ear = free_port(), free_port(socket.SOCK_DGRAM)
    (folder / "influxdb.conf").write_text(
        f'reporting-disabled = true\nbind-address = "127.0.0.1:{free_port()}"\n'
        f'[meta]\ndir = "{folder}/meta"\n[data]\ndir = "{folder}/data"\nwal-dir = "{folder}/wal"\n'
        f'[http]\nbind-address = "127.0.0.1:{web}"\n'
        f'[[udp]]\nenabled = true\nbind-address = "127.0.0.1:{ear}"\ndatabase = "rig"\nbatch-timeout = "100ms"\n'
    )
    command = ["influxd", "-config", folder / "influxdb.conf"]
    with subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL) as server:
        try:
            until(lambda: asked(web, "CREATE DATABASE rig"))
            yield web, ear
        finally:
            server.kill()


def asked(web: int, question: str) -> Any:
    """The answer of the database, None while it does not listen."""
    data = urllib.parse.urlencode({"db": "rig", "epoch": "ns", "q": question}).encode()
    try:
        with urllib.request.urlopen(f"http://127.0.0.1:{web}/query", data, timeout=1800) as answer:
            return json.load(answer)["results"][0]
    except OSError:
        return None


@pytest.mark.programs
@pytest.mark.parametrize("way", ["http", "udp"])
def test_a_database_holds_what_was_told(rig: pathlib.Path, tmp_path: pathlib.Path, way: str) -> None:
    """InfluxDB itself gives back the bits of every frequency at its time; of datagrams those that came."""
    with database(tmp_path) as (web, ear):
        address = f"http://127.0.0.1:{web}/write?db=rig" if way == "http" else f"udp://127.0.0.1:{ear}"
        with replaying(rig, f'influx = "{address}"') as run:
            assert run.wait(1800) == 0
        events = file_lines(rig)
        begin = datetime.fromisoformat(json.loads(events[0])["wall_time"]).timestamp()
        wanted = {
            (mode["track"], round(event["t"], 1)): (mode["frequency_hz"], mode["damping_ratio"])
            for event in numbers(events, "modes")
            for mode in event["modes"]
            if mode["track"] is not None
        }

        def held() -> dict[tuple[int, float], tuple[float, float]]:
            found = asked(web, "SELECT frequency_hz, damping_ratio, mode FROM okid_mode WHERE rig = 'Frame_7_b'")
            rows = found["series"][0]["values"] if "series" in found else []
            return {(int(mode), round(ns / 1e9 - begin, 1)): (f, zeta) for ns, f, zeta, mode in rows}

        until(lambda: len(held()) == len(wanted) or (way == "udp" and len(held()) > 50))
        got = held()
        assert len(wanted) > 100 and all(wanted[key] == value for key, value in got.items())
        bus = asked(web, "SELECT LAST(received) FROM okid_bus WHERE bus = 'can0'")["series"][0]["values"][0][1]
        assert bus == numbers(events, "stats")[-1]["bus"]["can0"]["received"] or way == "udp"


def test_influx_lines_by_datagrams(rig: pathlib.Path) -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as ear:
        ear.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 1 << 20)
        ear.bind(("127.0.0.1", 0))
        ear.settimeout(1.0)
        with replaying(rig, f'influx = "udp://127.0.0.1:{ear.getsockname()[1]}"') as run:
            assert run.wait(1800) == 0
        got = []
        with contextlib.suppress(TimeoutError):
            while True:
                got.append(ear.recv(65536).decode())
    assert all(one.endswith("\n") and len(one) <= 1400 for one in got)
    assert_influx("".join(got), file_lines(rig))


def test_influx_by_http_keeps_what_is_not_taken(rig: pathlib.Path) -> None:
    """The first request gets no answer, the second is told to come again: nothing is lost, nothing doubled."""
    (rig / "token").write_text("s3cret\n")
    requests: list[tuple[str, str, str]] = []
    replies = [b"", b"HTTP/1.1 503 Service Unavailable\r\n\r\n"]

    def serve(door: socket.socket) -> None:
        while True:
            try:
                visitor, _ = door.accept()
            except OSError:
                return
            with visitor, visitor.makefile("rb") as wire:
                first = wire.readline().decode().strip()
                heads = {
                    k.lower(): v.strip()
                    for k, _, v in (h.decode().partition(":") for h in iter(wire.readline, b"\r\n"))
                }
                body = wire.read(int(heads["content-length"])).decode()
                reply = replies.pop(0) if replies else b"HTTP/1.1 204 No Content\r\n\r\n"
                if b"204" in reply:
                    requests.append((first, heads["authorization"], body))
                visitor.sendall(reply)

    with socket.create_server(("127.0.0.1", 0)) as door:
        threading.Thread(target=serve, args=(door,), daemon=True).start()
        url = f"http://127.0.0.1:{door.getsockname()[1]}/api/v2/write?org=lab&bucket=rig"
        with replaying(rig, f'influx = "{url}"\ninflux_token_file = "token"', "--speed", "8") as run:
            assert run.wait(1800) == 0
            assert run.stderr is not None and run.stderr.read().count("the run goes on") == 1
        door.shutdown(socket.SHUT_RDWR)
    assert {one[:2] for one in requests} == {("POST /api/v2/write?org=lab&bucket=rig HTTP/1.1", "Token s3cret")}
    assert_influx("".join(body for _, _, body in requests), file_lines(rig))


@pytest.mark.programs
def test_a_broker_that_is_away_and_comes(rig: pathlib.Path) -> None:
    port = free_port()
    with replaying(rig, f'mqtt = "mqtt://127.0.0.1:{port}"', "--speed", "6") as run:
        until(lambda: len(file_lines(rig)) > 5 if (rig / "e.jsonl").exists() else False)
        with broker(port, rig):
            assert json.loads(Packets(port).message()[1])["type"]
        assert run.wait(1800) == 0
        assert run.stderr is not None and run.stderr.read().count("trying again") == 1
    assert len(numbers(file_lines(rig), "modes")) >= 110


@pytest.mark.parametrize(
    ("section", "texts"),
    [
        ('udp = "9870 "', ["[publish]", '"udp"', "127.0.0.1:9870"]),
        ('udp = "127.0.0.1"', ['"udp"', "an address and a port"]),
        ('udp = "127.0.0.1:70000"', ['"udp"']),
        ('prometheus = "host.example:9273"', ['"prometheus"', "numeric"]),
        ('mqtt = "localhost"', ['"mqtt"', "mqtt://host"]),
        ('mqtt = "mqtt://"', ['"mqtt"']),
        ('mqtt = "mqtt://localhost/a/#"', ['"mqtt"']),
        ('influx = "udp://127.0.0.1"', ['"influx"', "udp://host:port"]),
        ('influx = "https://db.example/"', ['"influx"', "http://host:port"]),
        ('influx = "http://db.example/write?u=me&p=secret"', ['"influx"', "influx_token_file"]),
        ('influx = "out.lp"\ninflux_token_file = "t"', ['"influx_token_file"', "expected influx"]),
        ("discovery = true", ['"discovery"', "expected mqtt"]),
        (f'socket = "{"x" * 120}"', ['"socket"', "at most 107"]),
        ("socket = 7", ['"socket"', "found 7"]),
    ],
)
def test_wrong_addresses(rig: pathlib.Path, section: str, texts: list[str]) -> None:
    (rig / "c.toml").write_text((rig / "a.toml").read_text() + f"\n[publish]\n{section}\n")
    done = okid("check", rig / "c.toml")
    assert done.returncode == 2
    for text in texts:
        assert text in done.stderr, done.stderr


@contextlib.contextmanager
def into_mcap(rig: pathlib.Path, target: pathlib.Path) -> Iterator[tuple[subprocess.Popen[str], subprocess.Popen[str]]]:
    """A replay, held until okid-convert listens to it, and that okid-convert."""
    path = rig / "mcap.sock"
    path.unlink(missing_ok=True)
    with replaying(rig, 'socket = "mcap.sock"\nsamples = true', "--speed", "30") as run:
        connected(path).close()  # it listens
        run.send_signal(signal.SIGSTOP)
        command = [sys.executable, "-m", "okid.formats.command", str(path), str(target)]
        environment = os.environ | {"PYTHONPATH": str(pathlib.Path(okid_package.__file__).parents[1])}
        with subprocess.Popen(command, stdout=subprocess.PIPE, text=True, env=environment) as writer:
            until(target.exists)
            run.send_signal(signal.SIGCONT)
            yield run, writer


@pytest.mark.parametrize("name", ["live.mcap", "live.ros2.mcap"])
def test_a_live_mcap_file(rig: pathlib.Path, tmp_path: pathlib.Path, name: str) -> None:
    """To the last line of the run, as readers of MCAP and of ROS 2 see it; a slow reader may have lost some."""
    target = tmp_path / name
    with into_mcap(rig, target) as (run, writer):
        assert run.wait(1800) == 0
        assert writer.stdout is not None and "events and blocks of signals" in writer.stdout.read()
    assert writer.returncode == 0
    wanted = [
        (mode["track"], mode["frequency_hz"])
        for event in numbers(file_lines(rig), "modes")
        for mode in event["modes"]
        if mode["track"] is not None
    ]
    with target.open("rb") as file:
        reader = make_reader(file, validate_crcs=True, decoder_factories=[DecoderFactory()])
        if name == "live.mcap":
            seen = [(channel.topic, json.loads(one.data)) for _, channel, one in reader.iter_messages()]
            listed = [mode for topic, one in seen if topic == "/modes" for mode in one["modes"]]
            modes = [(mode["track"], mode["frequency_hz"]) for mode in listed if mode["track"] is not None]
            signals = [one for topic, one in seen if topic == "/signals"]
            numbered = [one["sample"] for one in signals]
            assert len(numbered) > 1000 and numbered == sorted(set(numbered))
        else:
            read = [(channel.topic, one.data) for _, channel, _, one in reader.iter_decoded_messages()]
            heads = [(re.fullmatch(r"/okid/mode(\d)/frequency_hz", topic), value) for topic, value in read]
            modes = [(int(head[1]), value) for head, value in heads if head]
            assert sum(topic == "/okid/signals/force1" for topic, _ in read) > 1000
            told = [json.loads(text) for topic, text in read if topic == "/okid/events"]
            assert (told[0]["type"], told[-1]["type"]) == ("start", "result")
    assert len(modes) > 50 and set(modes) <= set(wanted)


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGKILL])
def test_a_live_mcap_file_cut_off(rig: pathlib.Path, tmp_path: pathlib.Path, number: signal.Signals) -> None:
    """SIGTERM ends it well; after SIGKILL what was written is read up to the last chunk."""
    target = tmp_path / "cut.mcap"
    with into_mcap(rig, target) as (_, writer):
        until(lambda: target.stat().st_size > 30_000)
        writer.send_signal(number)
        assert writer.wait(1800) == (0 if number == signal.SIGTERM else -number)
    count = 0
    with target.open("rb") as file, contextlib.suppress(EndOfFile):
        for _ in NonSeekingReader(file).iter_messages(log_time_order=False):
            count += 1
    assert count > 100


def test_hang_up_opens_the_events_file_again(rig: pathlib.Path) -> None:
    events, old = rig / "e.jsonl", rig / "e.jsonl.1"
    old.unlink(missing_ok=True)
    with replaying(rig, 'udp = "9870"', "--speed", "20") as run:
        until(lambda: len(file_lines(rig)) > 5 if events.exists() else False)
        events.rename(old)
        run.send_signal(signal.SIGHUP)
        until(events.exists)
        assert run.wait(1800) == 0
    first, second = old.read_text().splitlines(), file_lines(rig)
    assert json.loads(first[0])["type"] == "start" and json.loads(second[-1])["type"] == "result"
    with replaying(rig, 'udp = "9870"') as run:
        assert run.wait(1800) == 0
    assert first + second == file_lines(rig)


def screen_of(data: str, width: int, height: int) -> list[str]:
    """What a terminal of that size shows: lines, wrapping, cursor up, erase below."""
    rows: list[list[str]] = [[]]
    row = column = 0
    at = 0
    while at < len(data):
        c = data[at]
        at += 1
        if c == "\x1b":
            end = at + 1
            while not data[end].isalpha():
                end += 1
            count = data[at + 1 : end]
            if data[end] == "A":
                row = max(max(0, len(rows) - height), row - int(count))
            elif data[end] == "J":
                rows[row] = rows[row][:column]
                del rows[row + 1 :]
            else:
                assert data[end] == "m"
            at = end + 1
        elif c == "\r":
            column = 0
        elif c == "\n":
            row += 1
            if row == len(rows):
                rows.append([])
        else:
            if column == width:
                column, row = 0, row + 1
                if row == len(rows):
                    rows.append([])
            line = rows[row]
            line.extend(" " * (column + 1 - len(line)))
            line[column] = c
            column += 1
    return ["".join(line).rstrip() for line in rows]


def on_terminal(rig: pathlib.Path, width: int, height: int, **environment: str) -> tuple[str, list[str]]:
    near, far = pty.openpty()
    termios.tcsetwinsize(far, (height, width))
    variables = {key: value for key, value in os.environ.items() if key != "NO_COLOR"} | {"TERM": "xterm"} | environment
    data = b""
    with replaying(rig, 'udp = "9870"', "--speed", "15", stdout=far, env=variables) as run:
        os.close(far)
        with contextlib.suppress(OSError):
            while chunk := os.read(near, 65536):
                data += chunk
        assert run.wait(1800) == 0
    os.close(near)
    text = data.decode()
    return text, screen_of(text, width, height)


def test_table_in_place(rig: pathlib.Path) -> None:
    text, screen = on_terminal(rig, 90, 30)
    assert text.count("f [Hz]") > 10  # drawn many times …
    assert sum("f [Hz]" in line for line in screen) == 2  # … and stands there once, the result's own below
    assert "\x1b[32m" in text and max(map(len, screen)) <= 90
    narrow, screen = on_terminal(rig, 40, 30, NO_COLOR="1")
    assert "\x1b[3" not in narrow
    assert sum(line.startswith("track") for line in screen) == 1


def test_a_stopped_terminal_stops_nothing(rig: pathlib.Path) -> None:
    """Nobody reads the terminal, as after Ctrl-S: events, subscribers and the end of the run do not wait for it."""
    near, far = pty.openpty()
    termios.tcflow(far, termios.TCOOFF)
    with replaying(rig, 'socket = "live.sock"', "--speed", "20", "--json", rig / "r.json", stdout=far) as run:
        one = connected(rig / "live.sock")
        assert json.loads(lines_of(one)[-1])["type"] == "result"
        until(lambda: json.loads(file_lines(rig)[-1])["type"] == "result")
        termios.tcflow(far, termios.TCOON)  # the result's table is printed to the end, as ever
        os.close(far)
        with contextlib.suppress(OSError):
            while os.read(near, 65536):
                pass
        assert run.wait(1800) == 0
    os.close(near)


def test_signals_for_those_who_ask(rig: pathlib.Path) -> None:
    """[publish] samples: every sample of every channel in engineering units on the socket, none in the events file; one
    who reads too slowly loses signals before it loses events."""
    with replaying(rig, 'socket = "live.sock"\nsamples = true', "--speed", "10") as run:
        reader, slow = connected(rig / "live.sock"), connected(rig / "live.sock")
        slow.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 1)
        whole = lines_of(reader)
        assert run.wait(1800) == 0
    start = json.loads(whole[0])
    assert start["rate_hz"] == 250.0
    assert start["channels"] == [
        {"name": "force1", "role": "force", "unit": "N", "dof": 1},
        {"name": "acc1", "role": "acceleration", "unit": "m/s^2", "dof": 1},
        {"name": "acc2", "role": "acceleration", "unit": "m/s^2", "dof": 2},
    ]
    blocks = numbers(whole, "samples")
    names = [channel["name"] for channel in start["channels"]]
    header, *rows = [line for line in (rig / "a.csv").read_text().splitlines() if not line.startswith("#")]
    columns = {name: k for k, name in enumerate(header.split(","))}
    truth = [[float(row.split(",")[columns[name]]) for name in names] for row in rows]
    assert [b["first"] for b in blocks] == list(range(blocks[0]["first"], len(truth), blocks[0]["count"]))
    assert all(len(values) == block["count"] for block in blocks for values in block["values"])
    seen = [list(row) for block in blocks for row in zip(*block["values"], strict=True)]
    first = blocks[0]["first"]
    worst = max(abs(a - b) for x, y in zip(seen, truth[first:], strict=True) for a, b in zip(x, y, strict=True))
    assert worst < 2e-3, worst  # one step of the 16-bit codes
    assert blocks[-1]["t"] == pytest.approx(60.0) and 11 <= blocks[0]["count"] <= 13
    assert [line for line in whole if '"type":"samples"' not in line] == file_lines(rig)


def test_signals_need_a_socket(rig: pathlib.Path) -> None:
    (rig / "c.toml").write_text((rig / "a.toml").read_text() + "\n[publish]\nsamples = true\n")
    done = okid("check", rig / "c.toml")
    assert done.returncode == 2 and '[publish], key "samples": found true, expected socket' in done.stderr, done.stderr
