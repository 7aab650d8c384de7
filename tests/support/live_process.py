# SPDX-License-Identifier: MIT
"""okid-live as a process of its own."""

from __future__ import annotations

import signal
import subprocess
import sys


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
