# SPDX-License-Identifier: MIT
"""From the last frame of an update to its modes: W2 on a serial line in real time, recorded, identified every 0.5 s.

usage: live_latency.py [SECONDS]
"""

from __future__ import annotations

import subprocess
import sys
import tempfile
import time
from pathlib import Path

import journal
import numpy as np
import program
from lines import line, node_config, packet
from live_feed import UPDATE_S, latencies_ms, summary, w2_codes, watching

RATE, IN_PACKET = 1000, 4
ROLES = ("force",) * 2 + ("acceleration",) * 6
SECTIONS = f"""
[identification]
p = 40
window_s = 4.0
update_s = {UPDATE_S}
[record]
[publish]
socket = "live.sock"
"""


def main() -> None:
    seconds = int(sys.argv[1]) if len(sys.argv) > 1 else 30
    codes = w2_codes(seconds * RATE).tolist()
    packets = [packet(at, codes[at : at + IN_PACKET]) for at in range(0, len(codes), IN_PACKET)]
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        with line(folder / "tty") as tty:
            run = subprocess.Popen(
                [program.PROGRAM, "run", str(node_config(folder, SECTIONS, RATE, ROLES))], stdout=subprocess.DEVNULL
            )
            with watching(folder / "live.sock") as watch:
                begin = time.monotonic()
                for number, data in enumerate(packets):
                    time.sleep(max(0.0, begin + number * IN_PACKET / RATE - time.monotonic()))
                    tty.write(data)
                time.sleep(0.5)
                run.terminate()
                if run.wait(60) != 0:
                    raise SystemExit("live_latency: the run failed, see above")
        stamps = [frame.time_ns * 1e-9 for path in (folder / "runs").glob("*.okj") for frame in journal.frames(path)]
    complete = np.array(stamps).reshape(len(codes), -1).max(axis=1)  # a sample of a line is two frames
    waits = latencies_ms(watch.came, complete, RATE)
    print(f"W2 at {RATE} Hz, p = 40, window 4 s, {seconds} s live and recorded; frame in to modes out:")
    print(summary(waits))


if __name__ == "__main__":
    main()
