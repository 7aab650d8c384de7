# SPDX-License-Identifier: MIT
"""What the record adds to a result: responses, poles over all orders, fit, time histories, residuals."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from okid._errors import Error, InputError
from okid.data.records import Record, read_csv
from okid.frf import Frf, Spectra, h1, is_hit, spectra
from okid.record.identify import identify
from okid.report.answers import Answer, answers, detrended, fit_of
from okid.report.loaded import Loaded, known_fit
from okid.report.residual import Whiteness, whiteness
from okid.report.scale import Agreement, agreement
from okid.result.parts import Fit, Mode
from okid.result.stabilization import Stabilization

Real = NDArray[np.float64]
SHORTEST_LAGS, LONGEST_LAGS = 25, 60


class Excerpt(NamedTuple):
    """A stretch of the record and the model's answer to it: time_s (n,), measured and modelled (n, n_y).

    `simulated`: from the inputs alone; else predicted one step ahead. `hit`: it begins before the hardest hit.
    """

    time_s: Real
    measured: Real
    modelled: Real
    simulated: bool
    hit: bool
    file: str = ""  # of several records


class Struck(NamedTuple):
    """Of a hammer test in files: `averages` of each place (input) and the coherence (F, n_y, places) of its hits."""

    averages: list[int]
    coherence: Real


@dataclass
class Measured:
    """frf None: `no_frf` says why; fit: of the model to this record; spectra: of an ambient record only.

    missing (channels,): samples of the record that are missing, inputs first; samples: rows of the record; part: which
    of them everything else is made of, "" = all; record: the whole record, its channels as the model has them;
    factor (n_y,): simulation over record, NaN = not comparable; converted: what was said of units that were made SI;
    simulated: the responses of the simulated outputs, estimated as frf is (of measured responses: synthesised); rows:
    None = no diagram; fit: None = that of the result stands; struck: of a hammer test in files; own_modes: what the
    responses give by themselves, None = not computed.
    """

    frf: Frf | None
    no_frf: str
    rows: Stabilization | None
    fit: Fit | None
    source: str
    spectra: Spectra | None = None
    innovation: Real | None = None
    excerpt: Excerpt | None = None
    whiteness: Whiteness | None = None
    missing: NDArray[np.int64] | None = None
    samples: int = 0
    part: str = ""
    record: Record | None = None
    factor: Real | None = None
    converted: list[str] = field(default_factory=list)
    simulated: Frf | None = None
    struck: Struck | None = None
    own_modes: list[Mode] | None = None


def open_record(path: str | Path) -> Record:
    """A record of any format the package reads, by the extension of its name."""
    if Path(path).suffix.lower() in (".csv", ".npy"):
        return read_csv(path)
    from okid.formats import read_record  # brings the libraries of the formats with it

    return read_record(path)


def channels_of(result: Loaded, record: Record, source: str, names: list[str] | None = None) -> Record:
    """The channels of the result in its order, inputs first. InputError when a name is missing or the rate another."""
    own = record.select(names or result.inputs + result.outputs, source)
    if record.fs_hz is not None and abs(record.fs_hz - result.fs) > 1e-3 * result.fs:
        raise InputError(
            f"{source}: sampled at {record.fs_hz:g} Hz, but the result is of {result.fs:g} Hz: "
            "not the record it is from"
        )
    return own


def _poles(result: Loaded, u: Real, y: Real, source: str) -> Stabilization:
    """The poles over all orders, identified again with the settings of the result, of "auto" by okid-era. Errors name
    `source` and channel."""
    raw = result.raw
    method = str(raw.get("method", "okid-era"))
    method = "okid-era" if method in ("auto", "plscf", "poser") else method
    keys = ("rows",) if method.startswith("n4sid") or not result.inputs else ("rows", "p")
    reach: dict[str, Any] = {key: int(raw[key]) for key in keys if raw[key] is not None}
    reach.update({"input_names": result.inputs} if result.inputs else {})
    try:
        return identify(
            u if result.inputs else None, y, fs=result.fs, method=method, **reach, output_names=result.outputs,
            detrend=str(raw.get("detrend", "mean")), start=str(raw.get("start", "moving")), order=int(raw["order"]),
            max_order=max(int(raw["order"]) + 20, min(80, 3 * int(raw["order"]))), sigma_blocks=0,
        ).stabilization()  # fmt: skip
    except Error as fault:
        raise type(fault)(f"{source}: {fault}", fault.status) from None


def excerpt_of(result: Loaded, answered: Sequence[Answer], files: Sequence[str] = ()) -> Excerpt | None:
    """About twelve periods of the lowest mode, 120 to 600 samples, where the responses are largest. `files`: names."""
    names = files or [""] * len(answered)
    usable = [one for one in answered if one.simulated is not None or one.predicted is not None]
    if not usable:
        return None
    lowest = float(np.min(result.frequency_hz, initial=result.fs / 20.0))
    wanted = int(np.clip(12.0 * result.fs / lowest, 120, 600))
    best, place, most = usable[0], 0, -1.0
    scale = np.sqrt(np.nanmean(np.vstack([one.y for one in usable]) ** 2, axis=0))
    for one in usable:
        power = np.sum(np.nan_to_num(one.y / np.where(scale > 0.0, scale, 1.0)) ** 2, axis=1)
        summed = np.convolve(power, np.ones(min(wanted, len(power))), mode="valid")
        if float(np.max(summed)) > most:
            best, place, most = one, int(np.argmax(summed)), float(np.max(summed))
    hit = bool(result.inputs) and is_hit(best.u)
    if hit:
        place = max(0, int(np.argmax(np.sum((best.u - np.median(best.u, axis=0)) ** 2, axis=1))) - wanted // 20)
    part = slice(place, min(place + wanted, len(best.y)))
    modelled = best.simulated if best.simulated is not None else best.predicted
    assert modelled is not None
    if not np.all(np.isfinite(modelled[part])):
        return None  # an unstable model runs away
    time = (best.first + np.arange(part.start, part.stop)) / result.fs
    file = next(name for name, one in zip(names, answered, strict=True) if one is best)
    return Excerpt(time, best.y[part], modelled[part], best.simulated is not None, hit, file)


def residual_of(result: Loaded, answered: Sequence[Answer]) -> tuple[Whiteness | None, Real | None]:
    """Correlations of the innovation, and its covariance (n_y, n_y); the predictor settles first."""
    settle = 5 * len(result.matrices["A"])
    pieces = []
    for one in answered:
        skip = min(settle, len(one.y) // 4)
        if one.predicted is not None:
            pieces.append((one.y[skip:] - one.predicted[skip:], one.u[skip:]))
    if not pieces:
        return None, None
    e = np.vstack([error for error, _ in pieces])
    whole = e[np.all(np.isfinite(e), axis=1)]
    covariance = np.atleast_2d(np.cov(whole, rowvar=False)) if len(whole) > e.shape[1] + 1 else None
    lags = int(min(max(SHORTEST_LAGS, int(result.raw["p"] or 0)), LONGEST_LAGS, len(e) // 10))
    return whiteness(pieces, lags), covariance


def measure(result: Loaded, path: str | Path) -> Measured:
    """Everything above from the record at `path`. InputError or IdentificationError when it does not fit."""
    return measured_from(result, open_record(path), str(path))


def _used_rows(result: Loaded, rows: int) -> tuple[slice, str]:
    """The rows that the result rests on, and that in words, "" = all: the end of the run for a live one's window."""
    unknown = all(value is None for key in ("simulation_percent", "prediction_percent")
                  for value in known_fit(result.raw, key))  # fmt: skip
    used = int(result.raw["samples"])
    if unknown and 0 < used < rows:
        return slice(rows - used, rows), f"the last {used} of {rows} samples, which the result rests on"
    return slice(0, rows), ""


