# SPDX-License-Identifier: MIT
"""okid-report: one self-contained HTML page from an okid.result/1 file, with more pictures when the record is given."""

from __future__ import annotations

import argparse
import contextlib
import json
import os
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from html import escape
from pathlib import Path
from typing import Any, cast

import matplotlib
import numpy as np
from numpy.typing import NDArray

from okid import _page, figures
from okid._errors import Error, InputError
from okid._mass_page import mass_section
from okid.frf import Frf, cmif, h1, synthesise
from okid.identify import identify
from okid.model import Model
from okid.record_fit import detrended, fit_records
from okid.records import read_csv
from okid.result import Fit
from okid.stabilization import Stabilization

Real = NDArray[np.float64]
Complex = NDArray[np.complex128]
NEEDED = (
    "fs_hz", "samples", "inputs", "outputs", "p", "rows", "order", "singular_values", "model", "modes", "warnings",
)  # fmt: skip
MOST_SHAPES, MOST_PAIRS = 16, 4


@dataclass
class Loaded:
    """The parts of a result file as arrays: shapes (modes, n_y), singular_values (s,), markov (count, n_y, n_u)."""

    raw: dict[str, Any]
    matrices: dict[str, Real]
    shapes: Complex
    frequency_hz: Real
    singular_values: Real
    markov: Real

    @property
    def fs(self) -> float:
        """Sample rate, Hz."""
        return float(self.raw["fs_hz"])

    @property
    def shown_hz(self) -> float:
        """Upper end of the frequency axes: Nyquist, or well above the highest mode when the modes are all low."""
        highest = 2.0 * float(np.max(self.frequency_hz, initial=0.0))
        return min(self.fs / 2.0, highest) if highest > 0.0 else self.fs / 2.0


def load_result(path: str | Path) -> Loaded:
    """Read and check an okid.result/1 file. InputError names file and key."""
    source = str(path)
    try:
        raw = json.loads(Path(path).read_text(encoding="utf-8"))
    except OSError as fault:
        raise InputError(f"{source}: {fault.strerror or fault}") from None
    except UnicodeDecodeError:
        raise InputError(f"{source}: not UTF-8 text, expected an okid.result/1 JSON file") from None
    except json.JSONDecodeError as fault:
        raise InputError(f"{source}:{fault.lineno}:{fault.colno}: not JSON: {fault.msg}") from None
    schema = raw.get("schema") if isinstance(raw, dict) else None
    if schema != "okid.result/1":
        raise InputError(f"{source}: schema is {schema!r}, expected 'okid.result/1'")
    missing = [key for key in NEEDED if key not in raw]
    if missing:
        raise InputError(f"{source}: key {missing[0]!r} is missing")
    n_y = len(raw["outputs"])
    try:
        model = {name: np.array(raw["model"][name], dtype=np.float64) for name in "ABCD"}
        n_z, n_u = len(model["A"]), len(raw["inputs"])
        for name, shape in (("A", (n_z, n_z)), ("B", (n_z, n_u)), ("C", (n_y, n_z)), ("D", (n_y, n_u))):
            if model[name].shape != shape:
                raise InputError(f"{source}: model.{name} has shape {model[name].shape}, expected {shape}")
        shapes = np.array(
            [np.array(m["shape_re"], float) + 1j * np.array(m["shape_im"], float) for m in raw["modes"]], np.complex128
        ).reshape(-1, n_y)
        frequency = np.array([float(m["frequency_hz"]) for m in raw["modes"]])
        values = np.array(raw["singular_values"], dtype=np.float64)
        markov = np.array(raw.get("markov", {}).get("Y", []), dtype=np.float64).reshape(-1, n_y, n_u)
        if not (float(raw["fs_hz"]) > 0.0 and len(values) and n_y and n_u):
            raise InputError(f"{source}: fs_hz, singular_values, inputs and outputs must not be empty")
    except (KeyError, TypeError, ValueError) as fault:
        if isinstance(fault, InputError):
            raise
        raise InputError(f"{source}: not a complete okid.result/1: {type(fault).__name__}: {fault}") from None
    return Loaded(raw, model, shapes, frequency, values, markov)


@dataclass
class Measured:
    """What the record adds. frf None: `no_frf` says why; fit None: the result has its own."""

    frf: Frf | None
    no_frf: str
    rows: Stabilization
    fit: Fit | None
    source: str


