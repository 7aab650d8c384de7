# SPDX-License-Identifier: MIT
"""Modes while lines of numbers arrive ("force,a1,a2,a3", as an Arduino prints them).
usage: live_from_serial_line.py PORT BAUD RATE_HZ SAMPLES"""

import sys

import numpy as np
import okid
import serial

port, baud, rate_hz, samples = sys.argv[1:]
with okid.Session(["force"], ["a1", "a2", "a3"], fs=float(rate_hz)) as session:
    with serial.serial_for_url(port, baudrate=int(baud), timeout=2.0) as line:
        block = []
        for _ in range(int(samples)):
            text = line.readline()
            if not text:
                break  # nothing for two seconds
            try:
                block.append([float(field) for field in text.split(b",")])
            except ValueError:
                block.append([np.nan] * 4)  # a damaged line is a missing sample
            if len(block) == 500:
                session.feed(block)
                block.clear()
                print(", ".join(f"{mode.frequency_hz:.3f} Hz" for mode in session.modes() if mode.emac > 0.9))
    if block:
        session.feed(block)
    for mode in session.identify().confident_modes:
        print(f"{mode.frequency_hz:.4f} Hz, damping {100 * mode.damping_ratio:.3f} %")
