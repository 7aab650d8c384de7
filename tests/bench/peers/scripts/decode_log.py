# SPDX-License-Identifier: MIT
"""A candump log and its DBC to arrays, as a user of cantools and python-can writes it. Lost frames are not noticed."""

import can
import cantools
import numpy as np


def read(log, dbc, inputs, outputs):
    database = cantools.database.load_file(dbc)
    columns = {name: [] for name in inputs + outputs}
    for frame in can.LogReader(log):
        for name, value in database.decode_message(frame.arbitration_id, frame.data).items():
            if name in columns:
                columns[name].append(value)
    return np.array([columns[n] for n in inputs]).T, np.array([columns[n] for n in outputs]).T
