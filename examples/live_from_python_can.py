# SPDX-License-Identifier: MIT
"""Modes while frames arrive, on any bus python-can knows; signals as `okid simulate` makes them.
usage: live_from_python_can.py INTERFACE CHANNEL FILE.dbc RATE_HZ SAMPLES"""

import sys

import can
import cantools
import numpy as np
import okid

interface, channel, dbc, rate_hz, samples = sys.argv[1:]
names = ["Force1", "Accel1", "Accel2", "Accel3"]
database = cantools.database.load_file(dbc)
with okid.Session(names[:1], names[1:], fs=float(rate_hz), window_s=20.0) as session:
    with can.Bus(interface=interface, channel=channel) as bus:
        block, current, seen = [], None, 0
        while seen < int(samples) and (message := bus.recv(timeout=5.0)) is not None:
            values = database.decode_message(message.arbitration_id, message.data)
            if values["Counter"] != current:  # a new sample; those in between did not come: NaN
                missing = 1 if current is None else (values["Counter"] - current) % 65536
                block += [dict.fromkeys(names, np.nan) for _ in range(missing)]
                current, seen = values["Counter"], seen + missing
            block[-1].update((name, values[name]) for name in names if name in values)
            if len(block) > 500:  # two seconds; the newest sample may still wait for a frame
                session.feed([[row[name] for name in names] for row in block[:-1]])
                del block[:-1]
                print(", ".join(f"{mode.frequency_hz:.3f} Hz" for mode in session.modes() if mode.emac > 0.9))
    session.feed([[row[name] for name in names] for row in block])
    for mode in session.identify().confident_modes:
        print(f"{mode.frequency_hz:.4f} Hz, damping {100 * mode.damping_ratio:.3f} %")
