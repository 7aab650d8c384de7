# SPDX-License-Identifier: MIT
"""okid-live as a process of its own."""

from __future__ import annotations

import http.client
import json
import signal
import subprocess
import sys
from typing import Any


class Live:
    """A running okid-live: where it is (`address`: with the key of its token), and how it ends."""

    def __init__(self, *arguments: object) -> None:
        command = [sys.executable, "-m", "okid.live", "--port", "0", *map(str, arguments)]
        self.process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
        assert self.process.stdout is not None
        line = self.process.stdout.readline()
        if not line.startswith("okid-live: http://"):
            self.process.kill()
            raise AssertionError(f"{line}{self.process.communicate()[1]}")
        self.address = line.split()[1]
        self.url, _, self.token = self.address.partition("#")
        self.port = int(self.url.rstrip("/").rpartition(":")[2])

    def end(self, how: signal.Signals = signal.SIGTERM) -> tuple[int, str]:
        """Exit code and what stood on stderr."""
        self.process.send_signal(how)
        errors = self.process.communicate(timeout=1800)[1]
        return self.process.returncode, errors


def post(live: Live, path: str, content: Any, token: str | None = None, **headers: str) -> tuple[int, bytes]:
    """Status and body of what a page asks for: JSON, or bytes of a file."""
    link = http.client.HTTPConnection("127.0.0.1", live.port, timeout=1800)
    body = content if isinstance(content, bytes) else json.dumps(content).encode()
    link.request("POST", path, body, {"X-Okid-Token": live.token if token is None else token, **headers})
    reply = link.getresponse()
    data = reply.read()
    link.close()
    return reply.status, data
