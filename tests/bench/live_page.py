#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""What the page of okid-live costs in headless Chromium: frames a second and memory while 64 channels come at 2 kHz
on busy processors, and how long a finished record of 1 GB waits for its first signals.

usage: tests/bench/live_page.py [--seconds 30] [--gigabytes 1]
"""

from __future__ import annotations

import argparse
import json
import shutil
import subprocess
import sys
import tempfile
import threading
import time
from pathlib import Path
from typing import Any

import numpy as np

ROOT = Path(__file__).resolve().parents[2]
sys.path[:0] = [str(ROOT / "tests/support"), str(ROOT / "tests/live")]

import okid  # noqa: E402
from live_process import Live  # noqa: E402
from okid.formats import write_record  # noqa: E402
from okid_feed import WHOLE, OkidFeed, channel, modes, samples, start  # noqa: E402
from playwright.sync_api import sync_playwright  # noqa: E402

CHANNELS, RATE_HZ, BLOCK_S, BUSY = 64, 2000.0, 0.1, 2
COUNT = """() => { window.drawn = 0; const one = () => { window.drawn += 1; requestAnimationFrame(one); }; one(); }"""


def feed(socket: OkidFeed, over: threading.Event) -> None:
    """Blocks of noise at the rate of the clock, the modes of an update each second."""
    count, rng = round(RATE_HZ * BLOCK_S), np.random.default_rng(1)
    blocks = [json.dumps(samples(0, rng.standard_normal((CHANNELS, count)), RATE_HZ)["values"]) for _ in range(8)]
    begin, k = time.monotonic(), 0
    while not over.wait(max(0.0, begin + (k + 1) * BLOCK_S - time.monotonic())):
        t = (k + 1) * BLOCK_S
        head = f'{{"type":"samples","t":{t:.3f},"first":{k * count},"count":{count},"values":'
        socket.raw(f"{head}{blocks[k % 8]}}}\n".encode())
        if k % 10 == 0:
            socket.send(modes(t, [10.0 + 3.0 * n for n in range(8)]))
        k += 1


def live_figures(browser: Any, seconds: float, folder: Path) -> dict[str, float]:
    config = folder / "a.toml"
    config.write_text(WHOLE + '[publish]\nsocket = "s"\nsamples = true\n')
    socket, over = OkidFeed(folder / "s"), threading.Event()
    busy = [subprocess.Popen([sys.executable, "-c", "while True: pass"]) for _ in range(BUSY)]
    live = Live(config)
    try:
        socket.accept()
        names = [channel("f", "force", "N"), *(channel(f"a{k}", "response", "m/s^2", k) for k in range(1, CHANNELS))]
        socket.send(start(names, RATE_HZ))
        sender = threading.Thread(target=feed, args=(socket, over), daemon=True)
        sender.start()
        page = browser.new_page(viewport={"width": 1280, "height": 800})
        page.goto(live.url)
        page.wait_for_function("() => window.okidLive && okidLive.lanes.end > 300", timeout=600_000)
        page.evaluate(COUNT)
        before = page.evaluate("[performance.now(), okidLive.lanes.draws]")
        page.wait_for_timeout(1000.0 * seconds)
        now, draws, drawn = page.evaluate("[performance.now(), okidLive.lanes.draws, drawn]")
        took = (now - before[0]) / 1000.0
        heap = page.evaluate("performance.memory.usedJSHeapSize") / 1e6
        page.close()
    finally:
        over.set()
        for one in busy:
            one.kill()
        live.end()
        socket.close()
    return {"frames_per_s": drawn / took, "lanes_per_s": (draws - before[1]) / took, "heap_mb": heap}


def finished_figures(browser: Any, gigabytes: float, folder: Path) -> dict[str, float]:
    """A result over a record of 64-bit numbers, from the start of okid-live to the first signals on the page."""
    channels = 4
    rows = round(gigabytes * 1e9 / 8 / channels)
    rng = np.random.default_rng(2)
    u, y = okid.demo_record(20000)
    piece = np.hstack([u, y])
    result = okid.identify(u, y, fs=1000.0, method="okid-era", input_names=["u"], output_names=["a1", "a2", "a3"])
    (folder / "r.json").write_text(json.dumps(result.to_dict()))
    data = np.resize(piece, (rows, channels)) + 1e-3 * rng.standard_normal((rows, 1))
    write_record(folder / "r.h5", okid.Record(["u", "a1", "a2", "a3"], data, 1000.0))
    del data
    begin = time.monotonic()
    live = Live(folder / "r.json", "--record", folder / "r.h5")
    try:
        page = browser.new_page(viewport={"width": 1280, "height": 800})
        page.goto(live.url)
        page.wait_for_function("() => window.okidLive && okidLive.page", timeout=600_000)
        painted = time.monotonic() - begin
        page.wait_for_function(
            "() => window.okidLive && okidLive.lanes.end > 0 && okidLive.lanes.draws", timeout=600_000
        )
        first = time.monotonic() - begin
        page.wait_for_function("() => okidLive.page.result && okidLive.lanes.end > 0", timeout=600_000)
        page.close()
    finally:
        live.end()
    return {"first_paint_s": painted, "first_signals_s": first}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seconds", type=float, default=30.0)
    parser.add_argument("--gigabytes", type=float, default=1.0)
    args = parser.parse_args()
    with sync_playwright() as playwright, tempfile.TemporaryDirectory() as name:
        options = ["--no-sandbox", "--disable-dev-shm-usage", "--enable-precise-memory-info"]
        browser = playwright.chromium.launch(executable_path=shutil.which("chromium"), args=options)
        found = live_figures(browser, args.seconds, Path(name)) | finished_figures(browser, args.gigabytes, Path(name))
        browser.close()
    for key, value in found.items():
        print(f"{key:16} {value:8.1f}")


if __name__ == "__main__":
    main()
