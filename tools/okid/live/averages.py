# SPDX-License-Identifier: MIT
"""Power spectra and H1 response functions with coherence that build up while samples come in (Welch's method)."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from okid.frf import solve_h1

Real = NDArray[np.float64]
Complex = NDArray[np.complex128]
SHORTEST, LONGEST = 64, 4096  # samples of a segment
SEGMENT_S = 4.1  # 4096 samples at 1 kHz


def segment_length(rate_hz: float, window_s: float | None = None) -> int:
    """Samples of a segment: a power of two of at most 4.1 s, and of at most half of the window."""
    seconds = SEGMENT_S if window_s is None else min(SEGMENT_S, window_s / 2.0)
    length = SHORTEST
    while 2 * length <= min(LONGEST, seconds * rate_hz):
        length *= 2
    return length


def cross_bytes(n_u: int, n_y: int, length: int) -> int:
    """What the sums for response functions take."""
    return 16 * (length // 2 + 1) * n_y * n_u * (n_u + 1)


class Response(NamedTuple):
    """H1 of one output to one input: response (F,), coherence (F,) with all inputs (NaN while there are not more
    averages than inputs), averages."""

    response: Complex
    coherence: Real
    averages: int


class Averages:
    """Sums over segments of `length` samples: n_u inputs, n_y outputs, then channels that only have a spectrum.

    Hann windows with half overlap; after `most` averages the oldest fade (None = all count the same). A segment with a
    missing input counts for no response, one with a missing output not for that one, so a dead channel costs its own
    curves only. Memory 16 F n_y n_u (n_u + 1) bytes; a segment costs m FFTs and F n_y n_u (n_u + 1) multiply-adds.
    Source: Welch (1967); Bendat and Piersol, multiple-input H1.
    """

    def __init__(
        self, n_u: int, n_y: int, channels: int, rate_hz: float, length: int, *, hits: bool = False,
        most: int | None = None,
    ) -> None:  # fmt: skip
        self.n_u, self.n_y, self.rate_hz, self.length, self.most = n_u, n_y, rate_hz, length, most
        self._shape = np.ones(length) if hits else np.hanning(length + 1)[:length]
        self._scale = 2.0 / (rate_hz * float(np.sum(self._shape**2)))
        lines = length // 2 + 1
        self._power = np.zeros((channels, lines))
        self._seen = np.zeros(channels, np.int64)
        self._guu = np.zeros((n_y, lines, n_u, n_u), np.complex128)
        self._gyu = np.zeros((n_y, lines, n_u), np.complex128)
        self._gyy = np.zeros((n_y, lines))
        self._paired = np.zeros(n_y, np.int64)
        self._rest = np.empty((0, channels))
        self.tried = 0  # segments since the beginning, broken ones too

    @property
    def frequency_hz(self) -> Real:
        """(F,)."""
        return np.arange(self.length // 2 + 1, dtype=np.float64) * (self.rate_hz / self.length)

    @property
    def averages(self) -> int:
        """Segments of the channel that has most, faded ones too."""
        return int(np.max(self._seen, initial=0))

    @property
    def useful(self) -> int:
        """Segments of the response that has most, of the spectrum that has most where there are no inputs."""
        return int(np.max(self._paired, initial=0)) if self.n_u and self.n_y else self.averages

    def interrupt(self) -> None:
        """The next samples do not follow the last ones."""
        self._rest = self._rest[:0]

    def restart(self) -> None:
        """Forget everything."""
        self.tried = 0
        for sums in (self._power, self._seen, self._guu, self._gyu, self._gyy, self._paired):
            sums[:] = 0
        self._rest = self._rest[:0]

    def add(self, block: Real) -> None:
        """Samples (count, m) that follow the ones before, NaN = missing."""
        rows = np.vstack([self._rest, block])
        step, first = self.length // 2, 0
        while first + self.length <= len(rows):
            self.add_segment(rows[first : first + self.length])
            first += step
        self._rest = rows[first:]

    def add_segment(self, rows: Real) -> None:
        """One segment (length, m): a stretch of the stream, or a hit with its ring-down."""
        self.tried += 1
        steady = np.ascontiguousarray(rows.T)  # its rows are transformed where they lie
        mean = np.mean(steady, axis=1)
        whole = np.isfinite(mean)
        if not np.any(whole):
            return
        steady = (steady - mean[:, None]) * self._shape
        steady[~whole] = 0.0
        spectrum = np.fft.rfft(steady, axis=1)  # (m, F)
        power = spectrum.real**2 + spectrum.imag**2
        self._seen[whole] += 1
        share = self._share(self._seen[whole])[:, None]
        self._power[whole] += share * (power[whole] - self._power[whole])
        if self.n_u == 0 or not np.all(whole[: self.n_u]):
            return
        good = np.flatnonzero(whole[self.n_u : self.n_u + self.n_y])
        if len(good) == 0:
            return
        u, y = spectrum[: self.n_u].T, spectrum[self.n_u + good]
        self._paired[good] += 1
        part = self._share(self._paired[good])
        cross = (y[:, :, None] * u[None].conj()) - self._gyu[good]
        self._gyu[good] += part[:, None, None] * cross
        self._guu[good] += part[:, None, None, None] * ((u[:, :, None] * u[:, None, :].conj())[None] - self._guu[good])
        self._gyy[good] += part[:, None] * (power[self.n_u + good] - self._gyy[good])

    def _share(self, seen: NDArray[np.int64]) -> Real:
        """Weight of the newest segment: that of a mean, not below 1 / most."""
        return 1.0 / np.minimum(seen, self.most or np.iinfo(np.int64).max).astype(np.float64)

    def spectrum(self, channel: int) -> Real:
        """One-sided power spectral density (F,) of a channel, unit^2/Hz; NaN before its first segment."""
        if self._seen[channel] == 0:
            return np.full(self.length // 2 + 1, np.nan)
        density: Real = self._power[channel] * self._scale
        density[0] *= 0.5
        if self.length % 2 == 0:
            density[-1] *= 0.5
        return density

    def response(self, output: int, given: int) -> Response | None:
        """H1 of an output (from 0) to an input (from 0); None before there is a segment with both, or where no
        responses are kept."""
        if output >= self.n_y or given >= self.n_u:
            return None
        count = int(self._paired[output])
        if count == 0:
            return None
        of_one = self._gyu[output][:, None], self._gyy[output][:, None]
        response, coherence = solve_h1(self._guu[output], *of_one, count)
        return Response(response[:, 0, given], coherence[:, 0], count)
