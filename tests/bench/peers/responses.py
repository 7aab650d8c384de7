# SPDX-License-Identifier: MIT
"""okid.identify_frf beside sdypy-EMA (LSCF, LSFD) on the same frequency responses, simulated and measured.

usage: responses.py make FOLDER [DATA] | okid FOLDER | sdypy FOLDER | table FOLDER

`make` writes FRFs (NumPy) and references: three simulations with one input, solved line by line from M, R and K with 1,
2 and 5 % of noise, and H1 of measured records in DATA (shared corpus, reference.json). Each program runs in its own
environment; sdypy-EMA is helped: it is told the true frequencies, which a person would pick in its diagram.
"""

from __future__ import annotations

import json
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np

RECORDS = (
    "tower_wn1",
    "tower_wn2",
    "tower_wn3",
    "frame3_flex_quake",
    "silverbox_multisine",
)


def _simulated(seed: int, noise: float) -> tuple[Any, Any, Any, list[float], list[float]]:
    r = np.random.default_rng(seed)
    n = 7
    M, K = np.diag(r.uniform(0.5, 2.0, n)), np.diag(r.uniform(2e4, 9e5, n))
    for a in range(n):
        for b in range(a + 1, n):
            k = r.uniform(0.0, 2.5e5)
            K[[a, b], [a, b]] += k
            K[a, b] -= k
            K[b, a] -= k
    R = 1.2 * M + 6e-6 * K
    poles = np.linalg.eigvals(
        np.block(
            [
                [np.zeros((n, n)), np.eye(n)],
                [-np.linalg.solve(M, K), -np.linalg.solve(M, R)],
            ]
        )
    )
    poles = sorted(poles[poles.imag > 0], key=abs)
    f = np.arange(0.25, 1.15 * abs(poles[-1]) / 2 / np.pi, 0.25)
    h = np.array([-(w**2) * np.linalg.inv(K - w**2 * M + 1j * w * R)[:, :1] for w in 2 * np.pi * f])
    h += noise * np.sqrt(np.mean(np.abs(h) ** 2, axis=0) / 2) * (r.normal(size=h.shape) + 1j * r.normal(size=h.shape))
    return (
        f,
        h,
        None,
        [abs(p) / 2 / np.pi for p in poles],
        [-p.real / abs(p) for p in poles],
    )


def make(folder: Path, data: Path | None) -> None:
    folder.mkdir(parents=True, exist_ok=True)
    about: dict[str, Any] = {}
    for seed, noise in ((11, 0.01), (12, 0.02), (13, 0.05)):
        f, h, _, fn, zn = _simulated(seed, noise)
        name = f"simulated, 7 modes, {100 * noise:g} % noise"
        np.savez(folder / f"{len(about)}.npz", f=f, h=h)
        about[name] = [{"f": a, "f_tol": 0.01 * a, "zeta": z, "zeta_tol": None} for a, z in zip(fn, zn, strict=True)]
    if data is not None:
        import okid

        for record in json.loads((data / "reference.json").read_text())["records"]:
            if record["id"] not in RECORDS:
                continue
            own = okid.read_csv(data / record["file"]).select(record["inputs"] + record["outputs"], record["file"])
            n_u, low = len(record["inputs"]), min(mode["f"] for mode in record["modes"])
            length = min(
                len(own.samples),
                2 ** int(np.log2(max(120.0 * record["fs"] / low, 1024.0))),
            )
            measured = okid.frf.h1(own.samples[:, :n_u], own.samples[:, n_u:], record["fs"], nperseg=length)
            top = min(1.4 * max(mode["f"] for mode in record["modes"]), record["fs"] / 2)
            keep = (measured.frequency_hz > 0) & (measured.frequency_hz < top)
            np.savez(
                folder / f"{len(about)}.npz",
                f=measured.frequency_hz[keep],
                h=measured.response[keep],
            )
            about[record["id"]] = record["modes"]
    (folder / "about.json").write_text(json.dumps(about))


def of_okid(f: Any, h: Any, modes: list[Any]) -> list[list[float]]:
    import okid

    return [[m.frequency_hz, m.damping_ratio] for m in okid.identify_frf(okid.frf.Frf.of(f, h)).confident_modes]


def of_sdypy(f: Any, h: Any, modes: list[Any]) -> list[list[float]]:
    from sdypy import EMA

    grow = 200.0 / f[-1]  # its search for picked poles ends with windows of 2 Hz
    f = f * grow
    model = EMA.Model(h[:, :, 0].T, f, lower=f[0], upper=f[-1], pol_order_high=60, frf_form="accelerance")
    model.get_poles(show_progress=False)
    model.select_closest_poles([grow * mode["f"] for mode in modes], f_window=10)
    return [[a / grow, b] for a, b in zip(model.nat_freq, model.nat_xi, strict=True)]


def run(who: str, folder: Path, way: Any) -> None:
    out = {}
    for k, (name, modes) in enumerate(json.loads((folder / "about.json").read_text()).items()):
        data = np.load(folder / f"{k}.npz")
        begin = time.perf_counter()
        try:
            found: Any = way(data["f"], data["h"], modes)
        except Exception as fault:  # a failure is a row of the table
            found = str(fault)[:120]
        out[name] = [found, time.perf_counter() - begin]
    (folder / f"{who}.json").write_text(json.dumps(out))


def table(folder: Path) -> None:
    about = json.loads((folder / "about.json").read_text())
    for who in ("okid", "auto", "sdypy", "pyoma", "koma"):
        if not (folder / f"{who}.json").exists():
            continue
        for name, (found, seconds) in json.loads((folder / f"{who}.json").read_text()).items():
            if isinstance(found, str):
                print(f"| {who} | {name} | failed: {found} | | | |")
                continue
            hits, errors, widths = 0, [], []
            for mode in about[name]:
                best = min(found, key=lambda one: abs(one[0] - mode["f"]), default=[1e9, 1])
                if abs(best[0] - mode["f"]) <= mode["f_tol"]:
                    hits += 1
                    errors.append(abs(best[0] / mode["f"] - 1))
                    if mode["zeta"]:
                        widths.append(abs(best[1] / mode["zeta"] - 1))
            cells = [f"{100 * np.median(v):.3g} / {100 * max(v):.3g} %" if v else "-" for v in (errors, widths)]
            extra = sum(all(abs(one[0] - m["f"]) > 2 * m["f_tol"] for m in about[name]) for one in found)
            hit = f"{hits} of {len(about[name])}, {extra} more"
            print(f"| {who} | {name} | {hit} | {cells[0]} | {cells[1]} | {seconds:.2f} |")


def main(make: Any, ways: dict[str, Any]) -> None:
    """`make FOLDER [DATA]`, `table FOLDER`, or one of the ways and the folder."""
    what, place, *rest = sys.argv[1:]
    if what == "make":
        make(Path(place), Path(rest[0]) if rest else None)
    elif what == "table":
        table(Path(place))
    else:
        run(what, Path(place), ways[what])


if __name__ == "__main__":
    main(make, {"okid": of_okid, "sdypy": of_sdypy})
