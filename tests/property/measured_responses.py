# SPDX-License-Identifier: MIT
"""Files of frequency responses as a laboratory measures them, with the modes that are in them.

Structures are closed forms (beam, plate) or springs between masses. Forces and motions are signals: modal equations
are integrated sample by sample at eight times the rate of the recorder, filtered, taken down, given noise, and averaged
to H1 under a window. So no response is computed from a pole, and leakage, noise and a bad low end are those of a
measurement.

    python measured_responses.py FOLDER [SEED ...]    writes the files and truth.json
"""

from __future__ import annotations

import json
import sys
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import eigh
from scipy.signal import butter, cont2discrete, decimate, lfilter, sosfilt

Real = NDArray[np.float64]
Complex = NDArray[np.complex128]
KINDS = ("roving_hammer", "roving_sensor", "receptance", "accelerance_g", "decibel_phase", "half_the_lines")
STRUCTURES = ("beam", "plate", "masses")
OVER = 8  # steps of the integration in a sample
CLAMPED_FREE = (1.8751, 4.6941, 7.8548, 10.9955, 14.1372, 17.2788, 20.4204, 23.5619, 26.7035, 29.8451)


@dataclass
class Structure:
    f: Real  # Hz
    zeta: Real
    phi: Real  # points x modes, unit modal mass

    def moved(self, share: Real) -> Structure:
        return Structure(self.f * (1 + share), self.zeta, self.phi)


@dataclass
class File:
    """Responses of all pairs and what is true of them."""

    name: str
    f: Real
    h: Complex  # lines x outputs x inputs
    coherence: Real | None
    inputs: list[int]
    outputs: list[int]
    truth: Structure
    low_hz: float
    kind: str = ""
    sensing: int = 12  # universal file: 8 displacement, 12 acceleration
    seen: list[int] = field(default_factory=list)  # modes that stand out of the noise


def structure(name: str, seed: int) -> Structure:
    r = np.random.default_rng([seed, STRUCTURES.index(name)])
    if name == "beam":
        b, x = np.array(CLAMPED_FREE), np.linspace(0.12, 1.0, 9)
        s = (np.cosh(b) + np.cos(b)) / (np.sinh(b) + np.sin(b))
        phi = np.array([np.cosh(b * p) - np.cos(b * p) - s * (np.sinh(b * p) - np.sin(b * p)) for p in x])
        f = r.uniform(5.0, 8.0) * (b / b[0]) ** 2
        return Structure(f, r.uniform(0.004, 0.02, len(f)), phi)
    if name == "plate":
        side = r.uniform(0.9, 1.12)  # nearly square: close pairs
        orders = [(m, n) for m in range(1, 7) for n in range(1, 7)]
        f = np.array([m**2 + (n / side) ** 2 for m, n in orders]) * r.uniform(17.0, 22.0)
        at = r.uniform(0.08, 0.92, (10, 2))
        phi = np.array([[2 * np.sin(m * np.pi * x) * np.sin(n * np.pi * y) for m, n in orders] for x, y in at])
        order = np.argsort(f)[:18]
        return Structure(f[order], r.uniform(0.003, 0.012, 18), phi[:, order])
    n = 9
    M, K = np.diag(r.uniform(0.5, 2.0, n)), np.diag(r.uniform(1e4, 4e4, n))
    for a in range(n):
        for b2 in (a + 1, a + 2):
            if b2 < n:
                k = r.uniform(1e5, 4e5)
                K[[a, b2], [a, b2]] += k
                K[a, b2] -= k
                K[b2, a] -= k
    w2, phi = eigh(K, M)
    return Structure(np.sqrt(w2) / (2 * np.pi), r.uniform(0.005, 0.02, n), phi)


