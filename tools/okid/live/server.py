# SPDX-License-Identifier: MIT
"""The web server of the page: a fixed list of files, the stream of events, the spectra; and what a desk takes of those
who know its token."""

from __future__ import annotations

import contextlib
import ipaddress
import json
import math
import socket
import threading
import time
from http import HTTPStatus
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from typing import Any
from urllib.parse import parse_qs, urlsplit

from okid._errors import Error
from okid.live.assets import Assets
from okid.live.desk import Busy, Desk
from okid.live.session import Session

# Styles in the page and data: pictures are plotly.js's own; nothing that came from okid ever becomes markup.
POLICY = (
    "default-src 'self'; style-src 'self' 'unsafe-inline'; img-src 'self' data:; base-uri 'none'; form-action 'none'; "
    "frame-ancestors 'none'; object-src 'none'"
)
HEADERS = {
    "Content-Security-Policy": POLICY,
    "X-Content-Type-Options": "nosniff",
    "Referrer-Policy": "no-referrer",
    "Cross-Origin-Resource-Policy": "same-origin",
}
REQUEST_S, ANSWER_S, STALLED_S, HEARTBEAT_S = 10.0, 120.0, 20.0, 5.0
MOST_VISITORS = 48  # connections at a time: 16 pages and what they fetch
MOST_SPECTRA = 8
MOST_ASKED = 1 << 20  # bytes of a wish that is no file
TOKEN = "X-Okid-Token"


def is_loopback(host: str) -> bool:
    """Does that address (or localhost) stay on this computer?"""
    if host == "localhost":
        return True
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:
        return False


def host_of(header: str) -> str:
    """The name in a Host header, without port and brackets, in small letters."""
    name = header.strip().lower()
    if name.startswith("["):
        return name[1:].partition("]")[0]
    return name.partition(":")[0]


class PageServer(ThreadingHTTPServer):
    """Serves the page of one Session on an address; nothing can be sent to it without a desk. Raises OSError when the
    address is not available."""

    daemon_threads = True
    block_on_close = False
    request_queue_size = 32

    def __init__(self, session: Session, host: str, port: int, desk: Desk | None = None) -> None:
        self.session, self.host, self.assets, self.desk = session, host, Assets(), desk
        family, *_, address = socket.getaddrinfo(host, port, type=socket.SOCK_STREAM, flags=socket.AI_PASSIVE)[0]
        self.address_family = family
        self.allowed = {"127.0.0.1", "localhost", "::1", host.lower()}
        self._visitors: dict[socket.socket, float] = {}  # when their time to ask is over; inf: a page, which stays
        self._door = threading.Lock()
        super().__init__(address[:2], _Handler)

    def server_bind(self) -> None:
        """Bind; the name of this computer is not looked up, that can take long."""
        self.socket.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        self.socket.bind(self.server_address)
        self.server_address = self.socket.getsockname()
        self.server_name, self.server_port = self.host, self.server_address[1]

    @property
    def url(self) -> str:
        """Where the page is."""
        return f"http://{f'[{self.host}]' if ':' in self.host else self.host}:{self.server_port}/"

    def get_request(self) -> tuple[socket.socket, Any]:
        """The next connection. Without a descriptor it waits in the queue, and a pause keeps this from a busy loop."""
        try:
            return super().get_request()
        except OSError:
            time.sleep(0.1)
            raise

    def process_request(self, request: Any, client_address: Any) -> None:
        """A thread for each visitor, MOST_VISITORS at most: then the one that has taken longest to ask makes room, and
        when all of them are pages the new one is turned away."""
        with self._door:
            full = len(self._visitors) >= MOST_VISITORS
            oldest = min(self._visitors, key=lambda one: self._visitors[one]) if full else None
            if oldest is not None and self._visitors[oldest] < math.inf:
                self._end(oldest)
            elif full:
                oldest = request
            if oldest is not request:
                self._visitors[request] = time.monotonic() + REQUEST_S
        if oldest is request:
            self.shutdown_request(request)
            return
        try:
            super().process_request(request, client_address)
        except RuntimeError:  # no thread can be begun
            self.shutdown_request(request)

    def _end(self, visitor: socket.socket) -> None:
        """Its thread hears the end of the connection."""
        self._visitors.pop(visitor, None)
        with contextlib.suppress(OSError):
            visitor.shutdown(socket.SHUT_RDWR)

    def shutdown_request(self, request: Any) -> None:
        """The end of a visit."""
        with self._door:
            self._visitors.pop(request, None)
        super().shutdown_request(request)

    def service_actions(self) -> None:
        """Twice a second: who has not asked within REQUEST_S, byte by byte or not, goes."""
        now = time.monotonic()
        with self._door:
            for visitor in [one for one, until in self._visitors.items() if until < now]:
                self._end(visitor)

    def stays(self, visitor: socket.socket, seconds: float = math.inf) -> None:
        """It has asked, and has so long from now on; a page stays until it goes."""
        with self._door:
            if visitor in self._visitors:
                self._visitors[visitor] = time.monotonic() + seconds

    def handle_error(self, request: Any, client_address: Any) -> None:
        """A browser that goes away in the middle is no news."""