def _known_fit(raw: dict[str, Any], key: str) -> list[float | None]:
    """The fits of the result in the order of its outputs."""
    values = (raw.get("fit") or {}).get(key) or {}
    return [values.get(name) for name in raw["outputs"]]


def _own_fit(result: Loaded, u: Real, y: Real) -> Fit:
    """Both fits of the model of the result over a record it does not know."""
    m, raw = result.matrices, result.raw
    n_z, n_y = len(m["A"]), len(m["C"])
    gain = np.array(raw["model"].get("K") or [], dtype=np.float64)
    predict = gain.shape == (n_z, n_y) and float(np.max(np.abs(np.linalg.eigvals(m["A"] - gain @ m["C"])))) < 1.0
    model = Model(m["A"], m["B"], m["C"], m["D"], gain if predict else np.zeros((n_z, n_y)), 1.0 / result.fs)
    record = detrended(np.hstack([u, y]), str(raw.get("detrend", "mean")))
    return fit_records(model, [record], raw["outputs"], predict)[0]


def measure(result: Loaded, path: str | Path) -> Measured:
    """Responses of the record, and the poles over all orders identified anew with the settings of the result."""
    raw = result.raw
    record = read_csv(path)
    u, y = record.columns(raw["inputs"], str(path)), record.columns(raw["outputs"], str(path))
    if record.fs_hz is not None and abs(record.fs_hz - result.fs) > 1e-3 * result.fs:
        raise InputError(
            f"{path}: sampled at {record.fs_hz:g} Hz, but the result is of {result.fs:g} Hz: not the record it is from"
        )
    method = str(raw.get("method", "okid-era"))
    reach: dict[str, Any] = {} if method.startswith("n4sid") or not raw["inputs"] else {"p": int(raw["p"])}
    again = identify(
        u if raw["inputs"] else None, y, fs=result.fs, method=method, **reach, rows=int(raw["rows"]),
        detrend=str(raw.get("detrend", "mean")), start=str(raw.get("start", "moving")), order=int(raw["order"]),
        max_order=max(int(raw["order"]) + 20, min(80, 3 * int(raw["order"]))), sigma_blocks=0,
    )  # fmt: skip
    responses, reason = None, ""
    try:
        responses = h1(u, y, result.fs)
    except InputError as fault:
        reason = str(fault)
    unknown = all(value is None for value in _known_fit(raw, "simulation_percent"))
    return Measured(responses, reason, again.stabilization(), _own_fit(result, u, y) if unknown else None, str(path))


def _plain(value: float | None, digits: str, factor: float = 1.0) -> str:
    return "–" if value is None else format(value * factor, digits)


def _summary(result: Loaded, measured: Measured | None) -> str:
    r = result.raw
    seconds = int(r["samples"]) / result.fs
    rows = [
        ("Samples", f"{r['samples']} at {result.fs:g} Hz ({seconds:.2f} s) in {r.get('records', 1)} record(s)"),
        ("Gaps", f"{r.get('gaps', 0)}"),
        ("Inputs", ", ".join(r["inputs"])),
        ("Outputs", ", ".join(r["outputs"])),
        ("Method", f"{r.get('method', '–')}, p = {r['p']}, {r['rows']} block rows, order {r['order']}"),
        ("Treatment", f"hold {r.get('hold', '–')}, detrend {r.get('detrend', '–')}, start {r.get('start', 'moving')}"),
    ]
    if measured is not None:
        rows.append(("Record", measured.source))
    items = "".join(
        f"<li><code>{escape(str(w.get('code')))}</code> {escape(str(w.get('text')))}</li>" for w in r["warnings"]
    )
    remarks = f'<ul class="warnings">{items}</ul>' if items else _page.note("No warnings.")
    return _page.section("Data and settings", _page.facts(rows), remarks)


