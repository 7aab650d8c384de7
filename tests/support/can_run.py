# SPDX-License-Identifier: MIT
"""`okid run` on a CAN interface of this kernel, and the commands around it."""

from __future__ import annotations

import json
import re
import signal
import subprocess
import time
from pathlib import Path

from program import PROGRAM as OKID
from two_masses import rig_text, simulate_rig
from waiting import until


def sh(*args: str, check: bool = True, seconds: float = 1800) -> subprocess.CompletedProcess[str]:
    done = subprocess.run(args, capture_output=True, text=True, timeout=seconds, check=False)
    if check:
        assert done.returncode == 0, f"{args}: {done.returncode}\n{done.stdout}\n{done.stderr}"
    return done


def make_record(folder: Path, duration: float) -> Path:
    return simulate_rig(folder, rig_text(duration, 500.0), lags=20)


class Run:
    """`okid run` in the background, ready when its socket listens."""

    def __init__(
        self,
        folder: Path,
        *options: str,
        config: str = "a.toml",
        under: tuple[str, ...] = (),
        interface: str = "vcan0",
    ) -> None:
        self.folder = folder
        self.stderr = (folder / "stderr").open("w+")
        for name in ("ev", "r.json"):
            (folder / name).unlink(missing_ok=True)
        self.process = subprocess.Popen(
            [
                *under,
                OKID,
                "run",
                str(folder / config),
                "--events",
                str(folder / "ev"),
                "--json",
                str(folder / "r.json"),
                *options,
            ],
            stdout=subprocess.DEVNULL,
            stderr=self.stderr,
        )
        until(lambda: self.listening(interface) or self.process.poll() is not None)
        assert self.process.poll() is None, self.messages()

    @staticmethod
    def listening(interface: str = "vcan0") -> bool:
        lists = (
            "/proc/net/can/rcvlist_sff",
            "/proc/net/can/rcvlist_eff",
            "/proc/net/can/rcvlist_fil",
            "/proc/net/can/rcvlist_all",
        )
        return any(re.search(rf"{interface}\s+[0-9a-f]+\s+[0-9a-f]+\s", Path(each).read_text()) for each in lists)

    def messages(self) -> str:
        self.stderr.seek(0)
        return self.stderr.read()

    def stop(self, how: signal.Signals = signal.SIGINT, status: int = 0) -> list[dict]:
        time.sleep(0.3)  # what was sent is already in the socket: the end of the run empties it
        self.process.send_signal(how)
        assert self.process.wait(1800) == status, self.messages()
        return self.events()

    def events(self) -> list[dict]:
        return [json.loads(line) for line in (self.folder / "ev").read_text().splitlines()]


def bus(events: list[dict]) -> dict:
    last = [event for event in events if event["type"] == "stats"][-1]
    return last["bus"]["can0"]