class _Handler(BaseHTTPRequestHandler):
    server: PageServer
    server_version, sys_version = "okid-live", ""
    timeout = REQUEST_S

    def log_message(self, format: str, *args: Any) -> None:
        """Requests are not logged."""

    def _refuse(self) -> None:
        self._answer(HTTPStatus.METHOD_NOT_ALLOWED, b"only GET and HEAD\n", "text/plain", {"Allow": "GET, HEAD"})

    def do_POST(self) -> None:
        """What the desk takes: a JSON object, or a file. Without its token nothing of the body is read."""
        desk, asked = self.server.desk, urlsplit(self.path)
        self.close_connection = True
        if not self._meant_for_us():
            self._answer(HTTPStatus.FORBIDDEN, b"this name does not belong to okid-live\n", "text/plain")
        elif desk is None or not desk.takes(asked.path):
            self._refuse()
        elif not desk.knows(self.headers.get(TOKEN, "")):
            self._say(HTTPStatus.FORBIDDEN, "open the page by the address that okid-live printed: it holds the key")
        else:
            self.server.stays(self.connection)
            self.connection.settimeout(STALLED_S)
            self._serve_wish(desk, asked.path, asked.query)

    def _serve_wish(self, desk: Desk, path: str, query: str) -> None:
        try:
            length = int(self.headers.get("Content-Length", ""))
            if length < 0 or (length > MOST_ASKED and path != "/upload"):
                raise ValueError(f"{length} bytes")
            if path == "/upload":
                found: Any = desk.upload("".join(parse_qs(query[:2000]).get("name", [])), length, self.rfile)
            else:
                found = desk.do(path, json.loads(self.rfile.read(length)))
        except Busy as fault:
            self._say(HTTPStatus.CONFLICT, str(fault))
        except Error as fault:
            self._say(HTTPStatus.UNPROCESSABLE_ENTITY, str(fault))
        except (ValueError, RecursionError, OSError, MemoryError) as fault:
            self._say(HTTPStatus.BAD_REQUEST, f"{type(fault).__name__}: {fault}")
        else:
            if isinstance(found, bytes):
                self._answer(HTTPStatus.OK, found, "application/octet-stream")
            else:
                self._answer(HTTPStatus.OK, json.dumps(found).encode(), "application/json")

    def _say(self, status: HTTPStatus, text: str) -> None:
        self._answer(status, f"{text}\n".encode(), "text/plain; charset=utf-8")

    do_PUT = do_DELETE = do_PATCH = do_OPTIONS = do_TRACE = do_CONNECT = _refuse

    def do_HEAD(self) -> None:
        """What do_GET() would send, without its body; a stream of events has none."""
        self.do_GET()

    def do_GET(self) -> None:
        """Files, /events, /spectra, /modes."""
        if not self._meant_for_us():
            self._answer(HTTPStatus.FORBIDDEN, b"this name does not belong to okid-live\n", "text/plain")
            return
        self.server.stays(self.connection, ANSWER_S)  # packing plotly.js takes long where others compute
        asked = urlsplit(self.path)
        if asked.path == "/events" and self.command == "HEAD":
            self._answer(HTTPStatus.OK, b"", "text/event-stream")
        elif asked.path == "/events":
            self._send_events()
        elif asked.path == "/spectra":
            self._send_spectra(asked.query)
        elif asked.path == "/modes":
            self._send_modes(asked.query)
        else:
            self._send_file(asked.path)

    def _meant_for_us(self) -> bool:
        """A page of another site whose name was turned to this address (DNS rebinding) sends that name."""
        given = self.headers.get_all("Host") or []
        if len(given) != 1:
            return False
        name = host_of(given[0])
        return name in self.server.allowed or name == self.connection.getsockname()[0].lower()

    def _answer(
        self, status: HTTPStatus, data: bytes, kind: str, more: dict[str, str] | None = None, last: bool = False
    ) -> None:
        self.send_response(status)
        kept = "max-age=86400" if last else "no-store"
        own = {"Content-Type": kind, "Content-Length": str(len(data)), "Cache-Control": kept}
        for name, value in {**HEADERS, **own, **(more or {})}.items():
            self.send_header(name, value)
        self.end_headers()
        if self.command != "HEAD":
            self.wfile.write(data)

    def _send_file(self, path: str) -> None:
        asset = self.server.assets.get(path)
        if asset is None:
            self._answer(HTTPStatus.NOT_FOUND, b"nothing here\n", "text/plain")
            return
        more = {"Content-Encoding": "gzip"} if asset.gzip else {}
        self._answer(HTTPStatus.OK, asset.data, asset.kind, more, last=asset.lasting)

    def _send_spectra(self, query: str) -> None:
        fields = parse_qs(query[:2000])
        try:
            numbers = {key: [int(n) for n in ",".join(fields.get(key, [])).split(",") if n] for key in
                       ("channels", "output", "input")}  # fmt: skip
            first = {key: (numbers[key] or [0])[0] for key in ("output", "input")}
            found = self.server.session.spectra(numbers["channels"][:MOST_SPECTRA], first["output"], first["input"])
        except (Error, ValueError) as fault:
            self._say(HTTPStatus.BAD_REQUEST, str(fault))
            return
        self._answer(HTTPStatus.OK, json.dumps(found, allow_nan=False).encode(), "application/json")

    def _send_modes(self, query: str) -> None:
        try:
            t = float("".join(parse_qs(query[:200]).get("t", [])))
        except ValueError:
            self._say(HTTPStatus.BAD_REQUEST, "expected /modes?t=SECONDS")
            return
        found = json.dumps(self.server.session.modes_at(t), allow_nan=False)
        self._answer(HTTPStatus.OK, found.encode(), "application/json")

    def _send_events(self) -> None:
        session = self.server.session
        outbox = session.open_page()
        if outbox is None:
            self._answer(HTTPStatus.SERVICE_UNAVAILABLE, b"too many pages are open\n", "text/plain")
            return
        try:
            self.send_response(HTTPStatus.OK)
            for name, value in {**HEADERS, "Content-Type": "text/event-stream", "Cache-Control": "no-store"}.items():
                self.send_header(name, value)
            self.end_headers()
            self.server.stays(self.connection)
            self.connection.settimeout(STALLED_S)
            self.wfile.write(b"retry: 1000\n\n")
            closed = False
            while not closed:
                closed = outbox.closed  # what waits then still goes
                for data in outbox.take(HEARTBEAT_S) or [b": here\n\n"]:
                    self.wfile.write(data)
        except OSError:
            pass  # the browser has gone, or took nothing for STALLED_S
        finally:
            with contextlib.suppress(ValueError):
                session.hub.leave(outbox)
