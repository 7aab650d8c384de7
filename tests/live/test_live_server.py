# SPDX-License-Identifier: MIT
"""okid-live as a web server: what it answers, to whom, how it begins and ends. No browser."""

from __future__ import annotations

import contextlib
import gzip
import os
import signal
import socket
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from event_source import Listener, ask
from live_process import Live
from okid.live import main
from okid.live.server import host_of, is_loopback
from okid_feed import WHOLE, OkidFeed, channel, modes, start
from waiting import until

CHANNELS = [channel("f", "force", "N", 1), channel("a", "acceleration", "m/s^2", 1)]


@pytest.fixture
def config(tmp_path: Path) -> Path:
    (tmp_path / "a.toml").write_text(WHOLE + '[publish]\nsocket = "s"\nsamples = true\n')
    return tmp_path / "a.toml"


@pytest.fixture(scope="module")
def live(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Live]:
    """One server for all that only ask."""
    folder = tmp_path_factory.mktemp("shared")
    (folder / "a.toml").write_text(WHOLE + '[publish]\nsocket = "s"\n')
    one = Live(folder / "a.toml")
    yield one
    assert one.end() == (0, "")


def test_files_of_the_page(live: Live) -> None:
    status, headers, data = ask(live.port)
    assert status == 200 and headers["content-type"].startswith("text/html") and b"<main>" in data
    policy = headers["content-security-policy"]
    assert policy.startswith("default-src 'self';") and "script" not in policy and "http" not in policy
    assert headers["x-content-type-options"] == "nosniff" and headers["cache-control"] == "no-store"
    for name in ("live.js", "lanes.js", "plots.js", "tables.js", "structure.js", "pens.js", "shapes.js"):
        status, headers, data = ask(live.port, f"/{name}")
        assert status == 200 and headers["content-type"].startswith("text/javascript"), name
        assert b"innerHTML" not in data and b"outerHTML" not in data and b"insertAdjacent" not in data
    status, headers, data = ask(live.port, "/plotly.js")
    assert headers["content-encoding"] == "gzip" and b"plotly.js" in gzip.decompress(data)[:200]
    page = ask(live.port)[2].decode()
    assert "http://" not in page and "https://" not in page


@pytest.mark.parametrize(
    "path",
    ["/nothing", "/../command.py", "/web/live.js", "/live.js/", "/%2e%2e/pyproject.toml", "/live.html",
     "/..%2f..%2fetc/passwd", "/etc/passwd", "/events/", "/live.js%00"],
)  # fmt: skip
def test_other_paths_are_not_there(live: Live, path: str) -> None:
    assert ask(live.port, path)[0] == 404
    assert ask(live.port, path, "POST")[0] == 405
    assert ask(live.port, "/", "HEAD")[0] == 200


def test_only_names_of_this_computer(live: Live) -> None:
    for good in (f"127.0.0.1:{live.port}", "localhost", "LOCALHOST:9999", "[::1]:80"):
        assert ask(live.port, "/", Host=good)[0] == 200, good
    for bad in (
        "evil.example",
        f"evil.example:{live.port}",
        "127.0.0.1.evil.example",
        "",
        "localhost.evil.example:8765",
    ):
        for path in ("/", "/events", "/spectra?channels=0"):
            assert ask(live.port, path, Host=bad)[0] == 403, bad
    for head in (b"", b"Host: localhost\r\nHost: evil.example\r\n"):
        with socket.create_connection(("127.0.0.1", live.port), timeout=1800) as wire:
            wire.sendall(b"GET / HTTP/1.1\r\n" + head + b"\r\n")
            assert wire.recv(100).split()[1] == b"403"


def test_names_in_host_headers() -> None:
    assert host_of("[::1]:8765") == "::1" and host_of("Lab-PC:80") == "lab-pc" and host_of("127.0.0.1") == "127.0.0.1"
    assert is_loopback("127.0.0.1") and is_loopback("localhost") and is_loopback("::1") and is_loopback("127.8.8.8")
    assert not is_loopback("0.0.0.0") and not is_loopback("::") and not is_loopback("lab-pc")


def test_damaged_requests_harm_nothing(live: Live) -> None:
    many_fields = b"GET / HTTP/1.1\r\n" + b"A: b\r\n" * 2000 + b"\r\n"
    strange = b"BREW / HTTP/1.1\r\nHost: localhost\r\n\r\n"
    for request in (b"\xff\x00\r\n\r\n", b"GET /" + b"x" * 100000, b"GET\r\n\r\n", strange, many_fields):
        with socket.create_connection(("127.0.0.1", live.port), timeout=1800) as wire:
            reply = b""
            with contextlib.suppress(OSError):  # the server may have hung up already
                wire.sendall(request)
                wire.shutdown(socket.SHUT_WR)
                reply = wire.recv(200)
            assert b" 200 " not in reply
    for query in ("", "?channels=0", "?channels=99", "?channels=x", "?output=-1", "?channels=" + "1," * 3000):
        assert ask(live.port, "/spectra" + query)[0] in (200, 400), query
    assert ask(live.port)[0] == 200


