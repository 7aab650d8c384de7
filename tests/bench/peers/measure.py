# SPDX-License-Identifier: MIT
"""One way of one peer on one case, in a process of its own: one line of JSON for each run, written as it ends.

usage: measure.py ADAPTER WAY CASE FOLDER OUT.jsonl LIMIT_GB LONG_S TURNS NOISE:SEED,SEED ...

A record is identified up to TURNS times, as often as LONG_S / 2 allows; its row has the least time. Seconds are those
of the processor, by all threads of the process: what other programs take of the machine is not in them. Before a
record a line says at what time of the processor it begins: compare.py ends what takes too long. (A timer of the
processor's time in this process would make its clock coarse.) A run that wants more than LIMIT_GB of address space
gets no more. After a run longer than LONG_S only one record of each level of noise is taken.
"""

from __future__ import annotations

import contextlib
import importlib
import json
import os
import resource
import sys
import time
import warnings
from pathlib import Path
from typing import Any

import numpy as np
from problem import CASES, Modes, modes_of, read_problem, worst_errors


def memory_mb(field: str) -> float:
    status = Path("/proc/self/status").read_text(encoding="ascii")
    return int(status.split(f"{field}:")[1].split()[0]) / 1024.0


def forget_peak() -> None:
    """VmHWM starts anew at what is held now (not to be had everywhere: then it counts from the start)."""
    with contextlib.suppress(OSError):
        Path("/proc/self/clear_refs").write_text("5", encoding="ascii")


def run_once(way: Any, problem: Any) -> tuple[dict[str, float], Any]:
    """Seconds of the processor and of the wall clock, memory over what imports and record hold."""
    forget_peak()
    before = memory_mb("VmRSS")
    wall, busy = time.perf_counter(), time.process_time()
    answer = way(problem)
    busy, wall = time.process_time() - busy, time.perf_counter() - wall
    return {"seconds": busy, "wall_seconds": wall, "memory_mb": max(0.0, memory_mb("VmHWM") - before)}, answer


def run_turns(way: Any, problem: Any, turns: int, enough_s: float) -> tuple[dict[str, float], Any]:
    """The least costs of several runs, how many they were, and the last answer."""
    costs, answer = run_once(way, problem)
    spent, done = costs["seconds"], 1
    while done < turns and spent + costs["seconds"] < enough_s:
        again, answer = run_once(way, problem)
        spent, done = spent + again["seconds"], done + 1
        most = max(costs["memory_mb"], again["memory_mb"])
        costs = {key: min(value, again[key]) for key, value in costs.items()} | {"memory_mb": most}
    return costs | {"runs": done}, answer


def one_line(fault: Exception) -> str:
    said = str(fault).strip().splitlines()
    return f"{type(fault).__name__}: {said[0] if said else ''}"[:200]


def main() -> None:
    adapter, way_name, case_name, folder, out, limit_gb, long_s, turns, *levels = sys.argv[1:]
    limit = int(float(limit_gb) * 2**30)
    case = CASES[case_name]
    with open(out, "w", encoding="utf-8") as file, open(os.devnull, "w", encoding="utf-8") as nowhere:

        def say(**row: Any) -> None:
            file.write(json.dumps(row) + "\n")
            file.flush()

        def attempt(noise: float, seed: int) -> float:
            problem = read_problem(Path(folder), case, noise, seed)
            say(noise=noise, begun=time.process_time())
            try:
                # What a peer prints is not part of the answer.
                with contextlib.redirect_stdout(nowhere), contextlib.redirect_stderr(nowhere):
                    costs, answer = run_turns(way, problem, int(turns), 0.5 * float(long_s))
                found = answer if isinstance(answer, Modes) else modes_of(np.asarray(answer), problem.fs)
                f, zeta, missing = worst_errors(case, found)
            except MemoryError:
                say(noise=noise, seed=seed, failed=f"more than {limit_gb} GB of memory")
                return -1.0
            except Exception as fault:  # a peer may raise anything: it is its result
                say(noise=noise, seed=seed, failed=one_line(fault))
                return -1.0
            say(noise=noise, seed=seed, frequency_error=f, damping_error=zeta, missing=missing, **costs)
            return costs["seconds"]

        try:
            warnings.simplefilter("ignore")
            with contextlib.redirect_stdout(nowhere), contextlib.redirect_stderr(nowhere):
                way = importlib.import_module(f"adapters.{adapter}").WAYS[way_name]
        except Exception as fault:
            say(failed=one_line(fault))
            return
        resource.setrlimit(resource.RLIMIT_AS, (limit, limit))
        slow = False
        for level in levels:
            noise, seeds = level.split(":")
            for seed in seeds.split(","):
                if slow and seed != seeds.split(",")[0]:
                    break
                took = attempt(float(noise), int(seed))
                slow = slow or took > float(long_s)
                if took < 0.0 and level == levels[0]:
                    return  # it fails on the first record: it would on the others


if __name__ == "__main__":
    main()