def _motion(s: Structure, force: Real, at: int, outputs: list[int], dt: float, displacement: bool) -> Real:
    """Motions of the points under a force that runs straight between its samples; outputs x samples."""
    out = np.zeros((len(outputs), len(force)))
    for f, zeta, phi in zip(s.f, s.zeta, s.phi.T, strict=True):
        w = 2 * np.pi * f
        A, B = np.array([[0.0, 1.0], [-(w**2), -2 * zeta * w]]), np.array([[0.0], [1.0]])
        C, D = (np.array([[1.0, 0.0]]), [[0.0]]) if displacement else (A[1:], [[1.0]])
        Ad, Bd, Cd, Dd, _ = cont2discrete((A, B, C, np.array(D)), dt, "foh")
        a = np.poly(Ad)
        b = np.poly(Ad - Bd @ Cd) + (float(Dd[0, 0]) - 1) * a
        out += np.outer(phi[outputs], lfilter(b, a, phi[at] * force))
    return out


def _recorded(x: Real) -> Real:
    return np.asarray(decimate(x, OVER, ftype="fir", axis=-1))


def _drift(r: np.random.Generator, shape: tuple[int, ...], fs: float, corner: float) -> Real:
    """Noise that rises below a corner, rms 1 above it: of charge amplifiers and integrators."""
    white = r.normal(size=shape)
    spectrum = np.fft.rfft(white, axis=-1)
    f = np.fft.rfftfreq(shape[-1], 1 / fs)
    return np.asarray(np.fft.irfft(spectrum * (1 + (corner / np.maximum(f, fs / shape[-1])) ** 2), shape[-1], axis=-1))


def _h1(u: Real, y: Real, length: int, step: int, window: Real) -> tuple[Complex, Real]:
    """One force, outputs x samples. lines x outputs: H1 and coherence."""
    lines = length // 2 + 1
    uu, yu, yy = np.zeros(lines), np.zeros((len(y), lines), complex), np.zeros((len(y), lines))
    for k in range(0, len(u) - length + 1, step):
        U, Y = np.fft.rfft(window * u[k : k + length]), np.fft.rfft(window * y[:, k : k + length], axis=1)
        uu, yu, yy = uu + np.abs(U) ** 2, yu + Y * np.conj(U), yy + np.abs(Y) ** 2
    return (yu / uu).T, (np.abs(yu) ** 2 / (uu * yy)).T


@dataclass
class Test:
    """How it is measured."""

    fs: float
    length: int
    noise: float  # of the rms of a channel
    averages: int
    low_hz: float  # below it the force has no power and the sensors drift
    hammer: bool = False
    displacement: bool = False


