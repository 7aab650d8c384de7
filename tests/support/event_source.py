# SPDX-License-Identifier: MIT
"""What a browser asks of okid-live, without a browser."""

from __future__ import annotations

import http.client
import json
from collections.abc import Iterator
from typing import Any


def ask(port: int, path: str = "/", method: str = "GET", **headers: str) -> tuple[int, dict[str, str], bytes]:
    link = http.client.HTTPConnection("127.0.0.1", port, timeout=1800)
    link.request(method, path, headers=headers)
    reply = link.getresponse()
    data = reply.read()
    link.close()
    return reply.status, {name.lower(): value for name, value in reply.getheaders()}, data


class Listener:
    """A browser's EventSource."""

    def __init__(self, port: int) -> None:
        self.link = http.client.HTTPConnection("127.0.0.1", port, timeout=1800)
        self.link.request("GET", "/events", headers={"Accept": "text/event-stream"})
        self.reply = self.link.getresponse()
        assert self.reply.status == 200, self.reply.status
        assert self.reply.getheader("Content-Type") == "text/event-stream"

    def event(self) -> tuple[str, Any]:
        kind = ""
        while True:
            line = self.reply.readline().decode().rstrip("\n")
            if line.startswith("event: "):
                kind = line[7:]
            elif line.startswith("data: "):
                return kind, json.loads(line[6:])

    def events(self) -> Iterator[tuple[str, Any]]:
        while True:
            yield self.event()

    def close(self) -> None:
        self.reply.close()
        self.link.close()