def _modes(result: Loaded) -> str:
    modes = result.raw["modes"]
    if not modes:
        return _page.section("Modes", _page.absent("The result holds no underdamped mode."))
    f_std = any(m.get("frequency_std_hz") is not None for m in modes)
    z_std = any(m.get("damping_ratio_std") is not None for m in modes)
    head = ["mode", "f [Hz]", *(["± σ [Hz]"] if f_std else []), "ζ [%]", *(["± σ [%]"] if z_std else []), "MPC", "EMAC"]
    rows = []
    for k, m in enumerate(modes, 1):
        row = [str(k), _plain(m["frequency_hz"], ".4f")]
        row += [_plain(m.get("frequency_std_hz"), ".2g")] if f_std else []
        row.append(_plain(m["damping_ratio"], ".4f", 100.0))
        row += [_plain(m.get("damping_ratio_std"), ".2g", 100.0)] if z_std else []
        rows.append([*row, _plain(m.get("mpc"), ".4f"), _plain(m.get("emac"), ".4f")])
    return _page.section("Modes", _page.table(head, rows), _page.note("MPC: phase collinearity of the shape; EMAC: "
                         "consistency of the mode over the Hankel matrix; 1 is best for both."))  # fmt: skip


def _singular_values(result: Loaded) -> str:
    drawing = figures.figure(9.6, 3.2)
    figures.draw_singular_values(drawing.add_subplot(), result.singular_values, int(result.raw["order"]))
    return _page.section("Singular values", _page.picture(drawing, "singular values of the Hankel matrix"))


def _stabilization(result: Loaded, measured: Measured | None) -> str:
    title = "Stabilization diagram"
    if measured is None:
        return _page.section(title, _page.absent("Needs the record: run okid-report again with --record FILE.csv."))
    drawing = figures.figure(9.6, 4.8)
    data = measured.frf
    behind = None if data is None else (data.frequency_hz[1:], cmif(data.response[1:]))
    figures.draw_stabilization(
        drawing.add_subplot(),
        measured.rows,
        result.shown_hz,
        result.frequency_hz.tolist(),
        behind,
        int(result.raw["order"]),
    )
    return _page.section(title, _page.picture(drawing, "poles over frequency and model order"), _page.note(
        "A pole holds when the next lower order has one within 1 % in frequency, 5 % in damping and MAC ≥ 0.98. Green "
        f"lines: modes of this result. Blue bands: {len(measured.rows.modes)} modes found by themselves, from poles "
        "that come back in at least half of the orders; ring: the pole nearest their medians." + (
            "" if behind is None
            else " Behind: largest singular value of the measured responses (CMIF), dB, no scale."
        )
    ))  # fmt: skip


def choose_pairs(response: Complex, coherence: Real | None) -> list[tuple[int, int]]:
    """Up to four (output, input): the strongest response weighted by coherence, every input once before any twice."""
    power = np.sqrt(np.mean(np.abs(response) ** 2, axis=0))
    scale = np.max(power, axis=1, keepdims=True)
    score = np.divide(power, scale, out=np.zeros_like(power), where=scale > 0.0)
    if coherence is not None and np.any(np.isfinite(coherence)):
        score = score * np.nanmean(coherence, axis=0)[:, None]
    n_y, n_u = score.shape
    order = [divmod(int(k), n_u) for k in np.argsort(-score, axis=None, kind="stable")]
    chosen: list[tuple[int, int]] = []
    for most in range(1, n_y + 1):  # how often an input may appear
        for pair in order:
            fresh = pair not in chosen and all(pair[0] != o for o, _ in chosen)
            if len(chosen) < MOST_PAIRS and fresh and sum(pair[1] == i for _, i in chosen) < most:
                chosen.append(pair)
    for pair in order:
        if len(chosen) < min(MOST_PAIRS, n_y * n_u) and pair not in chosen:
            chosen.append(pair)
    return sorted(chosen)


