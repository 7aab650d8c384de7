# SPDX-License-Identifier: MIT
"""okid's pLSCF and method auto of ambient records and its set-ups with references in common beside pyOMA-2 (pLSCF,
SSI-cov in PreGER) and koma (SSI-cov; no set-ups).

usage: ambient.py make FOLDER [DATA] | okid FOLDER | auto FOLDER | pyoma FOLDER | koma FOLDER | table FOLDER

`make` writes outputs and references: chains of six masses under random forces, and records of DATA (shared corpus,
reference.json) without their inputs; "set-ups": the same in two halves, each with two references and half of the other
outputs. Each program runs in its own environment; pyOMA-2 and koma are helped: they are told the true frequencies,
which a person would pick in their diagrams, and the poles nearest to them at the highest orders are taken.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
from responses import main
from scipy.signal import cont2discrete, dlsim

RECORDS = ("bridge_sim", "tower_wn1", "tower_wn2", "tower_wn3", "frame3_flex_decay")
REFERENCES, TIMES = (0, 1), 12  # a model's states, of the modes


def _simulated(seed: int, noise: float) -> tuple[Any, float, list[dict[str, Any]]]:
    """Accelerations (30,000, 6) of a chain; forces of different strength on all masses."""
    r = np.random.default_rng(seed)
    n, fs = 6, 100.0
    M, k = np.diag(r.uniform(0.8, 1.6, n)), r.uniform(5e3, 1.5e4, n + 1)
    K = np.diag(k[:-1] + k[1:]) - np.diag(k[1:-1], 1) - np.diag(k[1:-1], -1)
    R = 0.4 * M + 1.5e-4 * K
    lower = np.hstack([-np.linalg.solve(M, K), -np.linalg.solve(M, R)])
    A, B = np.vstack([np.eye(n, 2 * n, n), lower]), np.vstack([np.zeros((n, n)), np.linalg.inv(M)])
    *system, dt = cont2discrete((A, B, lower, np.linalg.inv(M)), 1.0 / fs)
    y = dlsim((*system, dt), r.normal(size=(30000, n)) * r.uniform(0.5, 2.0, n))[1]
    poles = np.linalg.eigvals(A)
    modes = [{"f": abs(p) / 2 / np.pi, "f_tol": 0.01 * abs(p) / 2 / np.pi, "zeta": -p.real / abs(p)}
             for p in sorted(poles[poles.imag > 0], key=abs)]  # fmt: skip
    return y + noise * y.std(axis=0) * r.normal(size=y.shape), fs, modes


def make(folder: Path, data: Path | None) -> None:
    folder.mkdir(parents=True, exist_ok=True)
    found: list[tuple[str, Any, float, Any]] = []
    for seed, noise in ((21, 0.01), (22, 0.05), (23, 0.2)):
        found.append((f"chain, {100 * noise:g} % noise", *_simulated(seed, noise)))
    for record in json.loads((data / "reference.json").read_text())["records"] if data is not None else []:
        if record["id"] in RECORDS:
            import okid

            own = okid.read_csv(data / record["file"]).select(record["outputs"], record["file"])
            found.append((record["id"], own.samples, record["fs"], record["modes"]))
    about = {}
    for name, y, fs, modes in found:
        for kind in ("one", "set-ups") if y.shape[1] > 3 else ("one",):
            np.savez(folder / f"{len(about)}.npz", f=np.array([fs, kind == "set-ups"]), h=y)
            about[f"{name}, {kind}" if kind != "one" else name] = modes
    (folder / "about.json").write_text(json.dumps(about))


def halves(y: Any) -> tuple[list[Any], list[list[int]]]:
    """Two set-ups, and the channels of each."""
    rest = list(range(len(REFERENCES), y.shape[1]))
    channels = [[*REFERENCES, *rest[: len(rest) // 2]], [*REFERENCES, *rest[len(rest) // 2 :]]]
    return [part[:, own] for part, own in zip(np.array_split(y, 2), channels, strict=True)], channels


def of_okid(f: Any, y: Any, modes: list[Any]) -> list[list[float]]:
    import okid

    band = (0.0, 1.3 * max(mode["f"] for mode in modes))
    if f[1]:
        parts, channels = halves(y)
        names = [[f"y{k}" for k in own] for own in channels]
        result = okid.identify_setups(None, parts, fs=f[0], output_names=names, band=band, method="plscf")
    else:
        result = okid.identify(None, y, fs=f[0], method="plscf", band=band)
    return [[m.frequency_hz, m.damping_ratio] for m in result.confident_modes]


def of_auto(f: Any, y: Any, modes: list[Any]) -> list[list[float]]:
    import okid

    if f[1]:
        raise ValueError("method auto takes no set-ups")
    result = okid.identify(None, y, fs=f[0], band=(0.0, 1.3 * max(mode["f"] for mode in modes)))
    return [[m.frequency_hz, m.damping_ratio] for m in result.confident_modes]


def nearest(modes: list[Any], columns: list[tuple[Any, Any]]) -> list[list[float]]:
    """The median of what each of some orders has nearest to a mode; columns: frequencies, damping ratios."""
    out = []
    for mode in modes:
        near = []
        for poles, widths in columns:
            if np.any(np.isfinite(poles)):
                k = int(np.nanargmin(np.abs(poles - mode["f"])))
                near.append((poles[k], widths[k]))
        near = [one for one in near if abs(one[0] / mode["f"] - 1) < 0.05]
        if near:
            out.append([float(np.median([one[j] for one in near])) for j in (0, 1)])
    return out


def of_koma(f: Any, y: Any, modes: list[Any]) -> list[list[float]]:
    from koma.oma import covssi
    from scipy.signal import decimate

    if f[1]:
        raise ValueError("koma merges no set-ups")
    step, most = max(1, int(f[0] / (2.6 * 1.3 * max(mode["f"] for mode in modes)))), TIMES * len(modes)
    fs, y = float(f[0]) / step, decimate(y, step, axis=0) if step > 1 else y
    orders = np.arange(most - 18, most + 1, 2)
    poles, _ = covssi(y, fs, max(30, most // 2), orders, showinfo=False, return_flat=False)
    return nearest(modes, [(np.abs(one) / 2 / np.pi, -one.real / np.abs(one)) for one in poles])


def of_pyoma(f: Any, y: Any, modes: list[Any]) -> list[list[float]]:
    from pyoma2.algorithms import SSI_MS, pLSCF
    from pyoma2.setup import MultiSetup_PreGER, SingleSetup

    fs, most = float(f[0]), TIMES * len(modes)
    step = max(1, int(fs / (2.6 * 1.3 * max(mode["f"] for mode in modes))))
    if f[1]:
        parts, _ = halves(y)
        setup: Any = MultiSetup_PreGER(fs, [list(REFERENCES)] * 2, parts)
        way: Any = SSI_MS(name="a", br=max(30, most // 2), ordmax=most, step=2)
    else:
        setup, way = SingleSetup(y, fs=fs), pLSCF(name="a", ordmax=most // 2, nxseg=1024)
    if step > 1:
        setup.decimate_data(q=step)
    setup.add_algorithms(way)
    setup.run_by_name("a")
    return nearest(modes, list(zip(way.result.Fn_poles.T[-10:], way.result.Xi_poles.T[-10:], strict=True)))


if __name__ == "__main__":
    main(make, {"okid": of_okid, "auto": of_auto, "pyoma": of_pyoma, "koma": of_koma})
