# SPDX-License-Identifier: MIT
"""A node of CAN FD as others build them: W2 in 64-byte frames with bit rate switch, three pages a sample, packed and
read by cantools, written as a log by python-can. Nothing here is code of okid."""

from __future__ import annotations

from pathlib import Path

import can
import cantools
import numpy as np
from numpy.typing import NDArray
from systems import w2_codes

NAMES = ["f1", "f2", "a1", "a2", "a3", "a4", "a5", "a6", "Temperature"]
ID, PAGES, BITRATE, DBITRATE = 0x1CF0A05, 3, 1_000_000, 8_000_000
# Both byte orders, starts within bytes, the last bit of the frame, float32; the pages share their bits.
DBC = f"""VERSION ""

NS_ :

BS_:

BU_: Node Logger

BO_ {ID | 1 << 31} Daq: 64 Node
 SG_ Page M : 0|8@1+ (1,0) [0|2] "" Logger
 SG_ Number : 8|16@1+ (1,0) [0|65535] "" Logger
 SG_ Temperature : 31|12@0- (0.1,0) [-200|200] "degC" Logger
 SG_ f1 m0 : 61|20@0- (0.01,0) [0|0] "N" Logger
 SG_ f2 m0 : 490|22@1- (0.01,0) [0|0] "N" Logger
 SG_ a1 m1 : 61|18@0- (0.0005,0) [0|0] "m/s^2" Logger
 SG_ a2 m1 : 257|17@1- (0.0005,0) [0|0] "m/s^2" Logger
 SG_ a3 m1 : 480|32@1- (0.0005,0) [0|0] "m/s^2" Logger
 SG_ a4 m2 : 45|24@1- (0.0005,0) [0|0] "m/s^2" Logger
 SG_ a5 m2 : 300|16@0+ (0.0005,-16.384) [0|0] "m/s^2" Logger
 SG_ a6 m2 : 489|18@0- (0.0005,0) [0|0] "m/s^2" Logger

SIG_VALTYPE_ {ID | 1 << 31} a3 : 1;
"""
PLACES = [["f1", "f2"], ["a1", "a2", "a3"], ["a4", "a5", "a6"]]  # Temperature is on every page


def frames(samples: int, counts: str) -> list[bytes]:
    """PAGES of each sample. `counts`: what Number counts, "samples" or "frames"."""
    message = cantools.database.load_string(DBC, "dbc").messages[0]
    codes = dict(zip(NAMES, w2_codes(samples).T.astype(int), strict=False))
    out = []
    for n in range(samples):
        for page, names in enumerate(PLACES):
            number = n if counts == "samples" else PAGES * n + page
            raw = {name: int(codes[name][n]) + (32768 if name == "a5" else 0) for name in names}
            raw |= {"Page": page, "Number": number & 0xFFFF, "Temperature": n // 64 % 4000 - 2000}
            out.append(message.encode(raw, scaling=False, strict=False))
    return out


def decoded(data: list[bytes]) -> NDArray[np.float64]:
    """(samples, channels) by cantools, whatever Number is: one row for the pages of each sample."""
    message = cantools.database.load_string(DBC, "dbc").messages[0]
    rows = np.full((len(data) // PAGES, len(NAMES)), np.nan)
    for at, each in enumerate(data):
        found = message.decode(each, decode_choices=False)
        for name in [*PLACES[int(found["Page"])], "Temperature"]:
            rows[at // PAGES, NAMES.index(name)] = found[name]
    return rows


def messages(data: list[bytes], rate_hz: float, apart_s: float = 130e-6) -> list[can.Message]:
    """The pages of a sample one behind the other."""
    return [
        can.Message(
            1.7e9 + (at // PAGES) / rate_hz + at % PAGES * apart_s,
            ID,
            data=each,
            is_fd=True,
            bitrate_switch=True,
            channel="vcan0",
        )
        for at, each in enumerate(data)
    ]


def write_log(path: Path, sent: list[can.Message]) -> None:
    with can.CanutilsLogWriter(path) as log:
        for each in sent:
            log(each)


def write_config(folder: Path, rate_hz: float, more: str = "") -> Path:
    """CONFIG.toml and its DBC, with the counter. `more`: sections behind."""
    (folder / "node.dbc").write_text(DBC)
    text = f'[acquisition]\nrate_hz = {rate_hz}\n[[bus]]\nname = "can0"\ninterface = "vcan0"\nfd = true\n'
    text += f'bitrate = {BITRATE}\ndbitrate = {DBITRATE}\ndbc = "node.dbc"\n'
    for name in NAMES:
        role = {"f": "force", "a": "acceleration", "T": "aux"}[name[0]]
        text += f'[[channel]]\nname = "{name}"\nrole = "{role}"\nmessage = "Daq"\nsignal = "{name}"\n'
        text += 'sequence = "Number"\n'
    text += '[identification]\nmethod = "okid-era"\np = 30\nrows = 60\norder = 12\n' + more
    (folder / "a.toml").write_text(text)
    return folder / "a.toml"
