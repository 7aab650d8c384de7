# SPDX-License-Identifier: MIT
"""Small valid inputs for the fuzzers to start from. usage: make_corpus.py FOLDER (gets one folder a fuzzer)."""

from __future__ import annotations

import base64
import json
import random
import struct
import sys
import zlib
from pathlib import Path

CONFIG = """[acquisition]
rate_hz = 1000.0
title = "t"
[[bus]]
name = "can0"
type = "socketcan"
interface = "vcan0"
bitrate = 500000
sync_hz = 100.0
sync_data = "01"
start = ["000#0100"]
[[channel]]
name = "f"
role = "force"
dof = 1
unit = "N"
can_id = 256
start_bit = 0
length = 16
signed = true
scale = 0.01
sequence = { start_bit = 48, length = 16 }
[[channel]]
name = "a"
role = "acceleration"
can_id = 0x18F02D00
extended = true
start_bit = 7
length = 32
byte_order = "big"
value = "float32"
[identification]
method = "okid-era"
p = 20
order = "auto"
window_s = 2.0
mkr = true
"""
LINE_CONFIG = """[acquisition]
rate_hz = 100
[[bus]]
name = "s"
type = "serial"
device = "/dev/ttyUSB0"
baud = 115200
framing = "ascii"
[[channel]]
name = "a"
role = "acceleration"
field = 0
"""
DBC = """VERSION "1"
NS_ :
BS_:
BU_: A B
BO_ 256 Shaker: 8 A
 SG_ Force : 0|16@1- (0.01,0) [-100|100] "N" B
 SG_ Counter : 48|16@1+ (1,0) [0|65535] "" B
BO_ 2565877015 Imu: 8 A
 SG_ Page M : 0|8@1+ (1,0) [0|255] "" B
 SG_ X m1 : 15|32@0- (1,0) [0|0] "g" B
SIG_VALTYPE_ 2565877015 X : 1;
CM_ BO_ 256 "a ; comment";
VAL_ 256 Counter 0 "zero" 1 "one" ;
"""
CSV = [
    "# fs_hz: 100\ntime_s,acc1 [g],f\n0,1,2\n0.01,-1.5e-3,nan\n0.02,,7\n",
    '\ufeff"a b";c\r\n1,5;2\r\n',
    "# sample_rate_hz = 50\na\tb\n1\t2\n",
]
LOG = [
    "(1700000000.123456) can0 123#0011223344556677\n",
    "(1700000000.123456789) vcan0 18F02D00##3" + "AB" * 64 + "\n(2) can1 123#R4\n",
    "(1) can0 20000040#0000000000000000 R\n",
]
LINES = ["t12380011223344556677\r", "T18F02D008001122334455667701F4\r", "r1238\rz\r", "d1239" + "00" * 12 + "\r"]


def signals(count: int) -> list[bytes]:
    dice = random.Random(1)
    return [
        struct.pack("<HBB", dice.randrange(64), dice.randrange(1, 65), dice.randrange(16))
        + struct.pack("<d", dice.choice([1.0, 0.01, -2.5]))
        + bytes([128, 8])
        + dice.randbytes(8)
        for _ in range(count)
    ]


def chunk(kind: int, payload: bytes, sequence: int, frames: int = 0) -> bytes:
    """Of a journal, docs/reference/journal-format.md."""
    head = b"\x8fOKJ\r\n\x1a\n" + struct.pack(
        "<BBHIQIIqqQI", 1, kind, 0, len(payload), 7, sequence, frames, 1, 2, 0, zlib.crc32(payload)
    )
    return head + struct.pack("<I", zlib.crc32(head)) + payload


def journals() -> list[bytes]:
    text = struct.pack("<IQQ", 6, 11, 0) + b"config" + b"rate_hz = 1"
    plain = struct.pack("<BBBBIq", 0, 0, 0, 8, 0x123, 1700000000000000000) + bytes(8)
    stamped = struct.pack("<BBBBIqq", 1, 0x89, 2, 64, 0x18F02D00, 1700000000000100000, 5) + bytes(64)
    remote = struct.pack("<BBBBIq", 2, 2, 0, 4, 0x7FF, 1700000000000200000)
    whole = chunk(1, text, 0) + chunk(2, plain + stamped, 1, 2) + chunk(2, remote, 2, 1) + chunk(3, b"", 3)
    return [whole, whole[:200], whole[:100] + whole[110:], chunk(2, plain, 9, 2)]


def arrays() -> list[bytes]:
    """Of NumPy's save(): version, length of the header, header, numbers."""
    out = []
    for version, kind, order, shape in (
        (1, "<f8", "False", (3, 2)),
        (2, ">i2", "True", (2, 3)),
        (1, "|u1", "False", (6,)),
    ):
        head = f"{{'descr': '{kind}', 'fortran_order': {order}, 'shape': {shape}, }}".ljust(117).encode() + b"\n"
        length = struct.pack("<H" if version == 1 else "<I", len(head))
        out.append(b"\x93NUMPY" + bytes([version, 0]) + length + head + bytes(range(48)))
    return out