def _frf(result: Loaded, measured: Measured | None) -> tuple[str, list[tuple[int, int]]]:
    m, raw = result.matrices, result.raw
    line = np.linspace(result.shown_hz / 2000.0, result.shown_hz, 1600)
    model = synthesise(m["A"], m["B"], m["C"], m["D"], float(raw["model"]["dt"]), line)
    data = None if measured is None else measured.frf
    pairs = choose_pairs(model if data is None else data.response[1:], None if data is None else data.coherence[1:])
    with_coherence = data is not None and bool(np.any(np.isfinite(data.coherence)))
    heights = [3.0, 1.3, 0.9][: 3 if with_coherence else 2]
    columns = len(pairs) if len(pairs) <= 3 else 2
    bands = -(-len(pairs) // columns)
    drawing = figures.figure(9.6, 3.7 * bands)
    grid = drawing.add_gridspec(bands, columns)
    for place, (out, into) in enumerate(pairs):
        cells = grid[divmod(place, columns)].subgridspec(len(heights), 1, height_ratios=heights)
        axes: list[Any] = list(np.asarray(cells.subplots(sharex=True), dtype=object))
        figures.draw_frf(axes, data, line, model, (out, into))
        axes[0].set_title(f"{raw['outputs'][out]} / {raw['inputs'][into]}")
        axes[0].set_ylabel("magnitude")
        axes[0].legend(loc="best")
        axes[1].set_ylabel("phase [°]")
        if with_coherence:
            axes[2].set_ylabel("coher.")
        axes[-1].set_xlabel("frequency [Hz]")
    total = len(raw["outputs"]) * len(raw["inputs"])
    words = f"Magnitude: output unit over input unit. Shown: {len(pairs)} of {total} pairs"
    words += ", the strongest with the best coherence and every input." if len(pairs) < total else "."
    if measured is not None and data is None:
        more = f"Model only, the measured responses are left out: {measured.no_frf}."
    elif data is None:
        more = "Model only: the measured response and the coherence need --record FILE.csv."
    else:
        more = f"Measured: H1, {data.averages} average(s), {data.resolution_hz:.3g} Hz lines; multiple coherence."
        more += "" if with_coherence else " Too few averages for a coherence."
    title = "Frequency responses" if data is None else "Frequency responses, measured and synthesised"
    text = "frequency responses of the model" + ("" if data is None else " and of the record")
    return _page.section(title, _page.picture(drawing, text), _page.note(f"{words} {more}")), pairs


def _shown_modes(result: Loaded) -> list[int]:
    quality = [float(m.get("emac") or 0.0) for m in result.raw["modes"]]
    best = sorted(range(len(quality)), key=lambda k: -quality[k])[:MOST_SHAPES]
    return sorted(best)


def _shapes(result: Loaded) -> list[str]:
    shown = _shown_modes(result)
    if not shown:
        return []
    columns = min(4, len(shown)) if len(result.raw["outputs"]) <= 12 else min(2, len(shown))
    bands = -(-len(shown) // columns)
    sticks = figures.figure(9.6, 1.75 * bands)
    for place, k in enumerate(shown, 1):
        ax = sticks.add_subplot(bands, columns, place)
        damping = 100.0 * float(result.raw["modes"][k]["damping_ratio"])
        title = f"{result.frequency_hz[k]:.2f} Hz, {damping:.2f} %"
        figures.draw_shape(ax, result.shapes[k], result.raw["outputs"], title)
    columns = min(8, len(shown))
    bands = -(-len(shown) // columns)
    polar = figures.figure(9.6 * columns / 8.0 + 0.3, 1.6 * bands)
    for place, k in enumerate(shown, 1):
        axes = polar.add_subplot(bands, columns, place, projection="polar")
        figures.draw_compass(axes, result.shapes[k], f"{result.frequency_hz[k]:.2f} Hz")
    square = figures.figure(min(7.4, 2.6 + 0.42 * len(shown)), min(6.4, 1.9 + 0.42 * len(shown)))
    ax = square.add_subplot()
    image = figures.draw_mac(ax, result.shapes[shown], result.frequency_hz[shown].tolist())
    square.colorbar(image, ax=ax, shrink=0.8, label="MAC")
    count = len(result.raw["modes"])
    words = "Sign from the real part, largest entry 1, outputs in their order."
    if count > len(shown):
        words += f" The {len(shown)} of {count} modes with the highest EMAC are shown."
    return [
        _page.section("Mode shapes", _page.picture(sticks, "mode shapes against the outputs"), _page.note(words)),
        _page.section("Complexity", _page.picture(polar, "entries of the shapes in the complex plane"), _page.note(
            "Every entry of a shape in the complex plane: proportionally damped structures lie on one line.")),
        _page.section("AutoMAC", _page.picture(square, "modal assurance criterion of every pair of modes")),
    ]  # fmt: skip


def _fit(result: Loaded, measured: Measured | None) -> str:
    names = result.raw["outputs"]
    parts = [_known_fit(result.raw, key) for key in ("simulation_percent", "prediction_percent")]
    origin = ""
    if measured is not None and measured.fit is not None:
        made = measured.fit
        parts = [[part[name] for name in names] for part in (made.simulation_percent, made.prediction_percent)]
        origin = f" Computed by this report from {measured.source}: the result itself holds no simulation fit."
    if all(value is None for part in parts for value in part):
        words = "The result holds no fit (a live result keeps no record)"
        more = (
            ": run okid-report again with --record FILE.csv." if measured is None else ", nor does the record give one."
        )
        return _page.section("Fit", _page.absent(words + more))
    drawing = figures.figure(max(4.0, min(9.6, 2.0 + 0.6 * len(names))), 3.0)
    figures.draw_fit(drawing.add_subplot(), names, parts[0], parts[1])
    words = "100 (1 − ‖y − ŷ‖ / ‖y − mean‖). Simulation: from input and initial state; prediction: one step ahead."
    title = "Fit, computed by this report" if origin else "Fit"
    return _page.section(title, _page.picture(drawing, "fit percentage of each output"), _page.note(words + origin))


def _markov(result: Loaded, pairs: Sequence[tuple[int, int]]) -> str:
    if len(result.markov) < 2:
        return ""
    columns = len(pairs) if len(pairs) <= 3 else 2
    bands = -(-len(pairs) // columns)
    drawing = figures.figure(9.6, 2.1 * bands)
    for place, (out, into) in enumerate(pairs, 1):
        ax = drawing.add_subplot(bands, columns, place)
        title = f"{result.raw['outputs'][out]} / {result.raw['inputs'][into]}"
        figures.draw_markov(ax, result.markov, 1.0 / result.fs, (out, into), title)
        ax.set_xlabel("time [s]")
        ax.set_ylabel("Y")
    words = "Markov parameters over time; the dot is Y₀ = D, the direct feed-through."
    return _page.section("Impulse response", _page.picture(drawing, "Markov parameters"), _page.note(words))


def build(result: Loaded, record: str | Path | None = None, title: str | None = None) -> str:
    """The report as one HTML string. Raises InputError or IdentificationError when the record does not fit."""
    measured = None if record is None else measure(result, record)
    with matplotlib.rc_context(cast(Any, figures.STYLE)):
        responses, pairs = _frf(result, measured)
        sections = [
            _summary(result, measured), _modes(result), *mass_section(result.raw), _singular_values(result),
            _stabilization(result, measured), responses, *_shapes(result), _fit(result, measured),
            _markov(result, pairs),
        ]  # fmt: skip
    raw = result.raw
    count = len(raw["modes"])
    subtitle = f"{count} mode{'' if count == 1 else 's'}, {len(raw['inputs'])} inputs, {len(raw['outputs'])} outputs"
    foot = f"okid {raw.get('version', '')}, schema {raw['schema']}. SI units unless the channel names say otherwise."
    return _page.page(title or str(raw.get("title") or "Modal identification"), subtitle, sections, foot)


def main(arguments: Sequence[str] | None = None) -> int:
    """Entry point of okid-report; returns the exit code 0 or 2."""
    parser = argparse.ArgumentParser(
        prog="okid-report",
        description="Write one self-contained HTML report of an identified model.",
        epilog="example: okid identify run.csv --inputs force --outputs a1,a2,a3 --json r.json && "
        "okid-report r.json --record run.csv --out report.html",
    )
    parser.add_argument("result", metavar="RESULT.json", help="okid.result/1, as `okid identify --json` writes it")
    parser.add_argument("--record", metavar="FILE.csv", help="the record: adds measured responses and stabilization")
    parser.add_argument("--out", metavar="FILE.html", help="default: the result's name with .html")
    parser.add_argument("--title", metavar="TEXT", help="heading of the report")
    args = parser.parse_args(arguments)
    target = Path(args.out) if args.out else Path(args.result).with_suffix(".html")
    part = target.with_name(f".{target.name}.{os.getpid()}.part")
    try:
        text = build(load_result(args.result), args.record, args.title)
        part.write_text(text, encoding="utf-8")
        part.replace(target)
    except Error as fault:
        print(f"okid-report: {fault}", file=sys.stderr)
        return 2
    except OSError as fault:
        with contextlib.suppress(OSError):
            part.unlink(missing_ok=True)
        print(f"okid-report: {target}: {fault.strerror or fault}", file=sys.stderr)
        return 2
    print(f"{target}: {len(text) // 1024} KiB")
    return 0


if __name__ == "__main__":
    sys.exit(main())
