# SPDX-License-Identifier: MIT
"""okid beside its peers on the same records: speed, memory, errors of the modes; decoding of a log; lines of code.

usage: compare.py FOLDER OUT.json [--quick] [--only ADAPTER]

Every way of every peer runs in a process of its own with one thread, 60 s of processor time a run and 8 GB of address
space. A peer that fails is a row with the reason.
"""

from __future__ import annotations

import argparse
import datetime
import importlib.metadata
import json
import os
import platform
import signal
import statistics
import subprocess
import sys
from pathlib import Path
from typing import Any

from problem import CASES, write_record

HERE = Path(__file__).parent
LIMIT_S, LIMIT_GB, LONG_S, TURNS = 60, 8, 4, 5
TOO_LONG = -1000
QUIET: dict[str, Any] = {"stdin": subprocess.DEVNULL, "stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
TICKS = os.sysconf("SC_CLK_TCK")
ADAPTERS: dict[str, tuple[str, tuple[str, ...]]] = {  # adapter: distribution, ways
    "okid_kernels": ("okid", ("okid-era", "n4sid-moesp", "n4sid-cva", "n4sid-ssarx")),
    "okid_identify": (
        "okid",
        ("okid-era", "okid-era, p = 2 s", "okid-era-dc", "n4sid-moesp", "n4sid-cva", "n4sid-ssarx",
         "n4sid-moesp with sigma", "okid-era, outputs only", "okid-era, outputs only, 4 s",
         "as it comes", "as it comes, refine"),
    ),
    "slicot_debian": ("libslicot0", ("MOESP, Cholesky", "N4SID, Cholesky", "MOESP, QR")),
    "ctrlsys_slicot": ("ctrlsys", ("MOESP, Cholesky", "MOESP, Cholesky, no gain", "N4SID, Cholesky", "MOESP, QR")),
    "sippy": ("sippy-unipi", ("N4SID", "MOESP", "CVA")),
    "nfoursid": ("nfoursid", ("PO-MOESP",)),
    "strid_csi": ("strid", ("CSI",)),
    "modred_okid": ("modred", ("OKID + ERA",)),
    "systemid": ("systemID", ("OKID + ERA",)),
    "mdof_methods": ("mdof", ("srim", "okid-era", "okid-era-dc")),
    "python_control": ("control", ("markov + ERA",)),
    "llsi_moesp": ("llsi", ("PO-MOESP",)),
    "pyoma": ("pyoma-2", ("SSI IOcov", "SSI-cov, outputs only", "SSI-cov, outputs only, 4 s")),
    "sdypy_lscf": ("sdypy-EMA", ("LSCF, 3 to 10 clicks",)),
}  # fmt: skip
DECODERS = ("okid convert", "python-can + cantools", "cantools decode", "asammdf extract_bus_logging")
SCRIPTS = ("decode_log", *(path.stem for path in sorted((HERE / "scripts").glob("with_*.py"))))


def version_of(distribution: str) -> str:
    if distribution == "okid":
        said = subprocess.run([os.environ["OKID_PROGRAM"], "--version"], capture_output=True, text=True, check=True)
        return said.stdout.split()[1]
    if distribution == "libslicot0":
        asked = ["dpkg-query", "-W", "-f=${Version}", "libslicot0"]
        said = subprocess.run(asked, capture_output=True, text=True, check=False)
        return said.stdout or "not installed"
    try:
        return importlib.metadata.version(distribution)
    except importlib.metadata.PackageNotFoundError:
        return "not installed"


def ended(code: int) -> str:
    """Why a process that said nothing more is no longer there."""
    if code == TOO_LONG:
        return f"more than {LIMIT_S} s"
    return f"ended by {signal.Signals(-code).name}" if code < 0 else f"ended with status {code}"


def run(arguments: list[str]) -> int:
    """Status of a short helper."""
    return subprocess.run([sys.executable, *arguments], cwd=HERE, check=False, **QUIET).returncode


def overdue(pid: int, told_in: Path) -> bool:
    """The run that began last has had its time of the processor."""
    lines = told_in.read_text(encoding="utf-8").splitlines() if told_in.exists() else []
    begun = json.loads(lines[-1]).get("begun") if lines and lines[-1].endswith("}") else None
    if begun is None:
        return False
    fields = Path(f"/proc/{pid}/stat").read_text(encoding="ascii", errors="replace").rsplit(")", 1)[1].split()
    spent = (int(fields[11]) + int(fields[12])) / TICKS  # user and system time
    return bool(spent - begun > LIMIT_S)


def watch(arguments: list[str], told_in: Path) -> int:
    """Status of a measurement; TOO_LONG when it had to be ended."""
    with subprocess.Popen([sys.executable, *arguments], cwd=HERE, **QUIET) as process:
        while process.poll() is None:
            try:
                process.wait(0.5)
            except subprocess.TimeoutExpired:
                if overdue(process.pid, told_in):
                    process.kill()
                    process.wait()
                    return TOO_LONG
        return process.returncode


def summed(told: list[dict[str, Any]], code: int, noise: float) -> dict[str, Any]:
    """One row of a level of noise: least time, most memory, medians of the errors over the records."""
    own = [row for row in told if row.get("noise") == noise and "seconds" in row]
    begun = any(row.get("noise") == noise and "begun" in row for row in told)
    faults = [row["failed"] for row in told if "failed" in row and row.get("noise", noise) == noise]
    out: dict[str, Any] = {"noise_percent": noise, "records": len(own)}
    if own:
        for key in ("frequency_error", "damping_error"):
            out[key] = statistics.median(row[key] for row in own)
            out[f"{key}s"] = [row[key] for row in own]
        out["missing"] = max(row["missing"] for row in own)
        out |= {key: min(row[key] for row in own) for key in ("seconds", "wall_seconds")}
        out["memory_mb"] = max(row["memory_mb"] for row in own)
        out["runs"] = sum(row["runs"] for row in own)
    if faults:
        out["failed"] = faults[0]
    elif not own and (begun or not told):
        out["failed"] = ended(code)
    elif own and code not in (0, TOO_LONG):
        out["note"] = f"process {ended(code)} later"
    return out


def measure(adapter: str, way: str, case: str, folder: Path, seeds: dict[float, list[int]]) -> list[dict[str, Any]]:
    told_in = folder / "told.jsonl"
    told_in.unlink(missing_ok=True)
    levels = [f"{noise:g}:{','.join(map(str, own))}" for noise, own in seeds.items()]
    limits = [str(x) for x in (LIMIT_GB, LONG_S, TURNS)]
    code = watch(["measure.py", adapter, way, case, str(folder / "data"), str(told_in), *limits, *levels], told_in)
    lines = told_in.read_text(encoding="utf-8").splitlines() if told_in.exists() else []
    told = [json.loads(line) for line in lines]
    rows = [summed(told, code, noise) for noise in seeds]
    failed_at_once = next((row["failed"] for row in rows if not row["records"] and "failed" in row), None)
    for row in rows:
        if not row["records"] and "failed" not in row and failed_at_once:
            row["failed"] = failed_at_once
    return rows


def one_answer(arguments: list[str], folder: Path) -> dict[str, Any]:
    out = folder / "answer.json"
    out.unlink(missing_ok=True)
    code = run([*arguments, str(out)])
    if out.exists():
        answer: dict[str, Any] = json.loads(out.read_text(encoding="utf-8"))
        return answer
    return {"peer": arguments[1], "failed": ended(code)}


def identifications(folder: Path, quick: bool, only: str | None) -> list[dict[str, Any]]:
    cases = ["W1"] if quick else list(CASES)
    seeds = {1.0: [1], 5.0: [1], 0.0: [1]} if quick else {1.0: [1, 2, 3], 5.0: [1, 2, 3], 0.0: [1]}
    rows = []
    for case in cases:
        for noise, own in seeds.items():
            for seed in own:
                write_record(folder / "data", CASES[case], noise, seed)
        for adapter, (distribution, ways) in ADAPTERS.items():
            for way in ways if only in (None, adapter) else ():
                for row in measure(adapter, way, case, folder, seeds):
                    rows.append({"adapter": adapter, "peer": distribution, "way": way, "case": case, **row})
                    print(shown(rows[-1]), flush=True)
    return rows


def shown(row: dict[str, Any]) -> str:
    head = f"{row['case']} {row['adapter']:15} {row['way']:24} {row['noise_percent']:2g} %"
    if not row["records"]:
        return f"{head}  {row.get('failed', 'not tried')}"
    lost = f"  {row['missing']} modes missing" if row["missing"] else ""
    return (f"{head} {1e3 * row['seconds']:9.2f} ms {row['memory_mb']:7.0f} MB  f {row['frequency_error']:.1e}  "
            f"zeta {row['damping_error']:.1e}{lost} {row.get('failed', row.get('note', ''))}")  # fmt: skip


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("folder", type=Path)
    parser.add_argument("out", type=Path)
    parser.add_argument("--quick", action="store_true", help="W1 alone, one record a level of noise")
    parser.add_argument("--only", help="one adapter")
    chosen = parser.parse_args()
    folder = chosen.folder.resolve()
    (folder / "data").mkdir(parents=True, exist_ok=True)
    load_before = os.getloadavg()[0]
    rows = identifications(folder, chosen.quick, chosen.only)
    decoding, scripts = [], []
    if chosen.only is None:
        if run(["capture.py", "make", str(folder), "10" if chosen.quick else "60"]) != 0:
            raise SystemExit("compare: okid simulate failed: is OKID_PROGRAM an okid that runs?")
        decoding = [one_answer(["capture.py", way, str(folder)], folder) for way in DECODERS]
        scripts = [one_answer(["ease.py", name, str(folder)], folder) for name in SCRIPTS]
        for row in decoding + scripts:
            print(row, flush=True)
    names = [distribution for distribution, _ in ADAPTERS.values()]
    names += ["numpy", "scipy", "python-can", "cantools", "asammdf"]
    found = {
        "schema": "okid.peers/1",
        "date": datetime.datetime.now(datetime.UTC).date().isoformat(),
        "quick": chosen.quick,
        "machine": {"processor": platform.machine(), "cores": os.cpu_count(), "python": platform.python_version(),
                    "load_before": load_before, "load_after": os.getloadavg()[0]},
        "limits": {"seconds": LIMIT_S, "gigabytes": LIMIT_GB, "threads": 1},
        "versions": {name: version_of(name) for name in dict.fromkeys(names)},
        "rows": rows,
        "decoding": decoding,
        "scripts": scripts,
    }  # fmt: skip
    made = chosen.out.with_suffix(".part")
    made.write_text(json.dumps(found, indent=1) + "\n", encoding="utf-8")
    os.replace(made, chosen.out)


if __name__ == "__main__":
    main()
