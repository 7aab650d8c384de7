# SPDX-License-Identifier: MIT
"""Everything the page makes of the samples of one run: lanes, spectra, response functions, what the diagram is from."""

from __future__ import annotations

from collections import deque
from typing import Any

import numpy as np
from numpy.typing import NDArray

from okid._errors import InputError
from okid.live.averages import SHORTEST, Averages, cross_bytes, segment_length
from okid.live.config import PageConfig
from okid.live.diagram import Material
from okid.live.envelope import Envelope
from okid.live.recent import Recent
from okid.live.run_state import Channel

Real = NDArray[np.float64]
KEPT_S, KEPT_BYTES = 60.0, 64 << 20
MOST_COLUMNS, COLUMNS_PER_S = 400_000, 100.0  # columns of all lanes together that go to a page at once
MOST_HIT_SAMPLES, MOST_HITS = 16384, 40
TRIES = 8  # segments of which one at least must be whole
MOST_CHANNELS, CROSS_BYTES = 4096, 256 << 20  # what a `start` event may ask for; sums for response functions


class Measured:
    """Channels in the order of the samples: n_u forces, n_y responses, then aux channels.

    Memory: 8 bytes a sample of the last 60 s (of the window or of the whole, `config.length_s`, where that is longer),
    at most 64 MB, and the averages, of which response functions take at most 256 MB: shorter segments, or
    spectra alone. InputError above 4096 channels.
    """

    def __init__(self, channels: list[Channel], rate_hz: float, config: PageConfig) -> None:
        m = len(channels)
        if m > MOST_CHANNELS:
            raise InputError(f"{m} channels, a page shows at most {MOST_CHANNELS}")
        self.channels, self.rate_hz = channels, rate_hz
        self.n_u = sum(each.role == "force" for each in channels)
        self.n_y = sum(each.role not in ("force", "aux") for each in channels)
        window = config.identification.window_s
        whole = config.length_s or 0.0
        seconds = max(KEPT_S, (window or 0.0) + 2.0, whole + 1.0)
        self.recent = Recent(m, int(max(1024, min(seconds * rate_hz, KEPT_BYTES / (8 * m)))))
        columns = min(COLUMNS_PER_S, MOST_COLUMNS / (m * max(KEPT_S, whole)))
        self.envelope = Envelope(m, rate_hz, max(KEPT_S, whole), COLUMNS_PER_S if whole <= KEPT_S else columns)
        self._window = None if window is None else max(1, round(window * rate_hz))
        self._hammer = config.hammer
        self._before = round(config.hit_before_s * rate_hz)
        if config.hammer:
            length = min(MOST_HIT_SAMPLES, self._before + max(16, round(config.hit_s * rate_hz)))
            self.averages = self._averages(length, hits=True)
        else:
            length = segment_length(rate_hz, window)
            most = None if window is None else max(10, round(2 * window * rate_hz / length) - 1)
            self.averages = self._averages(length, most=most)
        self._blows: deque[int] = deque()
        self._hits: deque[Real] = deque(maxlen=MOST_HITS)
        self._basis = 0  # samples before it belong to another state of the structure

    def _averages(self, length: int, *, hits: bool = False, most: int | None = None) -> Averages:
        """With segments of that length, or as long as fit."""
        while not hits and length > SHORTEST and cross_bytes(self.n_u, self.n_y, length) > CROSS_BYTES:
            length //= 2
        fits = cross_bytes(self.n_u, self.n_y, length) <= CROSS_BYTES
        n_u, n_y = (self.n_u, self.n_y) if fits else (0, 0)
        return Averages(n_u, n_y, len(self.channels), self.rate_hz, length, hits=hits, most=most)

    def add(self, first: int, values: Real) -> None:
        """Samples first .. as (m, count). Raises InputError when they are not of m channels."""
        if values.ndim != 2 or values.shape[0] != len(self.channels):
            raise InputError(f"samples of shape {values.shape}, expected {len(self.channels)} channels")
        placed = self.recent.add(first, values)
        if placed is None:
            return
        self.envelope.add(placed)
        if self._hammer:
            self._take_blows()
            return
        if placed.fresh:
            self.averages.interrupt()
        skip = max(0, self._basis - placed.first)
        if skip < len(placed.block):
            self.averages.add(placed.block[skip:])
            self._shorten()

    def _shorten(self) -> None:
        """Where gaps leave hardly a whole segment, segments of half the length."""
        old = self.averages
        if old.tried < TRIES or old.useful * TRIES > old.tried or old.length <= SHORTEST:
            return
        most = None if old.most is None else 2 * old.most
        self.averages = self._averages(old.length // 2, most=most)
        self.restart(self._basis)

    def hit(self, sample: int) -> None:
        """A good hit at that sample: its average is taken when the ring-down is there."""
        if self._hammer:
            self._blows.append(sample - self._before)
            self._take_blows()

    def _take_blows(self) -> None:
        length = self.averages.length
        while self._blows and self._blows[0] + length <= self.recent.end:
            first = self._blows.popleft()
            rows = self.recent.read(first, length)
            self.averages.add_segment(rows)
            self._hits.append(rows)

    def restart(self, sample: int) -> None:
        """What was before that sample does not count any more."""
        self._basis = max(self._basis, sample)
        if not self._hammer:
            self.averages.restart()
            first = max(self._basis, self.recent.oldest)
            if first < self.recent.end:
                self.averages.add(self.recent.read(first, self.recent.end - first))

    def material(self) -> Material | None:
        """What the diagram is made from: the window of the config, at most what is kept; the hits of a hammer test.

        None without responses or samples. O(m samples).
        """
        m = self.n_u + self.n_y
        if self.n_y == 0:
            return None
        if self._hammer:
            stretches = [rows[:, :m] for rows in self._hits]
        else:
            end = self.recent.end
            first = max(self.recent.oldest, self._basis, 0 if self._window is None else end - self._window)
            stretches = [self.recent.read(first, end - first)[:, :m]] if end > first else []
        return Material(self.n_u, self.n_y, self.rate_hz, stretches) if stretches else None

    def facts(self) -> dict[str, Any]:
        """Counts and sizes for the page."""
        return {
            "averages": self.averages.averages,
            "most": self.averages.most,
            "resolution_hz": self.rate_hz / self.averages.length,
            "segment_s": self.averages.length / self.rate_hz,
            "column_s": self.envelope.width / self.rate_hz,
            "columns": self.envelope.capacity,
        }