def test_several_pages_see_the_same_and_a_stalled_one_holds_up_nobody(
    config: Path, okid_live: Callable[..., Any]
) -> None:
    feed = OkidFeed(config.parent / "s")
    live = okid_live(config)
    feed.accept()
    feed.send(start(CHANNELS))
    stalled = socket.create_connection(("127.0.0.1", live.port))
    stalled.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 1)
    stalled.sendall(b"GET /events HTTP/1.1\r\nHost: localhost\r\n\r\n")
    pages = [Listener(live.port) for _ in range(3)]
    assert [page.event()[0] for page in pages] == ["hello"] * 3
    for k in range(1, 400):
        feed.send(modes(float(k), [10.0] * 30))  # written without waiting: the server takes all of it in
    for page in pages:
        assert next(event["t"] for kind, event in page.events() if kind == "modes" and event["t"] == 399.0)
    feed.close()
    code, errors = live.end()
    assert code == 0 and errors == ""
    stalled.close()


def test_a_seventeenth_page_is_turned_away(config: Path, okid_live: Callable[..., Any]) -> None:
    live = okid_live(config)
    pages = [Listener(live.port) for _ in range(16)]
    assert ask(live.port, "/events")[0] == 503
    pages[0].event()
    pages[0].close()
    late = until(lambda: again(live.port))
    assert late.event()[0] == "hello"


def again(port: int) -> Listener | None:
    try:
        return Listener(port)
    except AssertionError:
        return None


@pytest.mark.parametrize("how", [signal.SIGINT, signal.SIGTERM])
def test_signals_end_it_with_0(config: Path, okid_live: Callable[..., Any], how: signal.Signals) -> None:
    live = okid_live(config)
    page = Listener(live.port)
    assert page.event()[1]["state"]["text"] == "waiting for okid"
    assert live.end(how) == (0, "")


def test_help_has_an_example(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as done:
        main(["--help"])
    text = capsys.readouterr().out
    assert done.value.code == 0 and "example: okid-live frame.toml" in text and "--socket" in text


@pytest.mark.parametrize(
    ("text", "more", "code", "found"),
    [
        ("[publish]\n", (), 2, '[publish] "socket" is missing'),
        ("[publish\n", (), 2, "a.toml: line "),
        ("", ("--port", "70000"), 2, "--port is 70000"),
        (None, (), 2, "No such file or directory"),
        ('[publish]\nsocket = "s"\n', ("--host", "192.0.2.1"), 4, "--host 192.0.2.1: Cannot assign"),
        ('[publish]\nsocket = "s"\n', ("--host", "no.such.host.invalid"), 4, "no.such.host.invalid"),
    ],
)
def test_what_is_wrong_is_one_line(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], text: str | None, more: tuple[str, ...], code: int, found: str
) -> None:
    if text is not None:
        (tmp_path / "a.toml").write_text(WHOLE + text)
    assert main([str(tmp_path / "a.toml"), *more]) == code
    said = capsys.readouterr()
    assert said.out == ""
    assert said.err.startswith("okid-live: ") and found in said.err and said.err.count("\n") == 1


def test_a_port_that_is_taken(config: Path, capsys: pytest.CaptureFixture[str]) -> None:
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen(1)
        port = taken.getsockname()[1]
        assert main([str(config), "--port", str(port)]) == 4
    said = capsys.readouterr().err
    assert f"127.0.0.1 port {port}: Address already in use" in said and said.count("\n") == 1


@pytest.mark.parametrize("host", ["nosuch.invalid", "192.0.2.1", "a..b"])
def test_a_host_that_is_not_ours_is_named(config: Path, capsys: pytest.CaptureFixture[str], host: str) -> None:
    assert main([str(config), "--host", host, "--port", "0"]) == 4
    said = capsys.readouterr().err
    assert f"--host {host}: " in said and "127.0.0.1" in said and "--port" not in said and said.count("\n") == 1


def test_a_file_is_no_socket(config: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for name, kind in ((config, "a file"), (config.parent, "a folder")):
        assert main([str(config), "--socket", str(name)]) == 2
        said = capsys.readouterr().err
        assert f"{name}: is {kind}, expected the socket" in said and said.count("\n") == 1


def test_an_address_beyond_this_computer_is_said(config: Path, okid_live: Callable[..., Any]) -> None:
    live = okid_live(config, "--host", "0.0.0.0")
    assert ask(live.port)[0] == 200 and ask(live.port, "/", Host="evil.example")[0] == 403
    code, errors = live.end()
    assert code == 0 and "anyone who reaches that address" in errors and errors.count("\n") == 1


def test_a_socket_by_name(config: Path, tmp_path: Path, okid_live: Callable[..., Any]) -> None:
    feed = OkidFeed(tmp_path / "other")
    live = okid_live(config, "--socket", os.path.relpath(tmp_path / "other"))
    feed.accept()
    feed.send(start(CHANNELS), modes(1.0, [10.0]))
    page = Listener(live.port)
    kind, hello = page.event()
    seen = hello["modes"] or next(event for kind, event in page.events() if kind == "modes")
    assert kind == "hello" and seen["t"] == 1.0
    feed.close()
