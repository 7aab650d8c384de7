# SPDX-License-Identifier: MIT
"""Asks okid-live, whose address is in the first line of FILE, until it shows three modes. usage: live_page.py FILE"""

from __future__ import annotations

import http.client
import json
import re
import sys
import time
from pathlib import Path

WAIT_S = 180.0


def address(told: Path, until: float) -> tuple[str, int]:
    while time.monotonic() < until:
        found = re.search(r"http://([\d.]+):(\d+)/", told.read_text() if told.exists() else "")
        if found:
            return found[1], int(found[2])
        time.sleep(0.2)
    sys.exit(f"{told} names no address: {told.read_text() if told.exists() else 'it is not there'}")


def main() -> None:
    until = time.monotonic() + WAIT_S
    host, port = address(Path(sys.argv[1]), until)
    assert host == "127.0.0.1", host
    page = http.client.HTTPConnection(host, port, timeout=20)
    page.request("GET", "/")
    reply = page.getresponse()
    text = reply.read().decode()
    assert reply.status == 200 and "<title>" in text, reply.status
    stream = http.client.HTTPConnection(host, port, timeout=60)
    stream.request("GET", "/events", headers={"Accept": "text/event-stream"})
    events = stream.getresponse()
    kind, seen = "", set()
    while time.monotonic() < until:
        line = events.readline().decode().rstrip("\n")
        if line.startswith("event: "):
            kind = line[7:]
        elif line.startswith("data: "):
            seen.add(kind)
            modes = json.loads(line[6:])
            found = [round(one["frequency_hz"], 2) for one in modes.get("modes", [])] if kind == "modes" else []
            if len(found) == 3 and len(seen) > 1:
                print("modes at", *found, "Hz; events", *sorted(seen))
                return
    sys.exit(f"no three modes within {WAIT_S:g} s; events {sorted(seen)}")


main()
