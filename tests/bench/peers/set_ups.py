# SPDX-License-Identifier: MIT
"""Set-ups of a simulated beam with references in common: okid (PoSER and PreGER) beside pyOMA-2 (both), same files.

usage: set_ups.py make FOLDER | okid FOLDER | pyoma FOLDER | table FOLDER

`make` writes CSV files of a simply supported beam: five modes at 1.2 n² Hz, 1 % damping, twelve places. Three set-ups
of 300 s share two references; noise drives every place, with other strengths in each set-up. Programs run in their own
environments; tests/support and tools belong on PYTHONPATH. pyOMA-2 is helped: it gets the true frequencies, which a
person would pick in its diagram.
"""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Any

import numpy as np

PLACES, MODES, FS, SECONDS, DAMPING = 12, 5, 100.0, 300.0, 0.01
REFERENCES, MOVED = (2, 7), ((0, 1, 3), (4, 5, 6, 8), (9, 10, 11))
NOISE = (0.02, 0.1, 0.3)
SEEDS = 5
COLUMNS = [[*REFERENCES, *moved] for moved in MOVED]
ROWS, ORDER = 40, 40  # of pyOMA-2


def frequencies() -> Any:
    return 1.2 * np.arange(1, MODES + 1) ** 2


def shapes() -> Any:
    return np.sin(np.pi * np.outer(np.arange(1, PLACES + 1) / (PLACES + 1), np.arange(1, MODES + 1)))


def names(own: list[int]) -> list[str]:
    return [f"p{place}" for place in own]


def make(folder: Path) -> None:
    from moved_sensors import Structure, ambient

    folder.mkdir(parents=True, exist_ok=True)
    beam = Structure(FS, frequencies(), np.full(MODES, DAMPING), shapes(), np.ones(MODES))
    for level in NOISE:
        for seed in range(SEEDS):
            for k, own in enumerate(COLUMNS):
                y = ambient(beam, SECONDS, 100 * seed + k, level)[:, own]
                time = np.arange(len(y))[:, None] / FS
                head = ",".join(["time", *names(own)])
                path = folder / f"{level:g}_{seed}_{k}.csv"
                np.savetxt(path, np.hstack([time, y]), "%.9g", ",", header=head, comments="")


def files(folder: Path, level: float, seed: int) -> list[Any]:
    return [np.loadtxt(folder / f"{level:g}_{seed}_{k}.csv", delimiter=",", skiprows=1)[:, 1:] for k in range(3)]


def row(f: float, zeta: float, shape: Any) -> list[Any]:
    return [float(f), float(zeta), np.real(shape).tolist(), np.imag(shape).tolist()]


def of_okid(parts: list[Any]) -> dict[str, Any]:
    import okid

    out = {}
    for way, method in (("okid, PoSER", "auto"), ("okid, PreGER", "plscf")):
        try:
            found = okid.identify_setups(
                None, parts, fs=FS, output_names=[names(own) for own in COLUMNS], method=method
            )
        except okid.Error:
            out[way] = []
            continue
        order = [found.outputs.index(f"p{place}") for place in range(PLACES)]
        out[way] = [row(m.frequency_hz, m.damping_ratio, m.shape[order]) for m in found.confident_modes]
    return out


def of_pyoma(parts: list[Any]) -> dict[str, Any]:
    from pyoma2.algorithms import SSI, SSI_MS
    from pyoma2.setup import MultiSetup_PoSER, MultiSetup_PreGER, SingleSetup

    references, wanted = [[0, 1]] * len(parts), frequencies().tolist()
    order = np.argsort([*REFERENCES, *(place for moved in MOVED for place in moved)])

    def rows(result: Any) -> list[Any]:
        shape = np.asarray(result.Phi)[order]
        return [row(*one) for one in zip(result.Fn, result.Xi, shape.T, strict=True) if np.isfinite(one[0])]

    single = []
    for part in parts:
        one = SingleSetup(part, fs=FS)
        one.add_algorithms(SSI(name="a", method="cov", br=ROWS, ordmax=ORDER, step=2))
        one.run_by_name("a")
        one.mpe("a", sel_freq=wanted, order_in=ORDER)
        single.append(one)
    poser = MultiSetup_PoSER(references, single, ["a"])
    preger = MultiSetup_PreGER(FS, references, parts)
    preger.add_algorithms(SSI_MS(name="a", br=ROWS, ordmax=ORDER, step=2))
    preger.run_by_name("a")
    preger.mpe("a", sel_freq=wanted, order_in=ORDER)
    return {"pyOMA-2, PoSER": rows(poser.merge_results()["a"]), "pyOMA-2, PreGER": rows(preger["a"].result)}


def run(who: str, folder: Path, way: Any) -> None:
    found = [[level, way(files(folder, level, seed))] for level in NOISE for seed in range(SEEDS)]
    (folder / f"{who}.json").write_text(json.dumps(found))


def table(folder: Path) -> None:
    """Modes found within 2 %, false ones, rms errors in percent, and the least MAC with the true shape."""
    f0, truth, rows = frequencies(), shapes(), {}
    for who in ("okid", "pyoma"):
        if not (folder / f"{who}.json").exists():
            continue
        for level, ways in json.loads((folder / f"{who}.json").read_text()):
            for way, modes in ways.items():
                row = rows.setdefault((level, way), [0, 0, [], [], []])
                for f, zeta, re, im in modes:
                    k, shape = int(np.argmin(np.abs(f0 / f - 1.0))), np.array(re) + 1j * np.array(im)
                    if abs(f / f0[k] - 1.0) > 0.02:
                        row[1] += 1
                        continue
                    row[0] += 1
                    row[2].append(f / f0[k] - 1.0)
                    row[3].append(zeta / DAMPING - 1.0)
                    power = np.sum(np.abs(shape) ** 2) * np.sum(truth[:, k] ** 2)
                    row[4].append(abs(truth[:, k] @ shape) ** 2 / power)
    print("| noise | program | modes | false | f off | ζ off | 1 − MAC, median | worst MAC |\n|" + "---|" * 8)
    for (level, way), (hits, false, f, zeta, mac) in sorted(rows.items()):
        off = [100.0 * float(np.sqrt(np.mean(np.square(one)))) for one in (f, zeta)]
        print(f"| {100 * level:g} % | {way} | {hits} of {MODES * SEEDS} | {false} | {off[0]:.3f} % | {off[1]:.1f} % | "
              f"{1 - np.median(mac):.1e} | {min(mac):.4f} |")  # fmt: skip


if __name__ == "__main__":
    what, place = sys.argv[1], Path(sys.argv[2])
    if what in ("make", "table"):
        {"make": make, "table": table}[what](place)
    else:
        run(what, place, {"okid": of_okid, "pyoma": of_pyoma}[what])
