# SPDX-License-Identifier: MIT
"""Judges the ratios of a bench run (okid.bench/1) against what the kernel promises.
usage: bench_check.py FILE.json [--sizes]

Ratios within one run, never times: machines differ and are shared. --sizes: of a short run beside other work. What
depends on memory alone is judged, a slow speed is reported, what `make bench-quick` leaves out may be missing.
"""

from __future__ import annotations

import json
import sys
from pathlib import Path

# ratio -> (smallest allowed, what it says)
PROMISES = {
    "rls_over_direct_W1_p40": (40.0, "a sample costs so many times less than in textbook RLS"),
    "rls_over_direct_W2_p40": (80.0, "a sample costs so many times less than in textbook RLS"),
    "rls_over_direct_W3_p40": (80.0, "a sample costs so many times less than in textbook RLS"),
    "dgemm_over_direct_W2_p20": (0.5, "of the rate of OpenBLAS dgemm on the same product"),
    "dgemm_over_direct_W2_p40": (0.5, "of the rate of OpenBLAS dgemm on the same product"),
    "dgemm_over_direct_W3_p20": (0.5, "of the rate of OpenBLAS dgemm on the same product"),
    "dgemm_over_direct_W3_p40": (0.5, "of the rate of OpenBLAS dgemm on the same product"),
    "dgemm_blocks_over_fft_W2_p60": (5.0, "whole record: times faster than OpenBLAS on blocks of 4096"),
    "dgemm_blocks_over_fft_W3_p50": (5.0, "whole record: times faster than OpenBLAS on blocks of 4096"),
    "python_can_over_replay": (3.0, "a log identified: times faster than python-can only reads it"),
    "python_can_over_convert": (5.0, "a log to CSV: the same"),
    "campaign_two_workers": (1.6, "1,000 records: times faster on two workers than on one"),
}
# ratio -> (largest allowed, what it says); 5 % is what one run of a shared machine cannot tell apart
LIMITS = {
    f"direct_i16_over_direct_{case}_p{p}": (1.05, "16-bit codes cost no more than doubles")
    for case in ("W1", "W2", "W3")
    for p in (20, 40)
}
LIMITS |= {
    f"python_call_us_{kind}": (2.0, "us that a call from Python costs beside the work") for kind in ("i16", "f64")
}
LIMITS |= {f"python_share_{kind}": (0.05, "of the C time of 4,096 samples") for kind in ("i16", "f64")}
LIMITS |= {
    "handed_over_over_bare_calm": (20.0, "p99 from a line to the thread that identifies, of that of a bare reader"),
    "handed_over_over_bare_busy": (5.0, "the same beside two busy processors"),
}
LATENCY_MS = {"calm": 10.0, "busy": 100.0}  # p99, W2 at 1 kHz on a pseudo terminal; busy: beside two busy processors
LIMITS |= {
    "read_csv_over_pyarrow": (1.5, "of the time pyarrow needs for the same table"),
    "read_csv_memory_over_numbers": (1.3, "of the numbers themselves, a table of 51 MB"),
    "import_okid_over_numpy": (1.0, "of the time of import numpy"),
}
LIMITS |= {
    "auto_over_cva_W1": (60.0, "method auto: times as long as n4sid-cva with its deviations"),
    "auto_over_cva_W2": (60.0, "the same"),
    "report_over_empty_axes": (1.5, "a report: times as long as its empty axes"),
}
LIMITS["campaign_worker_mb"] = (500.0, "MB of a worker, whatever the number of records")
# Whole identifications by n4sid-moesp, times faster than SLICOT's MOESP with Cholesky at the same block rows and order.
SLICOT = {f"slicot_moesp_over_n4sid-moesp_{size}": 3.0 for size in ("W1_s10", "W2_s15", "W3_s22")}
# The same by okid.identify, without its fits: 1.6, 2.0 to 2.1, 8.8 to 11 measured; with standard deviations 0.7, 0.6
# and 2.8.
SLICOT |= {f"slicot_moesp_over_identify_n4sid-moesp_{size}": least for size, least in
           (("W1_s10", 1.1), ("W2_s15", 1.5), ("W3_s22", 5.5))}  # fmt: skip