def _answering(result: Loaded, u: Real, y: Real) -> tuple[Frf | None, Spectra | None, str]:
    """Responses, or spectra of an ambient record, or why there are none."""
    try:
        return (h1(u, y, result.fs), None, "") if result.inputs else (None, spectra(y, result.fs), "")
    except InputError as fault:
        return None, None, str(fault)


def _simulated_frf(result: Loaded, data: Real, answered: list[Answer], frf: Frf | None) -> Frf | None:
    """H1 of the model's simulation, with the segments and the window of the record's: leakage is then in both."""
    if frf is None or any(one.simulated is None for one in answered):
        return None
    n_u = len(result.inputs)
    made = np.full(data[:, n_u:].shape, np.nan)
    for one in answered:
        made[one.first : one.first + len(one.y)] = one.simulated
    made[~np.isfinite(data[:, n_u:])] = np.nan
    try:
        own = h1(data[:, :n_u], made, result.fs)
    except InputError:
        return None
    return own if own.response.shape == frf.response.shape and np.all(np.isfinite(own.response)) else None


def measured_from(result: Loaded, record: Record, source: str) -> Measured:
    """The same from a record that is already read."""
    own = channels_of(result, record, source)
    missing, rows = np.sum(~np.isfinite(own.samples), axis=0), len(own.samples)
    used, part = _used_rows(result, rows)
    n_u, detrend = len(result.inputs), str(result.raw.get("detrend", "mean"))
    model, predict = result.model()
    poles = _poles(result, own.samples[used, :n_u], own.samples[used, n_u:], source)
    agreed: Agreement = agreement(model, own, n_u, detrend, used)
    own = agreed.record
    u, y = own.samples[used, :n_u], own.samples[used, n_u:]
    responses, own_spectra, reason = _answering(result, u, y)
    data = detrended(np.hstack([u, y]), detrend)
    answered = answers(model, predict, data, n_u)
    white, covariance = residual_of(result, answered)
    excerpt = excerpt_of(result, answered)
    if excerpt is not None:
        excerpt = excerpt._replace(time_s=excerpt.time_s + used.start / result.fs)
    return Measured(
        responses, reason, poles, fit_of(answered, result.outputs), source, own_spectra, covariance, excerpt, white,
        missing, rows, part, own, agreed.factor, agreed.said, _simulated_frf(result, data, answered, responses),
    )  # fmt: skip
