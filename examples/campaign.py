# SPDX-License-Identifier: MIT
"""Many records of one structure, one model: each becomes sums, and sums add up. `okid-campaign` does it for thousands.
usage: campaign.py FORCE RESPONSE[,RESPONSE ..] RECORD.csv [RECORD.csv ..]"""

import sys

import numpy as np
import okid

force, responses, *paths = sys.argv[1:]
names = [force, *responses.split(",")]
whole, rate_hz = okid.Accumulator(1, len(names) - 1, 40), 0.0
for path in paths:  # in any order, by any number of processes: to_bytes() and from_bytes() carry sums between them
    record = okid.read_csv(path)
    sums, rate_hz = okid.Accumulator(1, len(names) - 1, 40), record.fs_hz
    sums.add(np.ascontiguousarray(record.columns(names, path)))
    sums.centre()  # each record less its own means
    whole.merge(sums)
found = okid.Identifier(n_u=1, n_y=len(names) - 1, fs=rate_hz, p=40).run(whole)
for frequency, damping, emac in zip(found.frequency_hz, found.damping_ratio, found.emac, strict=True):
    if emac > 0.5:
        print(f"{frequency:.4f} Hz, damping {100 * damping:.3f} %")