# Of okid_accumulator_serialise() (growing, codes, a window) and okid_correlation_serialise(), small, packed.
SUMS = [
    "c-r&#_H=P{cIIMaU|>MT$N-(s!0^GIl>t9sLF2O$G!tSjDvb^l93Zrk0}EbrLZIp*p>!OCZb*dk!=ZF6s(3>RRNMqgTR32MAN_#<yTEGzBZv?4",
    "c-r&#_H=P{cIIMaU|>MUFo4X4fDiVp4EO;H8XsLfBUW7>>``e1-~eJyBy-XA2SDi*C|v=id!Td-lrBLNU&25gAOfW&2>NkogJZA#CISH5Tnr`",
    "c-r&#_H=P{cIIMaU|>MTAixC0Fg^l&uxDk!4_MIn=<1QpWI{3*l|}~&4iH+&feDK_nCf((v<Z~9g3>Bb+6YbD5lTxqpqhj3J^`q>2;3daSltr"
    "@QP&U(RUZlE$3W>2C>?<+?vQ}yegg+|d(p!KJ)9XC1_u1txt#|9TlW~j",
]
CORRELATIONS = [
    "c-r&#_H=Rf58`5EU|@h@CMXR9Obp22gFQO~e!z;xXUA#|#4J=A4jdp9hXX5iE8z0@#Z92J9+b92qxI0#nUJYZ1x~-aJBJYf&9e}J",
    "c-r&#_H=Rf58`5EU|@h@CMeASWiv4#gAexX4EO;n8lN4>ECv+wKG>tuaNq!;I2@R;TLG7c&;kx<=Ah}rlt<N%a1SF2A5$K`J79bbC~b)5J_Q`=7|`qyAfQhKhdD5JD"
    "52RegQiXbjgRhLT>3cB?3cjdZY4Bv2{iXg;BYS?eH;$H3)$}g0DEd3x&",
]


def states() -> list[bytes]:
    """Kind of the state, then its bytes (fuzz_state.cpp)."""
    samples = b"okid.rec" + struct.pack("<qqqqqq", 1, 2, 2, 3, 1, 3) + struct.pack("<9d", *range(9))
    about = {"keeps": "samples", "rate_hz": 100.0, "inputs": ["f"], "outputs": ["a", "b"]}
    texts = [json.dumps(one).encode() for one in (about, {**about, "rate_hz": 50.0}, {**about, "outputs": ["a", 1]})]
    heads = [b"OKIDSTR\n" + struct.pack("<QI", 20 + len(text), 0) + text for text in texts]
    sums = [b"\x02" + zlib.decompress(base64.b85decode(one)) for one in SUMS]
    correlations = [b"\x03" + zlib.decompress(base64.b85decode(one)) for one in CORRELATIONS]
    return [*(b"\0" + head + samples for head in heads), b"\x01" + samples, *sums, *correlations]


def main() -> int:
    top = Path(sys.argv[1])
    seeds: dict[str, list[bytes]] = {
        "codec": signals(16),
        "candump": [text.encode() for text in LOG],
        "config": [CONFIG.encode(), LINE_CONFIG.encode()],
        "dbc": [DBC.encode(), DBC.replace("\n", "\r\n").encode()],
        "csv": [text.encode() for text in CSV],
        "npy": arrays(),
        "numbers": [
            bytes([a, b, c, d]) for a, b, c, d in ((0, 0, 1, 0), (0, 20, 9, 20), (17, 5, 0, 0), (30, 16, 25, 13))
        ],
        "state": states(),
        "face": [
            *(b"\x00" + text.encode() for text in (CONFIG, LINE_CONFIG)),
            *(b"\x01" + text.encode() for text in CSV),
            *(b"\x02" + name for name in (b"acc1 [g]", b"force (kN)", b"x_mm", b"m/s^2")),
        ],
        "slcan": [text.encode() for text in LINES],
        "journal": journals(),
        "ascii": [b"\x00\x011.23,4.56\r\n7;8;9\nx:1 y:2\n", b"\x01\x081,2,3\n2,4,5\n"],
        "witmotion": [b"\x00\x01" + bytes([0x55, 0x51, 1, 0, 2, 0, 3, 0, 4, 0]) + bytes([(0x55 + 0x51 + 10) & 255])],
    }
    for name, inputs in seeds.items():
        folder = top / f"fuzz_{name}"
        folder.mkdir(parents=True, exist_ok=True)
        for number, data in enumerate(inputs):
            (folder / f"seed{number}").write_bytes(data)
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