def _measure(r: np.random.Generator, s: Structure, t: Test, at: int, outputs: list[int]) -> tuple[Complex, Real]:
    fine, length = t.fs * OVER, t.length
    if t.hammer:
        count, force = length * t.averages, np.zeros(length * t.averages * OVER)
        for k in range(t.averages):
            width = int(fine * r.uniform(0.8, 1.0) / (0.55 * t.fs))
            first = (k * length + length // 64) * OVER + int(r.integers(0, OVER))
            force[first : first + width] += r.uniform(0.7, 1.3) * np.hanning(width)
        step, window = length, np.ones(length)
    else:
        count = (length // 2) * (t.averages + 1)
        force = r.normal(size=count * OVER)
        step, window = length // 2, np.asarray(0.5 - 0.5 * np.cos(2 * np.pi * np.arange(length) / length))
    force = sosfilt(butter(8, 0.45 * t.fs, fs=fine, output="sos"), force)
    if t.low_hz > 0 and not t.hammer:
        force = sosfilt(butter(3, t.low_hz, "high", fs=fine, output="sos"), force)
    y = _motion(s, force, at, outputs, 1 / fine, t.displacement)
    u, y = _recorded(force)[:count], _recorded(y)[:, :count]
    y += t.noise * np.std(y, axis=1, keepdims=True) * _drift(r, y.shape, t.fs, t.low_hz)
    u = u + 0.1 * t.noise * np.std(u) * _drift(r, u.shape, t.fs, t.low_hz)
    return _h1(u, y, length, step, window)


def _stand_out(file: File, noise_of: Real) -> list[int]:
    """Modes of the band whose own peak in some response is four times what it scatters there."""
    out = []
    for k, f in enumerate(file.truth.f):
        if not (1.3 * file.low_hz < f < 0.97 * file.f[-1]):
            continue
        w = 2 * np.pi * f
        peak = np.abs(np.outer(file.truth.phi[file.outputs, k], file.truth.phi[file.inputs, k]))
        peak = peak / (2 * file.truth.zeta[k]) / (w**2 if file.sensing == 8 else 1.0)
        line = int(np.argmin(np.abs(file.f - f)))
        if np.max(peak / noise_of[line]) > 4:
            out.append(k)
    return out


def make(kind: str, name: str, seed: int, repeat: int = 0, drift: float = 3e-4, damping: float = 1) -> File:
    """One file. @param repeat  other noise, other forces, the same structure, points. @param damping  times as much"""
    of = structure(name, seed)
    of.zeta *= damping
    r = np.random.default_rng([seed, KINDS.index(kind), STRUCTURES.index(name), 1])  # the test
    n = np.random.default_rng([seed, KINDS.index(kind), STRUCTURES.index(name), 2, repeat])  # what chance does
    points = list(range(len(of.phi)))
    last, beyond = {"beam": (6, 1.1), "plate": (11, 1.05), "masses": (8, 1.2)}[name]
    top = beyond * of.f[last]
    t = Test(
        fs=2.56 * top,
        length=int(r.choice([2048, 4096])),
        noise=float(r.uniform(0.005, 0.03)),
        averages=int(r.integers(24, 60)),
        low_hz=0.5 * of.f[0] if name != "beam" else 1.5 * of.f[0],
    )
    inputs, outputs = [int(r.integers(1, len(points)))], points
    if kind == "roving_hammer":
        t.hammer, t.averages, t.noise, t.length = True, 5, t.noise / 3, 4096
        inputs, outputs = points, [int(o) for o in r.choice(points[1:], 2, replace=False)]
    t.displacement = kind == "receptance"
    t.noise *= 0.3 if t.displacement else 1.0
    lines = t.length * 10 // 256 * 10
    h, coherence = np.empty((t.length // 2 + 1, len(outputs), len(inputs)), complex), None
    coherence = np.empty(h.shape)
    if kind == "roving_hammer":  # every place at its own temperature
        for i, at in enumerate(inputs):
            h[:, :, i], coherence[:, :, i] = _measure(n, of.moved(drift * n.normal(size=len(of.f))), t, at, outputs)
    elif kind == "roving_sensor":  # three sensors at a time
        for k in range(0, len(outputs), 3):
            part = outputs[k : k + 3]
            moved = of.moved(drift * n.normal(size=len(of.f)))
            h[:, k : k + 3, 0], coherence[:, k : k + 3, 0] = _measure(n, moved, t, inputs[0], part)
    else:
        h[:, :, 0], coherence[:, :, 0] = _measure(n, of, t, inputs[0], outputs)
    f = np.arange(len(h)) * t.fs / t.length
    keep = np.arange(lines + 1)
    if kind == "half_the_lines":
        keep = np.sort(r.choice(keep[1:], lines // 2, replace=False))
    f, h, coherence = f[keep], h[keep], coherence[keep]
    effective = t.averages * (1.0 if t.hammer else 0.75)
    scatter = np.abs(h) * np.sqrt(np.maximum(1 - coherence, 1e-12) / np.maximum(2 * effective * coherence, 1e-12))
    file = File(
        f"{kind}_{name}_{seed}", f, h, coherence, inputs, outputs, of, t.low_hz, kind, 8 if t.displacement else 12
    )
    file.seen = _stand_out(file, scatter)
    if kind not in ("roving_hammer", "accelerance_g") or seed % 2:
        file.coherence = None
    return file


def write(file: File, folder: Path) -> Path:
    """Hammer and sensor tests as universal files, the others as tables."""
    pairs = [(o, i) for i in range(len(file.inputs)) for o in range(len(file.outputs))]
    path = folder / f"{file.name}.{'uff' if file.kind.startswith('roving') else 'csv'}"
    if path.suffix == ".uff":
        path.write_text("".join(_data_sets(file, pairs)), encoding="ascii")
        return path
    names, columns = ["frequency_hz"], [file.f]
    for o, i in pairs:
        own, h = f"{file.outputs[o] + 1}z/{file.inputs[i] + 1}z", file.h[:, o, i]
        if file.kind == "accelerance_g":
            h = h / 9.80665
        if file.kind == "decibel_phase":
            parts = {"db": np.round(20 * np.log10(np.abs(h)), 2), "deg": np.round(np.degrees(np.angle(h)), 1)}
        else:
            parts = {"re": h.real, "im": h.imag}
        if file.coherence is not None:
            parts["coh"] = np.round(file.coherence[:, o, i], 4)
        names += [f"{own}:{key}" for key in parts]
        columns += list(parts.values())
    table = np.array(columns).T
    rows = "\n".join(",".join(f"{x:.8g}" for x in row) for row in table)
    path.write_text(",".join(names) + "\n" + rows + "\n", encoding="ascii")
    return path


def _data_sets(file: File, pairs: list[tuple[int, int]]) -> list[str]:
    out = []
    for o, i in pairs:
        functions = [(4, 5, np.column_stack([file.h[:, o, i].real, file.h[:, o, i].imag]).ravel())]
        if file.coherence is not None:
            functions.append((6, 2, file.coherence[:, o, i]))
        for function, kind, values in functions:
            text = "    -1\n    58\n" + "NONE\n" * 5
            text += f"{function:5d}{0:10d}{1:5d}{0:10d} {'NONE':10s}{file.outputs[o] + 1:10d}{3:4d}"
            text += f" {'NONE':10s}{file.inputs[i] + 1:10d}{3:4d}\n"
            text += f"{kind:10d}{len(file.f):10d}{1:10d}{file.f[0]:13.5e}{file.f[1] - file.f[0]:13.5e}{0:13.5e}\n"
            top = file.sensing if function == 4 else 0
            for what, power in ((18, 0), (top, 0), (13 if function == 4 else 0, 0), (0, 0)):
                text += f"{what:10d}{power:5d}{0:5d}{0:5d} {'NONE':20s} {'NONE':20s}\n"
            for k in range(0, len(values), 6):
                text += "".join(f"{x:13.5e}" for x in values[k : k + 6]) + "\n"
            out.append(text + "    -1\n")
    return out


def mac(a: Complex, b: Real) -> float:
    return float(np.abs(np.vdot(a, b)) ** 2 / (np.vdot(a, a).real * np.vdot(b, b).real))


def score(file: File, modes: list[dict[str, Any]]) -> tuple[list[tuple[int, dict[str, Any]]], list[dict[str, Any]]]:
    """The true modes with the modes of the result that they are (frequency within 1 %, MAC above 0.8), and the modes of
    the result that are none. A true mode that does not stand out counts for neither."""
    places = file.inputs if len(file.inputs) > len(file.outputs) else file.outputs
    left, found = list(modes), []
    for k, f in enumerate(file.truth.f):
        near = [m for m in left if abs(m["frequency_hz"] / f - 1) < max(0.01, file.truth.zeta[k])
                and mac(_shape(m), file.truth.phi[places, k]) > 0.8]  # fmt: skip
        if near:
            best = min(near, key=lambda m: abs(m["frequency_hz"] - f))
            left.remove(best)
            found.append((k, best))
    return found, left


def _shape(mode: dict[str, Any]) -> Complex:
    return np.array(mode["shape_re"]) + 1j * np.array(mode["shape_im"])


if __name__ == "__main__":
    target, truth = Path(sys.argv[1]), {}
    for one_seed in [int(x) for x in sys.argv[2:]] or [1, 2]:
        for one_kind in KINDS:
            for one_name in STRUCTURES:
                made = make(one_kind, one_name, one_seed)
                truth[write(made, target).name] = [[made.truth.f[k], made.truth.zeta[k]] for k in made.seen]
    (target / "truth.json").write_text(json.dumps(truth, indent=1) + "\n", encoding="ascii")
