# SPDX-License-Identifier: MIT
"""Frequency responses: H1, H2 and Hv with multiple coherence, output spectra of ambient records, and of a model."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from okid._errors import InputError
from okid.abi.arguments import positive
from okid.shown.notebook_html import own_fields

Real = NDArray[np.float64]
Complex = NDArray[np.complex128]
SHORTEST = 64  # samples in a segment that is chosen here


class Frf(NamedTuple):
    """Measured response functions.

    frequency_hz (F,), response (F, n_y, n_u), coherence (F, n_y): multiple coherence of each output with all inputs,
    NaN where there are not more averages than inputs. averages: segments used, 0 = not known. resolution_hz: line
    spacing. inputs, outputs: names, () = u1 .., y1 ..; set_ups: measurements of one structure that it is joined from.
    quantity: what a file says the outputs are; other_units: that its numbers came in, they are in SI units here.
    """

    frequency_hz: Real
    response: Complex
    coherence: Real
    averages: int
    resolution_hz: float
    inputs: tuple[str, ...] = ()
    outputs: tuple[str, ...] = ()
    set_ups: int = 1
    quantity: str = ""
    other_units: tuple[str, ...] = ()

    @classmethod
    def of(
        cls,
        frequency_hz: ArrayLike,
        response: ArrayLike,
        inputs: Sequence[str] = (),
        outputs: Sequence[str] = (),
        set_ups: int = 1,
    ) -> Frf:
        """Of frequencies (F,) and responses (F, n_y, n_u), (F, n_y) or (F,). InputError when they do not fit."""
        f, h = np.asarray(frequency_hz, dtype=np.float64), np.asarray(response, dtype=np.complex128)
        h = h.reshape(*h.shape, *(1,) * (3 - h.ndim)) if h.ndim < 3 else h
        if f.ndim != 1 or h.ndim != 3 or len(f) != len(h) or len(f) < 2:
            raise InputError(
                f"frequency_hz has shape {f.shape} and response {h.shape}, expected (lines,) and "
                "(lines, outputs, inputs), at least two lines"
            )
        for names, count, what in ((inputs, h.shape[2], "inputs"), (outputs, h.shape[1], "outputs")):
            if len(names) not in (0, count):
                raise InputError(f"{len(names)} names for {count} {what}, expected one for each")
        nothing = np.full(h.shape[:2], np.nan)
        return cls(f, h, nothing, 0, float(f[1] - f[0]), tuple(inputs), tuple(outputs), set_ups)

    def names(self) -> tuple[list[str], list[str]]:
        """Of the inputs and of the outputs."""
        n_y, n_u = self.response.shape[1:]
        return (list(self.inputs) or [f"u{k + 1}" for k in range(n_u)],
                list(self.outputs) or [f"y{k + 1}" for k in range(n_y)])  # fmt: skip

    def _repr_html_(self) -> str:
        return own_fields(self)


class Spectra(NamedTuple):
    """Measured spectra of outputs: frequency_hz (F,), power (F, n_y, n_y) one-sided, unit^2/Hz, averages used."""

    frequency_hz: Real
    power: Complex
    averages: int

    def _repr_html_(self) -> str:
        return own_fields(self)


def is_hit(u: ArrayLike, fraction: float = 0.05) -> bool:
    """True when 99 % of the energy of the inputs u (N, n_u) lies within `fraction` of the record: a hammer hit."""
    drive = np.nan_to_num(np.asarray(u, dtype=np.float64).reshape(len(np.asarray(u)), -1))
    power = np.sum((drive - np.median(drive, axis=0)) ** 2, axis=1)
    total = float(np.sum(power))
    if total == 0.0:
        return False
    width = max(1, int(fraction * len(power)))
    run = np.convolve(power, np.ones(width), mode="valid")
    return bool(np.max(run) > 0.99 * total)


def _window(name: str, length: int) -> Real:
    """A window of scipy.signal, which takes a second to load: only where another one than these two is wanted."""
    if name == "boxcar":
        return np.ones(length)
    if name == "hann":
        return 0.5 - 0.5 * np.cos(2.0 * np.pi * np.arange(length) / length)
    from scipy.signal import get_window

    try:
        return np.asarray(get_window(name, length), dtype=np.float64)
    except (TypeError, ValueError) as fault:
        raise InputError(f"window is {name!r}, expected one of scipy.signal.get_window: {fault}") from None


def _runs(data: Real) -> list[tuple[int, int]]:
    """First and end of every run of complete samples."""
    broken = np.flatnonzero(~np.all(np.isfinite(data), axis=1))
    edges = np.concatenate(([-1], broken, [len(data)])).tolist()
    return [(a + 1, b) for a, b in zip(edges[:-1], edges[1:], strict=True) if b > a + 1]


def _segments(data: Real, length: int, step: int) -> list[Real]:
    """Pieces of `length` complete samples; a missing sample starts the search again behind it."""
    return [data[k : k + length] for first, end in _runs(data) for k in range(first, end - length + 1, step)]


def struck_part(data: Real, n_u: int) -> Real:
    """The run of complete samples with the hardest hit: what a record of a hammer test with gaps is good for."""
    drive = data[:, :n_u] - np.nanmedian(data[:, :n_u], axis=0)
    force = np.nan_to_num(np.sum(drive**2, axis=1))
    first, end = max(_runs(data), key=lambda run: float(np.max(force[run[0] : run[1]])), default=(0, 0))
    return data[first:end]


def _segment_length(records: Sequence[Real]) -> int:
    """About ten averages with half overlap; a power of two >= 64 with at least eight where samples are missing."""
    runs = [end - first for data in records for first, end in _runs(data)]
    longest = max(runs, default=0)
    if longest < SHORTEST:
        raise InputError(
            f"the longest stretch without a missing sample has {longest} samples, a response function takes {SHORTEST}"
        )
    if len(runs) == len(records) and sum(runs) == sum(map(len, records)):
        length = min(min(runs), 2 * sum(runs) // (10 + len(runs)))
        return min(longest, max(SHORTEST, length - length % 2))
    length = 1 << (longest.bit_length() - 1)
    while length > SHORTEST and sum((n - length) // (length // 2) + 1 for n in runs if n >= length) < 8:
        length //= 2
    return length


def solve_h1(guu: Complex, gyu: Complex, gyy: Real, count: int) -> tuple[Complex, Real]:
    """H1 (F, n_y, n_u) and multiple coherence (F, n_y) of sums (or means) of `count` segments: guu (F, n_u, n_u), gyu
    (F, n_y, n_u), gyy (F, n_y). The coherence is NaN while there are not more segments than inputs."""
    response: Complex = np.matmul(gyu, np.linalg.pinv(guu, rcond=1e-10, hermitian=True), dtype=np.complex128)
    coherence = np.full(gyy.shape, np.nan)
    if count > guu.shape[-1]:
        explained = np.einsum("fij,fij->fi", response, gyu.conj()).real
        np.divide(explained, gyy, out=coherence, where=gyy > 0.0)
    return response, np.clip(coherence, 0.0, 1.0)


def _by_input(guu: Complex, gyu: Complex, gyy: Real) -> Complex:
    """H2 of one input: G_yy over G_uy, output by output."""
    if guu.shape[-1] != 1:
        raise InputError(f"estimator is 'h2' with {guu.shape[-1]} inputs, expected one: take h1 or hv")
    out = np.zeros(gyu.shape, np.complex128)
    np.divide(gyy[:, :, None], gyu.conj(), out=out, where=gyu != 0.0)
    return out


def _by_total_least_squares(guu: Complex, gyu: Complex, gyy: Real) -> Complex:
    """Hv: of [u; y_o], each at unit power, the direction of least power; of one input the mean of H1 and H2."""
    (lines, n_y), n_u = gyy.shape, guu.shape[-1]
    out = np.zeros(gyu.shape, np.complex128)
    power_u = np.einsum("fii->fi", guu).real
    for o in range(n_y):
        whole = np.zeros((lines, n_u + 1, n_u + 1), np.complex128)
        whole[:, :n_u, :n_u], whole[:, n_u, n_u] = guu, gyy[:, o]
        whole[:, n_u, :n_u], whole[:, :n_u, n_u] = gyu[:, o], gyu[:, o].conj()
        unit = np.sqrt(np.maximum(np.column_stack([power_u, gyy[:, o]]), 1e-300))
        v = np.linalg.eigh(whole / (unit[:, :, None] * unit[:, None, :]))[1][:, :, 0].conj() / unit
        np.divide(-v[:, :n_u], v[:, n_u:], out=out[:, o], where=v[:, n_u:] != 0.0)
    return out


def h1(
    u: ArrayLike | Sequence[ArrayLike],
    y: ArrayLike | Sequence[ArrayLike],
    fs: float,
    nperseg: int | None = None,
    window: str | None = None,
    estimator: str = "h1",
) -> Frf:
    """H1 estimate by Welch's method for all inputs together: G_yu G_uu^-1, averaged over segments and records.

    u (N, n_u) or 1-D, y (N, n_y) or 1-D, or lists of such arrays (several records); NaN = missing, segments avoid it.
    Default: Hann windows with half overlap, so long that about ten averages remain, shorter where gaps leave no longer
    stretch; the whole record (its unbroken part with the hit), no window, for hammer hits.
    estimator: "h1" errs low where the forces are noisy; "h2" (one input) errs high where the responses are; "hv" takes
    both for equally noisy (total least squares; of one input the geometric mean of H1 and H2).
    Raises InputError when no complete segment is left, or none of 64 samples by default.
    Source: Bendat and Piersol, multiple-input H1; Rocklin, Crowley, Vold (1985), Hv.
    """
    from okid.data.records import paired  # records imports nothing of this module

    if estimator not in ("h1", "h2", "hv"):
        raise InputError(f"estimator is {estimator!r}, expected h1, h2 or hv")
    fs = positive("fs", fs, "a sample rate in Hz")
    inputs, outputs = paired(u, y)
    n_u = inputs[0].shape[1]
    hit = all(is_hit(one) for one in inputs)
    records = [np.hstack(pair) for pair in zip(inputs, outputs, strict=True)]
    if nperseg is None and hit:
        records = [struck_part(data, n_u) for data in records]
        nperseg = min(len(data) for data in records)
        if nperseg < SHORTEST:
            raise InputError(f"only {nperseg} unbroken samples around a hit, a response function takes {SHORTEST}")
    elif nperseg is None:
        nperseg = _segment_length(records)
    shape = _window(window or ("boxcar" if hit else "hann"), nperseg)
    n_y, lines, count = outputs[0].shape[1], nperseg // 2 + 1, 0
    guu, gyu = np.zeros((lines, n_u, n_u), np.complex128), np.zeros((lines, n_y, n_u), np.complex128)
    gyy = np.zeros((lines, n_y))
    for data in records:
        for piece in _segments(data, nperseg, nperseg if hit else max(1, nperseg // 2)):
            spectrum = np.fft.rfft((piece - piece.mean(axis=0)) * shape[:, None], axis=0)
            fu, fy = spectrum[:, :n_u], spectrum[:, n_u:]
            guu += fu[:, :, None] * fu[:, None, :].conj()
            gyu += fy[:, :, None] * fu[:, None, :].conj()
            gyy += np.abs(fy) ** 2
            count += 1
    if count == 0:
        raise InputError(f"no {nperseg} consecutive complete samples for a response function: shorten nperseg")
    spacing = fs / nperseg
    response, coherence = solve_h1(guu, gyu, gyy, count)
    if estimator != "h1":
        response = (_by_input if estimator == "h2" else _by_total_least_squares)(guu, gyu, gyy)
    return Frf(np.arange(lines, dtype=np.float64) * spacing, response, coherence, count, spacing)


def synthesise(A: ArrayLike, B: ArrayLike, C: ArrayLike, D: ArrayLike, dt: float, frequency_hz: ArrayLike) -> Complex:
    """Response (F, n_y, n_u) of x+ = A x + B u, y = C x + D u: C (z I - A)^-1 B + D at z = exp(2 pi i f dt)."""
    a, b = np.asarray(A, dtype=np.float64), np.asarray(B, dtype=np.float64)
    c, d = np.asarray(C, dtype=np.float64), np.asarray(D, dtype=np.float64)
    z = np.exp(2j * np.pi * np.asarray(frequency_hz, dtype=np.float64) * dt)
    out = np.empty((len(z), len(c), b.shape[1]), dtype=np.complex128)
    eye = np.eye(len(a))
    for k, point in enumerate(z):
        out[k] = c @ np.linalg.solve(point * eye - a, b) + d
    return out


def cmif(response: Complex) -> Real:
    """Complex mode indicator: the largest singular value of the response matrix at each line, (F,)."""
    return np.asarray(np.linalg.svd(response, compute_uv=False)[:, 0], dtype=np.float64)


def spectra(y: ArrayLike | Sequence[ArrayLike], fs: float) -> Spectra:
    """One-sided cross spectra of the outputs y (N, n_y) by Welch's method: Hann windows, half overlap, ~ten averages.

    NaN = missing, segments avoid it. Raises InputError when no stretch of 64 samples is complete.
    Source: Bendat and Piersol, Random Data.
    """
    from okid.data.records import paired  # records imports nothing of this module

    _, outputs = paired(None, y)
    nperseg = _segment_length(outputs)
    window = _window("hann", nperseg)
    power = np.zeros((nperseg // 2 + 1, outputs[0].shape[1], outputs[0].shape[1]), np.complex128)
    count = 0
    for data in outputs:
        for piece in _segments(data, nperseg, max(1, nperseg // 2)):
            spectrum = np.fft.rfft((piece - piece.mean(axis=0)) * window[:, None], axis=0)
            power += spectrum[:, :, None] * spectrum[:, None, :].conj()
            count += 1
    if count == 0:
        raise InputError(f"no {nperseg} consecutive complete samples for a spectrum")
    power *= 2.0 / (fs * float(np.sum(window**2)) * count)
    return Spectra(np.arange(len(power), dtype=np.float64) * (fs / nperseg), power, count)


def transmissibility(y: ArrayLike, fs: float, reference: int = 0, nperseg: int | None = None) -> Frf:
    """Transmissibilities (F, n_y - 1, 1) of the other outputs over output `reference` (from 0), with coherence: H1 with
    that output in the place of the force. What excites the structure need not be known, but stay in one place.

    >>> from okid import demo_record, frf
    >>> _, y = demo_record()
    >>> frf.transmissibility(y, 1000.0).outputs
    ('y2', 'y3')
    """
    data = np.asarray(y, dtype=np.float64)
    if data.ndim != 2 or not 0 <= reference < data.shape[1] or data.shape[1] < 2:
        raise InputError(f"reference is {reference} of y with shape {data.shape}, expected an output of two or more")
    others = [k for k in range(data.shape[1]) if k != reference]
    out = h1(data[:, [reference]], data[:, others], fs, nperseg, "hann")
    return out._replace(inputs=(f"y{reference + 1}",), outputs=tuple(f"y{k + 1}" for k in others))


def deflection(measured: Spectra, frequency_hz: ArrayLike, reference: int | None = None) -> Complex:
    """Operating deflection shapes (k, n_y) at the lines nearest to `frequency_hz`: S_yr / sqrt(S_rr), in unit/sqrt(Hz),
    the phase that of each output over the output `reference` (default: at each line the strongest). Not mode shapes:
    what moves at that frequency, of all modes and forces together. Source: Schwarz, Richardson (1999).

    >>> from okid import demo_record, frf
    >>> seen = frf.deflection(frf.spectra(demo_record()[1], 1000.0), [10.96], reference=0)
    >>> seen.shape, bool(abs(seen[0, 0].imag) < 1e-12)
    ((1, 3), True)
    """
    out = []
    for f in np.atleast_1d(np.asarray(frequency_hz, dtype=np.float64)):
        power = measured.power[int(np.argmin(np.abs(measured.frequency_hz - f)))]
        r = int(np.argmax(power.diagonal().real)) if reference is None else reference
        out.append(power[:, r] / np.sqrt(max(float(power[r, r].real), 1e-300)))
    return np.array(out, dtype=np.complex128)


def synthesise_spectra(
    A: ArrayLike, K: ArrayLike, C: ArrayLike, covariance: ArrayLike, dt: float, frequency_hz: ArrayLike
) -> Complex:
    """One-sided output spectra (F, n_y, n_y) of the innovation model x+ = A x + K e, y = C x + e, E e e^T = covariance.

    2 dt H covariance H^H with H = C (z I - A)^-1 K + I at z = exp(2 pi i f dt).
    """
    noise = np.asarray(covariance, dtype=np.float64)
    h = synthesise(A, K, C, np.eye(len(noise)), dt, frequency_hz)
    return np.asarray(2.0 * dt * (h @ noise @ h.conj().transpose(0, 2, 1)), dtype=np.complex128)
