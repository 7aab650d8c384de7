#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""Simulated vibration tests of 21 kinds: what the default method finds, misses and invents.

usage: run.py [OKID] [--only KIND ..] [--seeds 1,2,3] [--keep FOLDER] [--extra "OPTIONS"]   default: build/okid
A row per kind, all its seeds together: signed modes, those found, false ones, the median error of the damping ratio of
those found, the frequencies of the missed and the false. truth.py defines signed, optional and false. The kind `pairs`
stands for the nine small ones of two close modes; it is run only if named. A record is a function of kind and seed
alone. --keep leaves records, true modes and results in the folder. --extra is for `okid identify`, as "--method plscf".
Exit code 1 if okid cannot be run, or if of all kinds fewer than 95 % of the modes are found or more than 2 % of what is
given as a mode is false; with --only or --extra 0 whatever is found.
"""

from __future__ import annotations

import argparse
import json
import os
import shlex
import statistics
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from dataclasses import asdict
from pathlib import Path
from typing import Any

import ambient_kinds
import forced_kinds
import numpy as np
from simulate import Record
from truth import Mode, Score, score, true_modes

ROOT = Path(__file__).resolve().parents[2]
USUAL = ambient_kinds.KINDS | forced_kinds.KINDS
KINDS = USUAL | ambient_kinds.PAIRS
LEAST_FOUND, MOST_FALSE = 0.95, 0.02
STREAM = 13  # of the random numbers; another one makes other records of the same kinds


def make(kind: str, seed: int) -> Record:
    return KINDS[kind].make(np.random.default_rng([KINDS[kind].number, seed, STREAM]))


def names(record: Record) -> tuple[list[str], list[str]]:
    """Of inputs and outputs."""
    inputs = 0 if record.inputs is None else record.inputs.shape[1]
    return [f"u{i + 1}" for i in range(inputs)], [f"y{i + 1}" for i in range(record.outputs.shape[1])]


def write(record: Record, modes: list[Mode], base: Path) -> None:
    """BASE.csv, and the true modes as BASE.truth.json."""
    inputs, outputs = names(record)
    data = record.outputs if record.inputs is None else np.hstack([record.inputs, record.outputs])
    header = f"# fs_hz: {record.rate:g}\n{','.join(inputs + outputs)}"
    np.savetxt(f"{base}.csv", data, fmt="%.7g", delimiter=",", comments="", header=header)
    listed = [{"signed": mode.signed} | asdict(mode) for mode in modes]
    Path(f"{base}.truth.json").write_text(json.dumps(listed, indent=1, default=float) + "\n", encoding="utf-8")


def identify(okid: Path, record: Record, base: Path, extra: list[str]) -> tuple[list[dict[str, Any]], str]:
    """Confident modes of BASE.csv, and why there is no result."""
    inputs, outputs = names(record)
    result = Path(f"{base}.result.json")
    result.unlink(missing_ok=True)
    command = [str(okid), "identify", f"{base}.csv", "--outputs", ",".join(outputs), "--json", str(result), "--quiet"]
    command += ["--inputs", ",".join(inputs)] if inputs else []
    command += ["--sensing", "displacement"] if record.quantity == "d" else []
    threads = {"OPENBLAS_NUM_THREADS": "1"}
    done = subprocess.run(
        [*command, *extra],
        env={**os.environ, **threads},
        stdin=subprocess.DEVNULL,
        capture_output=True,
        text=True,
        check=False,
    )
    if not result.exists():
        said = done.stderr.strip().splitlines()
        return [], f"exit code {done.returncode}: {said[0] if said else 'no message'}"
    modes = json.loads(result.read_text(encoding="utf-8"))["modes"]
    return [mode for mode in modes if mode["confident"]], ""


def row(kind: str, total: Score) -> str:
    errors = [abs(error) for error in total.damping_errors]
    damping = f"{100 * statistics.median(errors):4.0f} %" if errors else "     -"
    return f"{kind:11}{total.signed:7}{total.found:7}{len(total.false):7}{len(total.missed):8}{damping:>9}"


def frequencies(values: list[float]) -> str:
    return " ".join(f"{value:.4g}" for value in sorted(values))


def run(okid: Path, kinds: list[str], seeds: list[int], folder: Path, extra: list[str]) -> Score:
    total = Score()
    print(f"{'kind':11} signed  found  false  missed  damping  which (seed: Hz)")
    for kind in kinds:
        of_kind, missed, false, refused = Score(), [], [], []
        for seed in seeds:
            base = folder / f"{kind}_{seed}"
            record = make(kind, seed)
            modes = true_modes(record)
            write(record, modes, base)
            found, why = identify(okid, record, base, extra)
            one = score(modes, found)
            of_kind.add(one)
            missed += [f"{seed}: {frequencies(one.missed)}"] if one.missed else []
            false += [f"{seed}: {frequencies(one.false)}"] if one.false else []
            refused += [f"seed {seed}: {why}"] if why else []
        total.add(of_kind)
        details = [f"missed {', '.join(missed)}" if missed else "", f"false {', '.join(false)}" if false else ""]
        print("  ".join([row(kind, of_kind), "; ".join(filter(None, details + refused))]).rstrip(), flush=True)
    print(row("total", total), flush=True)
    return total


def chosen(only: list[str] | None) -> Iterator[str]:
    """The kinds asked for, those of each family in place of its name."""
    for kind in only or sorted(USUAL, key=lambda name: USUAL[name].number):
        yield from ambient_kinds.PAIRS if kind == "pairs" else [kind]


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("okid", nargs="?", type=Path, default=ROOT / "build" / "okid")
    parser.add_argument("--only", nargs="+", metavar="KIND", choices=[*KINDS, "pairs"])
    parser.add_argument("--seeds", default="1,2,3")
    parser.add_argument("--keep", type=Path, metavar="FOLDER")
    parser.add_argument("--extra", default="", metavar="OPTIONS")
    given = parser.parse_args()
    okid, seeds = given.okid.absolute(), [int(seed) for seed in given.seeds.split(",")]
    try:
        subprocess.run([okid, "--version"], stdin=subprocess.DEVNULL, capture_output=True, check=True)
    except (OSError, subprocess.CalledProcessError) as error:
        print(f"run.py: okid cannot be run: {error}", file=sys.stderr)
        return 1
    with tempfile.TemporaryDirectory() as temporary:
        folder = given.keep or Path(temporary)
        folder.mkdir(parents=True, exist_ok=True)
        total = run(okid, list(chosen(given.only)), seeds, folder, shlex.split(given.extra))
    false = len(total.false) / max(1, total.found + len(total.false))
    good = total.found >= LEAST_FOUND * total.signed and false <= MOST_FALSE
    return 0 if good or given.only or given.extra else 1


if __name__ == "__main__":
    sys.exit(main())