SLICOT |= {f"slicot_moesp_over_identify_n4sid-moesp_sigma_{size}": least for size, least in
           (("W1_s10", 0.4), ("W2_s15", 0.35), ("W3_s22", 1.8))}  # fmt: skip
STATE = 1.1  # state of an unbroken record of doubles over 8 [m (q + n_y) + 2 p m] bytes
SIZES = {"W1": (1, 3), "W2": (2, 6), "W3": (3, 10)}


LONG = ("campaign_", "handed_over_", "slicot_moesp_over_n4sid")  # not of `make bench-quick`
SIZE = ("state_", "read_csv_memory_")  # the same on every machine, however busy


def main() -> int:
    quick = sys.argv[2:] == ["--sizes"]
    if len(sys.argv) != 2 + quick:
        print(__doc__, file=sys.stderr)
        return 2
    bench = json.loads(Path(sys.argv[1]).read_text(encoding="utf-8"))
    short = unmeasured = 0
    promises = {name: bound for name, bound in PROMISES.items() if not (quick and name.startswith(LONG))}
    limits = {name: bound for name, bound in LIMITS.items() if not (quick and name.startswith(LONG))}
    slicot = {name: least for name, least in SLICOT.items() if not (quick and name.startswith(LONG))}

    def judge(name: str, value: float, good: bool, bound: str, meaning: str) -> None:
        nonlocal short
        short += not good and (not quick or name.startswith(SIZE))
        print(f"{'ok   ' if good else 'SHORT'} {name:44} {value:8.2f}  {bound:10} {meaning}")

    for name in (name for name in promises | limits if name not in bench["ratios"]):
        unmeasured += 1
        print(f"none  {name:44} not measured")
    for name, (least, meaning) in promises.items():
        if name not in bench["ratios"]:
            continue
        value = float(bench["ratios"][name])
        judge(name, value, value >= least, f">= {least:g}", meaning)
    for name, (most, meaning) in limits.items():
        if name not in bench["ratios"]:
            continue
        value = float(bench["ratios"][name])
        judge(name, value, value <= most, f"<= {most:g}", meaning)
    for name, least in slicot.items():
        if name in bench["ratios"]:
            value = float(bench["ratios"][name])
            judge(
                name,
                value,
                value >= least,
                f">= {least:g}",
                "whole identification: times as fast as SLICOT",
            )
        else:
            unmeasured += 1
            print(f"none  {name:44} not measured: SLICOT is not installed (Debian package libslicot0)")
    for name, value in bench["ratios"].items():  # no promise
        if name.startswith("slicot_") and name not in SLICOT:
            print(f"      {name:44} {float(value):8.2f}")
    for row in bench["rows"]:
        if row.get("name") == "latency":  # of a bare reader where this machine itself is later than that
            bound_ms = max(LATENCY_MS[row["case"]], row["bare_p99_ms"])
            value, name = row["handed_over_p99_ms"], f"handed_over_p99_ms_{row['case']}"
            judge(name, value, value <= bound_ms, f"<= {bound_ms:.3g}", "ms from a line to the thread that identifies")
        if row.get("kernel") == "direct":
            n_u, n_y = SIZES[row["case"]]
            m, p = n_u + n_y, row["p"]
            value = row["state_bytes"] / (8 * (m * (n_u + p * m + n_y) + 2 * p * m))
            judge(f"state_{row['case']}_p{p}", value, value <= STATE, f"<= {STATE:g}", "state over its bare numbers")
    if short or unmeasured:
        print(f"{short} short, {unmeasured} not measured")
    else:
        print("sizes as promised; speeds are judged by make bench-check" if quick else "all promises kept")
    return 1 if short or unmeasured else 0


if __name__ == "__main__":
    sys.exit(main())
